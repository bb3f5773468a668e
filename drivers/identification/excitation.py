"""The interface of every way to excite the tool: a program per frequency, gathered channels, the reference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.pmac.compensation.table import CompensationTable
from drivers.pmac.dialect import Dialect
from drivers.pmac.gathering.gather_client import GatheredData
from drivers.pmac.heartbeat.watchdog import watchdog_condition
from drivers.pmac.programs.setup import END_FLAG

PROGRAM = 998
"""Number of the program that swings the tool; it must be free before, and is deleted afterwards."""

RAMP_MS = 400
"""Time over which the swing grows, and over which it fades."""

SETTLE_S = 0.2
"""Steady time before gathering starts: ten time constants of the published loop."""

SLACK_S = 1.2
"""How much longer than its sine a program runs, for a host that is slow to begin and to end."""

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


def go_on(dialect: Dialect) -> str:
    """Return what a program checks in each segment between its ramps: not ended, and the watchdog alive."""
    return f"{END_FLAG}=0 AND {watchdog_condition(dialect)}"
