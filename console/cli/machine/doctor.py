"""`console doctor`: may this machine be moved? Every check with a tick or a cross, and what helps."""

from __future__ import annotations

from argparse import Namespace
from contextlib import suppress
from datetime import date

from console.cli.agreement import agreed
from console.cli.arguments import add_link, add_machine
from console.cli.machine.card_access import Card, opened_card
from console.cli.machine.card_lines import card_fields, card_line
from console.cli.machine.check_fields import check_fields
from console.cli.machine.check_lines import check_lines, summary_line
from console.cli.machine.signature_checks import signature_checks
from console.cli.machine.stop_checks import keep_stops, stop_checks
from console.cli.machine.stopping import Stopping
from console.cli.output import print_json
from console.cli.parser import Parser
from console.session.signals import Interruption
from console.text.catalogue import Catalogue
from drivers.commissioning.check import Check, Group, Outcome, worst
from drivers.commissioning.proofs.bench import names_of, unproven
from drivers.commissioning.verification import Verification, in_order, verify
from drivers.errors import DriverError
from drivers.lathe.ownership import Ownership
from drivers.lathe.standing import Standing
from drivers.pmac.checksums import LineCheck


def add(parser: Parser, text: Catalogue) -> None:
    """Add the machine, its address, and whether to prove what only a motion can prove."""
    add_machine(parser, text)
    add_link(parser, text)
    parser.add_argument("--prove", action="store_true", help=text("help.prove"))
    parser.add_argument("--yes", action="store_true", help=text("help.doctor.yes"))


def main(options: Namespace, text: Catalogue) -> int:
    """Check, and prove if that is asked for; 1 when something fails."""
    with opened_card(options, text) as card:
        unsigned = signature_checks(card)
        verification = verify(card.client, card.machine, card.dialect)
        asked = options.prove and not unsigned
        moves = asked and agreed(options, card.machine.name, card.simulated, text, "doctor")
        if moves and not card.simulated:
            verification = verify(card.client, card.machine, card.dialect)  # the answer may have taken its time
        proofs = _proven(options, card, verification, text) if moves else unproven(names_of(card.machine))
        stops = stop_checks(options, card, date.today())
    checks = in_order([*verification.checks, _arrival_check(card.client.line_check), *unsigned, *stops, *proofs])
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
    return 1 if refused or worst(checks) is Outcome.FAILS else 0


def _arrival_check(line_check: LineCheck) -> Check:
    """Return who sees that a line that moves something arrives as it was sent."""
    code = "network_checksums" if line_check is LineCheck.NETWORK else "line_checksums"
    outcome = Outcome.WARNED if line_check is LineCheck.NOBODY else Outcome.HOLDS
    return Check(group=Group.CARD, code=code, outcome=outcome)


def _proven(options: Namespace, card: Card, verification: Verification, text: Catalogue) -> tuple[Check, ...]:
    """Prove as the one who controls the machine, with every signal that would end the command as a stop."""
    # What gathers loads numerics; nobody waits for them who proves nothing.
    from drivers.commissioning.proofs.proving import prove

    interruption = Interruption()
    ownership = Ownership(card.client)
    interruption.guard(
        card.stop,
        anothers=lambda: ownership.standing is not Standing.OWNER,
        changing=lambda: ownership.standing is Standing.CHANGING,
    )
    interruption.install()
    # Stops are measured here, so that nobody may repeat them; only the end of the process is seen to.
    with Stopping(interruption, text).watching(card.stop, ends_only=True):
        try:
            ownership.claim()
            proven = prove(card.client, card.stop, card.clock, verification, ownership.number, ownership.see)
        finally:
            with suppress(DriverError):
                ownership.release()
    keep_stops(options, card, proven, date.today())
    return proven.checks
