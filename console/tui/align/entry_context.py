"""Numbers that the page Align asks for, and what an entry is judged by. Pure.

Indicator readings of a clamping are typed as the number of places, then all of both states.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

from console.session.cut.alignment import Alignment
from console.session.station.state import StationState
from console.session.typed_number import typed_length
from console.tui.lines import Line, dim, fit_text
from console.units import METRIC, Units
from drivers.lathe.snapshot import AxisName
from profiles.fingerprint.readings import ClampReadings
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError

ENTRY_COLUMN, ENTRY_WIDTH = 12, 12
"""Where the entry is in its panel: after the label, before the unit."""
MOST_TYPED = 48
GRADUATION_UM, INCH_GRADUATION_UM = 1.0, 2.54
"""Of the dial that is taken for what somebody reads: 0.001 mm, or 0.0001 in where lengths are shown in inches."""

STATES = 2


class EntryKind(StrEnum):
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


CLAMPING = (EntryKind.PLACES, EntryKind.READING, EntryKind.INDICATED)
"""What is asked for of the readings of an indicator on the part."""

AXES = {EntryKind.Z: AxisName.CARRIAGE, EntryKind.C: AxisName.SPINDLE}
"""Axes that go to a typed target."""

UNITS = {
    EntryKind.Z: "mm",
    EntryKind.C: "°",
    EntryKind.DIAMETER: "mm",
    EntryKind.TORQUE: "N m",
    EntryKind.FORCE: "N",
    EntryKind.PLACES: "",
    EntryKind.READING: "um",
    EntryKind.INDICATED: "",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampTyping:
    """What was typed so far for the clamping that was made `at`: places, and readings, um, finger-tight first.

    `last_digit_um` is that of a digital indicator which has read itself, 0 of none.
    """

    at: str = ""
    places: int = 0
    values: tuple[float, ...] = ()
    last_digit_um: float = 0.0

    @property
    def complete(self) -> bool:
        """Whether every place was read in both states."""
        return 0 < self.places * STATES == len(self.values)

    @property
    def full(self) -> bool:
        """Whether the next reading is one at full force."""
        return len(self.values) >= self.places

    @property
    def place(self) -> int:
        """The place of the next reading, from 0."""
        return len(self.values) % self.places if self.places else 0

    @property
    def angle_deg(self) -> float:
        """The angle of the next place from jaw 1, in the direction of the spindle."""
        return 360.0 * self.place / self.places if self.places else 0.0

    def with_value(self, value: float) -> ClampTyping:
        """Return it with the number of places, or the next reading."""
        if not self.places:
            return replace(self, places=round(value))
        return replace(self, values=(*self.values, value))

    def drop_last(self) -> ClampTyping:
        """Return it without the last thing typed."""
        return replace(self, values=self.values[:-1]) if self.values else replace(self, places=0)

    def readings(self, *, simulated: bool, inch: bool = False) -> ClampReadings:
        """Return the readings, of a complete one; `inch`: those of a dial in inches."""
        return ClampReadings(
            angle_deg=tuple(360.0 * place / self.places for place in range(self.places)),
            finger_um=self.values[: self.places],
            full_um=self.values[self.places :],
            from_jaw_1=True,
            graduation_um=max(INCH_GRADUATION_UM if inch else GRADUATION_UM, self.last_digit_um),
            simulated=simulated,
        )


NOTHING_TYPED = ClampTyping()


@dataclass(frozen=True, slots=True, kw_only=True)
class EntryContext:
    """What an entry is judged by; `units` are those in which it is typed, `clamp` readings typed before it.

    `reads_itself`: there is a digital indicator on a serial line.
    """

    asked: EntryKind
    typed: str
    state: StationState
    job: Job | None
    machine: MachineProfile
    units: Units = METRIC
    clamp: ClampTyping = NOTHING_TYPED
    reads_itself: bool = False

    @property
    def alignment(self) -> Alignment:
        """What is known of the machine."""
        return self.state.alignment


@dataclass(frozen=True, slots=True, kw_only=True)
class EntryValue:
    """How an entry was understood: a value, and what is against it. None without a number."""

    value: float | None = None
    problems: tuple[Problem, ...] = ()


def number_of(question: EntryContext, key: str, low: float, high: float, decimals: int = 3) -> EntryValue:
    """Return the typed number within a range, in our unit; nothing typed is no problem yet."""
    if not question.typed.strip():
        return EntryValue()
    unit, units = UNITS[question.asked], question.units
    limit = range_words(question, low, high, decimals)
    try:
        value = typed_length(question.typed, key, limit, unit, units)
    except ProfileError as error:
        return EntryValue(problems=tuple(error.problems))
    if low <= value <= high:
        return EntryValue(value=value)
    shown = units.show(value, unit, decimals)
    return EntryValue(
        value=value, problems=(Problem(code="screen.number_out_of_range", value=shown, limit=limit),)
    )


def range_words(question: EntryContext, low: float, high: float, decimals: int = 3) -> str:
    """Return a range in the unit of the entry."""
    first, last = range_of(question, low, high, decimals)
    return f"{first} … {last} {question.units.unit(UNITS[question.asked])}"


def range_of(question: EntryContext, low: float, high: float, decimals: int = 3) -> tuple[str, str]:
    """Return the ends of a range as numbers in the unit of the entry; those in inches are within the range."""
    unit, units = UNITS[question.asked], question.units
    if units.unit(unit) == unit:
        return f"{low:.{decimals}f}", f"{high:.{decimals}f}"
    return units.format_limit(low, unit, upper=False), units.format_limit(high, unit, upper=True)


def entry_row(label: str, question: EntryContext) -> Line:
    """Return the row over which the entry lies."""
    return (
        dim(fit_text(label, ENTRY_COLUMN)),
        dim(" " * (ENTRY_WIDTH + 1)),
        dim(question.units.unit(UNITS[question.asked])),
    )
