"""Numbers that the page Align asks for, and what an entry is judged by. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from console.session.cut.alignment import Alignment
from console.session.station.state import StationState
from console.session.typed_number import typed_number
from console.tui.lines import Line, dim, fitted
from drivers.lathe.snapshot import AxisName
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError

ENTRY_COLUMN, ENTRY_WIDTH = 12, 12
"""Where the entry is in its panel: after the label, before the unit."""


class Asked(StrEnum):
    """What is asked for."""

    NOTHING = "nothing"
    Z = "z"
    C = "c"
    DIAMETER = "diameter"
    TORQUE = "torque"
    FORCE = "force"


AXES = {Asked.Z: AxisName.CARRIAGE, Asked.C: AxisName.SPINDLE}
"""Axes that go to a typed target."""

UNITS = {Asked.Z: "mm", Asked.C: "°", Asked.DIAMETER: "mm", Asked.TORQUE: "N m", Asked.FORCE: "N"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What an entry is judged by."""

    asked: Asked
    typed: str
    state: StationState
    job: Job | None
    machine: MachineProfile

    @property
    def alignment(self) -> Alignment:
        """What is known of the machine."""
        return self.state.alignment


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """How an entry was understood: a value, and what is against it. None without a number."""

    value: float | None = None
    problems: tuple[Problem, ...] = ()


def number_of(question: Question, key: str, low: float, high: float, decimals: int = 3) -> Answer:
    """Return the typed number within a range; nothing typed is no problem yet."""
    if not question.typed.strip():
        return Answer()
    unit = UNITS[question.asked]
    limit = f"{low:.{decimals}f} … {high:.{decimals}f} {unit}"
    try:
        value = typed_number(question.typed, key, limit)
    except ProfileError as error:
        return Answer(problems=tuple(error.problems))
    if low <= value <= high:
        return Answer(value=value)
    outside = Problem(code="screen.number_out_of_range", value=f"{value:.{decimals}f} {unit}", limit=limit)
    return Answer(value=value, problems=(outside,))


def entry_row(label: str, asked: Asked) -> Line:
    """Return the row over which the entry lies."""
    return (dim(fitted(label, ENTRY_COLUMN)), dim(" " * (ENTRY_WIDTH + 1)), dim(UNITS[asked]))
