"""For which machine the safety devices were signed for: a signature for the simulator opens no real machine."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from profiles.machine_fields import SIGNED_FOR
from profiles.problem import Problem

if TYPE_CHECKING:
    from profiles.machine import MachineProfile

MACHINE, SIMULATOR = SIGNED_FOR


def signature_gaps(sections: Mapping[str, Mapping[str, Any]], *, where: str) -> list[Problem]:
    """Return the refusal of a signature that does not say what was signed for: `key.missing`."""
    safety = sections.get("safety", {})
    if not safety.get("signed_by") or safety.get("signed_for") != "":
        return []
    return [Problem(code="key.missing", where=where, key="safety.signed_for", limit=" | ".join(SIGNED_FOR))]


def iron_problems(machine: MachineProfile) -> tuple[Problem, ...]:
    """Return why a profile may not be used on a real link: `safety.signed_for_simulator`.

    A copy of a bundled profile carries its signature along; whoever makes it true signs anew.
    """
    if machine.safety.signed_for != SIMULATOR:
        return ()
    problem = Problem(
        code="safety.signed_for_simulator",
        where=machine.name,
        key="safety.signed_for",
        value=machine.safety.signed_for,
        limit=MACHINE,
    )
    return (problem,)
