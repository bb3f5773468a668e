"""Checks of `console doctor` besides those of the configuration: of the link, and by moving."""

from __future__ import annotations

from argparse import Namespace
from contextlib import suppress
from datetime import date
from importlib.metadata import entry_points

from console.cli.machine.card_access import Card
from console.cli.machine.stop_checks import keep_stops
from console.cli.machine.stopping import Stopping
from console.session.signals import Interruption
from console.text.catalogue import Catalogue
from drivers.commissioning.check import Check, Group
from drivers.commissioning.verification import Verification
from drivers.errors import DriverError
from drivers.lathe.ownership import Ownership, Standing
from drivers.pmac.checksums import LineCheck
from profiles.findings import Severity

DISTRIBUTION = "trilobe"
"""Name of this distribution, and of the command that no other one claims."""


def arrival_check(line_check: LineCheck) -> Check:
    """Return the check of what ensures that a motion command arrives as it was sent."""
    code = "network_checksums" if line_check is LineCheck.NETWORK else "line_checksums"
    severity = Severity.WARNING if line_check is LineCheck.NOBODY else Severity.OK
    return Check(group=Group.CARD, code=code, severity=severity)


def command_checks() -> list[Check]:
    """Return a warning for each other distribution whose `console` may shadow ours."""
    claims = entry_points(group="console_scripts", name="console")
    others = sorted({claim.dist.name for claim in claims if claim.dist} - {DISTRIBUTION})
    return [
        Check(
            group=Group.SYSTEM, code="command_taken", severity=Severity.WARNING, found=other, wanted=DISTRIBUTION
        )
        for other in others
    ]


def proven_checks(
    options: Namespace, card: Card, verification: Verification, text: Catalogue
) -> tuple[Check, ...]:
    """Run the commissioning tests with control of the machine; every ending signal becomes a stop."""
    # Gathering loads numerics, which are needed only for these tests.
    from drivers.commissioning.proofs.proving import prove

    interruption = Interruption()
    ownership = Ownership(card.client)
    interruption.guard(
        card.stop,
        anothers=lambda: ownership.standing is not Standing.OWNER,
        changing=lambda: ownership.standing is Standing.CHANGING,
    )
    interruption.install()
    # Stops are measured here, so nothing may repeat them; only the end of the process is enforced.
    with Stopping(interruption, text).watching(card.stop, ends_only=True):
        try:
            ownership.claim()
            proven = prove(card.client, card.stop, card.clock, verification, ownership.number, ownership.see)
        finally:
            with suppress(DriverError):
                ownership.release()
    keep_stops(options, card, proven, date.today())
    return proven.checks
