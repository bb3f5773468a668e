"""What every way of exciting the tool gives: a program for one frequency, what is gathered, and the reference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.pmac.compensation.table import CompensationTable
from drivers.pmac.dialect import Dialect
from drivers.pmac.gathering.gathered_data import GatheredData
from drivers.pmac.heartbeat.watchdog import watchdog_condition
from drivers.pmac.programs.setup import END_FLAG

PROGRAM = 998
"""The program that swings the tool; nobody's program may be there, and none is left."""

RAMP_MS = 400
"""Time in which the swing grows, and in which it fades."""

SETTLE_S = 0.2
"""Steady time before anything is gathered: ten time constants of the published loop."""

SLACK_S = 1.2
"""How much longer than its sine a program goes on, for a host that is slow to begin and to end."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """One program. It is steady from `steady_s` after its start on, and ends by itself within `longest_s`."""

    text: str
    steady_s: float
    longest_s: float


class Excitation(Protocol):
    """A way to excite the tool by a sine."""

    channels: tuple[str, str]
    """What is gathered: where the reference comes from, and where the tool is."""

    table: CompensationTable | None
    """The table that has to be on meanwhile."""

    @property
    def late_cycles(self) -> int:
        """By how many servo cycles the card sees the reference late; they are part of what is measured."""

    def sweep(self, frequency_hz: float, periods: int) -> Sweep:
        """Return the program for one frequency."""

    def reference_counts(self, data: GatheredData) -> Floats:
        """Return where the tool is told to be, in its counts, at the instants of what was gathered."""


def go_on(dialect: Dialect) -> str:
    """Return what a program looks at in each segment between its ramps: nobody has ended it, its lease lives."""
    return f"{END_FLAG}=0 AND {watchdog_condition(dialect)}"
