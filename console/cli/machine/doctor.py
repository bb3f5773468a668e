"""`console doctor`: pre-flight checks, each with its fix."""

from __future__ import annotations

from argparse import Namespace
from datetime import date

from console.cli.arguments import LINK, add_shared
from console.cli.parser import Parser
from console.text.catalogue import Catalogue


def add(parser: Parser, text: Catalogue) -> None:
    """Add the machine, its address, and whether to run the commissioning tests, which move it."""
    add_shared(parser, text, "machine", *LINK)
    parser.add_argument("--prove", action="store_true", help=text("help.prove"))
    parser.add_argument("--yes", action="store_true", help=text("help.doctor.yes"))


def main(options: Namespace, text: Catalogue) -> int:
    """Run the checks, and the commissioning tests if requested; 1 when something fails."""
    from console.cli.library import data_of
    from console.cli.machine import doctor_checks
    from console.cli.machine.card_access import card_fields, card_line, opened_card
    from console.cli.machine.doctor_checks import data_folder_checks
    from console.cli.output import confirm_motion, show
    from console.session.tuning.trial_checks import explained_checks
    from console.text.checks import check_fields, check_lines, summary_line
    from drivers.commissioning.verification import in_order, verify
    from profiles.findings import Severity, worst

    with opened_card(options, text) as card:
        unsigned = doctor_checks.signature_checks(card)
        verification = verify(card.client, card.machine, card.client.dialect)
        read = verification.judged.configuration
        trial = explained_checks(data_of(options), card.machine, card.address, read, simulated=card.simulated)
        moves = options.prove and not unsigned and confirm_motion(options, card.machine.name, card.simulated, text)
        if moves:
            if not card.simulated:
                # The answer may have taken time.
                verification = verify(card.client, card.machine, card.client.dialect)
            made = doctor_checks.proven_checks(card, verification, text)
        stops = doctor_checks.stop_checks(card, date.today())
        proofs = made if moves else doctor_checks.kept_proofs(card, stops)
    arrival = doctor_checks.arrival_check(card.client.line_check)
    libraries, commands = doctor_checks.library_checks(), doctor_checks.command_checks()
    of_computer = [*libraries, *commands, *data_folder_checks(data_of(options))]
    checks = in_order([*verification.checks, arrival, *unsigned, *trial, *stops, *proofs, *of_computer])
    head = [card_line(card, text), text("configuration.marks")]
    show(
        options,
        lambda: {**card_fields(card), "checks": check_fields(checks, text)},
        lambda: [*head, *check_lines(checks, text), "", summary_line(checks, text)],
    )
    refused = options.prove and not moves
    return 1 if refused or worst(checks) is Severity.REFUSAL else 0
