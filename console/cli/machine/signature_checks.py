"""Signature of a machine on a real link, as `console doctor` and `controller verify` report it."""

from __future__ import annotations

from console.cli.machine.card_access import Card
from drivers.commissioning.check import Check, Group
from profiles.findings import Severity
from profiles.machine import real_machine_problems


def signature_checks(card: Card) -> list[Check]:
    """Return a failure where the profile of a simulated lathe meets a real link; otherwise nothing."""
    if card.simulated:
        return []
    return [
        Check(
            group=Group.SAFETY,
            code=problem.code.partition(".")[2],
            severity=Severity.REFUSAL,
            found=problem.value,
            wanted=problem.limit,
        )
        for problem in real_machine_problems(card.machine)
    ]
