"""The interface of every way to excite the tool: a program per frequency, gathered channels, the reference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.pmac.axes import read_definitions
from drivers.pmac.compensation.table import CompensationTable
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.gathering.gather_client import GatheredData
from drivers.pmac.heartbeat.watchdog import watchdog_condition
from drivers.pmac.language.text import format_number
from drivers.pmac.programs.own_program import signed
from drivers.pmac.programs.setup import END_FLAG
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError

PROGRAM = 998  # number of the program that swings the tool; it must be free before, and is deleted afterwards
RAMP_MS = 400  # time over which the swing grows, and over which it fades
SETTLE_S = 0.2  # steady time before gathering starts: ten time constants of the published loop
SLACK_S = 1.2  # how much longer than its sine a program runs, for a host that is slow to begin and to end

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """One program. It is steady from `steady_s` after its start, and ends by itself within `longest_s`."""

    text: str
    steady_s: float
    longest_s: float


class Excitation(Protocol):
    """A way to excite the tool with a sine."""

    channels: tuple[str, str]
    """The gathered channels: the source of the reference, and the tool position."""

    table: CompensationTable | None
    """The table that must be on meanwhile."""

    @property
    def late_cycles(self) -> int:
        """Delay of the reference in servo cycles; it is part of the measured response."""

    def sweep(self, frequency_hz: float, periods: int) -> Sweep:
        """Return the program for one frequency."""

    def reference_counts(self, data: GatheredData) -> Floats:
        """Return the commanded tool positions, in counts, at the gathered instants."""


def program_text(form: str, machine: MachineProfile, word: AxisWord, **values: float) -> str:
    """Fill in a program; `go_on` is checked in each segment between its ramps: not ended, the watchdog alive."""
    text = form.format(
        letter=word.letter,
        program=PROGRAM,
        flag=END_FLAG,
        go_on=f"{END_FLAG}=0 AND {watchdog_condition(DIALECTS[machine.controller.family])}",
        **{name: format_number(value) for name, value in values.items()},
    )
    return signed(text)


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisWord:
    """One motor with an axis of its own: `scale` counts per unit, zero at `offset` counts."""

    letter: str
    scale: float
    offset: float

    def position(self, counts: float) -> float:
        """Return a position of the motor in units of the axis."""
        return (counts - self.offset) / self.scale

    def length(self, counts: float) -> float:
        """Return a distance, or a speed, in units of the axis."""
        return counts / self.scale


def axis_word(machine: MachineProfile, motor: int) -> AxisWord:
    """Return the axis of a motor. Raises ProfileError: `identify.axis`, the motor has none of its own."""
    definitions = read_definitions(machine.controller.axis_definitions)
    found = [each for each in definitions if each.motor == motor]
    if not found or len(found[0].terms) != 1 or not found[0].scale:
        value = str(found[0]) if found else "-"
        raise ProfileError(Problem(code="identify.axis", key="axis_definitions", where=f"#{motor}", value=value))
    return AxisWord(letter=found[0].axis, scale=found[0].scale, offset=found[0].offset)
