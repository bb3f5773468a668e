"""Whether a machine behind a real link was signed for, as `console doctor` and `controller verify` report it."""

from __future__ import annotations

from console.cli.machine.card_access import Card
from drivers.commissioning.check import Check, Group
from profiles.findings import Severity
from profiles.machine import real_machine_problems


def signature_checks(card: Card) -> list[Check]:
    """Return what fails where the profile of a simulated lathe meets a real link; nothing where all is well."""
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
