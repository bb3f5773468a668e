"""Gains on trial in the controller, as the screens show them; light, because the state has it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from drivers.commissioning.checked_configuration import is_same_number
from profiles.axis.servo_gains import shown_names
from profiles.problem import Problem

UNPROVEN = (
    "trial.unproven",
    "trial.overshoots",
    "trial.swings",
    "trial.incoherent",
    "trial.read_otherwise",
    "trial.notch_undecided",
    "trial.disagrees",
)
"""Why nothing is cut with gains that the profile has taken over from a trial."""

Gains = tuple[tuple[str, float], ...]
"""Ix30 to Ix33 and Ix36 to Ix39 of the tool: names and values."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StandingTrial:
    """Gains that were applied and not taken back: what was there before, what was written, what was found now.

    `date` is UTC. `problems` is why nothing is cut with them; where not `whole`, drives are not enabled, either.
    """

    date: str
    by: str
    before: Gains
    proposed: Gains
    found: Gains
    whole: bool
    problems: tuple[Problem, ...]


def format_gains(gains: Gains) -> str:
    """Return gains as text, `-` for none; a notch filter that there is not is left out."""
    values = dict(gains)
    return ", ".join(f"{name} {values[name]:.11g}" for name in shown_names(values)) or "-"


def differing_words(differing: Mapping[str, tuple[float, float]]) -> str:
    """Return variables that are not as stated as text: what was found, and in brackets what is stated."""
    return ", ".join(f"{name} {found:.11g} ({stated:.11g})" for name, (stated, found) in differing.items())


def divide_gains(before: Gains, proposed: Gains, found: Gains) -> tuple[Gains, Gains, Gains]:
    """Return what was found as proposed, as before, and neither; a gain that was not to change is as before."""
    new: list[tuple[str, float]] = []
    old: list[tuple[str, float]] = []
    others: list[tuple[str, float]] = []
    for (name, was), (_, wanted), (_, now) in zip(before, proposed, found, strict=True):
        (old if is_same_number(now, was) else new if is_same_number(now, wanted) else others).append((name, now))
    return tuple(new), tuple(old), tuple(others)


def stands_problem(before: Gains, proposed: Gains, found: Gains) -> Problem:
    """Return what stands in the controller after writing did not come to its end."""
    new, old, others = (format_gains(each) for each in divide_gains(before, proposed, found))
    return Problem(code="trial.stands", key=new, value=old, limit=others)
