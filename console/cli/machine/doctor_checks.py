"""Checks that `console doctor` makes beside those of the configuration: of the link, and by moving."""

from __future__ import annotations

from argparse import Namespace
from contextlib import suppress
from datetime import date

from console.cli.machine.card_access import Card
from console.cli.machine.stop_checks import keep_stops
from console.cli.machine.stopping import Stopping
from console.session.signals import Interruption
from console.text.catalogue import Catalogue
from drivers.commissioning.check import Check, Group, Outcome
from drivers.commissioning.verification import Verification
from drivers.errors import DriverError
from drivers.lathe.ownership import Ownership
from drivers.lathe.standing import Standing
from drivers.pmac.checksums import LineCheck


def arrival_check(line_check: LineCheck) -> Check:
    """Return who sees that a line that moves something arrives as it was sent."""
    code = "network_checksums" if line_check is LineCheck.NETWORK else "line_checksums"
    outcome = Outcome.WARNED if line_check is LineCheck.NOBODY else Outcome.HOLDS
    return Check(group=Group.CARD, code=code, outcome=outcome)


def proven_checks(
    options: Namespace, card: Card, verification: Verification, text: Catalogue
) -> tuple[Check, ...]:
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
