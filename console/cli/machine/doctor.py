"""`console doctor`: pre-flight checks, each with its fix."""

from __future__ import annotations

from argparse import Namespace
from datetime import date

from console.cli.arguments import add_link, add_machine
from console.cli.parser import Parser
from console.text.catalogue import Catalogue


def add(parser: Parser, text: Catalogue) -> None:
    """Add the machine, its address, and whether to run the commissioning tests, which move it."""
    add_machine(parser, text)
    add_link(parser, text)
    parser.add_argument("--prove", action="store_true", help=text("help.prove"))
    parser.add_argument("--yes", action="store_true", help=text("help.doctor.yes"))


def main(options: Namespace, text: Catalogue) -> int:
    """Run the checks, and the commissioning tests if requested; 1 when something fails."""
    from console.cli.agreement import agreed
    from console.cli.machine.card_access import opened_card
    from console.cli.machine.card_lines import card_fields, card_line
    from console.cli.machine.check_fields import check_fields
    from console.cli.machine.check_lines import check_lines, summary_line
    from console.cli.machine.doctor_checks import arrival_check, command_checks, proven_checks
    from console.cli.machine.signature_checks import signature_checks
    from console.cli.machine.stop_checks import stop_checks
    from console.cli.output import print_json
    from drivers.commissioning.proofs.bench import names_of, unproven
    from drivers.commissioning.verification import in_order, verify
    from profiles.findings import Severity, worst

    with opened_card(options, text) as card:
        unsigned = signature_checks(card)
        verification = verify(card.client, card.machine, card.dialect)
        asked = options.prove and not unsigned
        moves = asked and agreed(options, card.machine.name, card.simulated, text, "doctor")
        if moves and not card.simulated:
            verification = verify(card.client, card.machine, card.dialect)  # the answer may have taken time
        proofs = proven_checks(options, card, verification, text) if moves else unproven(names_of(card.machine))
        stops = stop_checks(options, card, date.today())
    arrival = arrival_check(card.client.line_check)
    checks = in_order([*verification.checks, arrival, *unsigned, *stops, *proofs, *command_checks()])
    if options.json:
        print_json({**card_fields(card), "checks": check_fields(checks, text)})
    else:
        lines = [
            card_line(card, text),
            text("card.marks"),
            *check_lines(checks, text),
            "",
            summary_line(checks, text),
        ]
        print("\n".join(lines))
    refused = options.prove and not moves
    return 1 if refused or worst(checks) is Severity.REFUSAL else 0
