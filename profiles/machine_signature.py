"""Who has signed for the safety devices, and for which machine: one for the simulator opens no real machine."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from profiles.fields import is_blank, spelled
from profiles.machine_fields import SIGNED_FOR
from profiles.problem import Problem

if TYPE_CHECKING:
    from profiles.machine import MachineProfile

MACHINE, SIMULATOR = SIGNED_FOR


def is_signature(signed_by: str) -> bool:
    """Whether a text names somebody: there is a letter in it. Marks and blanks are nobody's word."""
    return any(character.isalpha() and not is_blank(character) for character in signed_by)


def signature_gaps(sections: Mapping[str, Mapping[str, Any]], *, where: str) -> list[Problem]:
    """Return the refusal of a signature that names nobody, or does not say what was signed for.

    Problem codes: `safety.nobody_named`, `key.missing`.
    """
    safety = sections.get("safety", {})
    signed_by, key = safety.get("signed_by"), "safety.signed_by"
    if not signed_by:
        return []
    if not is_signature(signed_by):
        return [Problem(code="safety.nobody_named", where=where, key=key, value=spelled(signed_by))]
    if safety.get("signed_for") != "":
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
