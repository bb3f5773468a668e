"""Numbers that the page Align asks for, and what an entry is judged by. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from console.session.cut.alignment import Alignment
from console.session.station.state import StationState
from console.session.typed_length import typed_length
from console.tui.align.clamp_typing import NOTHING_TYPED, ClampTyping
from console.tui.lines import Line, dim, fitted
from console.units import METRIC, Units
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
    PLACES = "places"
    READING = "reading"
    INDICATED = "indicated"


CLAMPING = (Asked.PLACES, Asked.READING, Asked.INDICATED)
"""What is asked for of the readings of an indicator on the part."""

AXES = {Asked.Z: AxisName.CARRIAGE, Asked.C: AxisName.SPINDLE}
"""Axes that go to a typed target."""

UNITS = {
    Asked.Z: "mm",
    Asked.C: "°",
    Asked.DIAMETER: "mm",
    Asked.TORQUE: "N m",
    Asked.FORCE: "N",
    Asked.PLACES: "",
    Asked.READING: "um",
    Asked.INDICATED: "",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What an entry is judged by; `units` are those in which it is typed, `clamp` readings typed before it."""

    asked: Asked
    typed: str
    state: StationState
    job: Job | None
    machine: MachineProfile
    units: Units = METRIC
    clamp: ClampTyping = NOTHING_TYPED

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
    """Return the typed number within a range, in our unit; nothing typed is no problem yet."""
    if not question.typed.strip():
        return Answer()
    unit, units = UNITS[question.asked], question.units
    limit = range_words(question, low, high, decimals)
    try:
        value = typed_length(question.typed, key, limit, unit, units)
    except ProfileError as error:
        return Answer(problems=tuple(error.problems))
    if low <= value <= high:
        return Answer(value=value)
    shown = units.show(value, unit, decimals)
    return Answer(value=value, problems=(Problem(code="screen.number_out_of_range", value=shown, limit=limit),))


def range_words(question: Question, low: float, high: float, decimals: int = 3) -> str:
    """Return a range in the unit of the entry."""
    first, last = range_of(question, low, high, decimals)
    return f"{first} … {last} {question.units.unit(UNITS[question.asked])}"


def range_of(question: Question, low: float, high: float, decimals: int = 3) -> tuple[str, str]:
    """Return the ends of a range as numbers in the unit of the entry; those in inches are within the range."""
    unit, units = UNITS[question.asked], question.units
    if units.unit(unit) == unit:
        return f"{low:.{decimals}f}", f"{high:.{decimals}f}"
    return units.bound(low, unit, upper=False), units.bound(high, unit, upper=True)


def entry_row(label: str, question: Question) -> Line:
    """Return the row over which the entry lies."""
    return (
        dim(fitted(label, ENTRY_COLUMN)),
        dim(" " * (ENTRY_WIDTH + 1)),
        dim(question.units.unit(UNITS[question.asked])),
    )
