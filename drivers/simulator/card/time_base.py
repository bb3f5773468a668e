"""The time base of a coordinate system: the rate of its trajectory time."""

from __future__ import annotations

import math

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.settings import I10_PER_MS
from drivers.pmac.variables import VariableStore
from drivers.simulator.card.player import Player

REAL_TIME_PERCENT = 100.0
_OVERRIDE_SLEW, _HOLD_SLEW = 94, 95  # Ix94 and Ix95: maximum change of the time base per servo cycle, 2^-23 ms
_WIDEST = I10_PER_MS - 1  # the time base is a signed 24-bit word, a servo cycle's worth in 2^-23 ms


class TimeBase:
    """The commanded time base, the effect of a feed hold, and the value that slews between them.

    The command is `%`, or the source that Ix93 names instead, anew in each servo cycle. `percent` is the present
    value; at 100 a servo cycle is a servo cycle, as I10 states it. `real_time` is whether that is so and stays so.
    A feed hold and the start after it slew at Ix95, everything else at Ix94.
    """

    def __init__(self, system: int, variables: VariableStore) -> None:
        self.percent = REAL_TIME_PERCENT
        self.holding = False
        self.real_time = True
        self._override = REAL_TIME_PERCENT
        self._led: float | None = None
        self._resuming = False
        self._system = system
        self._variables = variables

    @property
    def led(self) -> bool:
        """Whether another source than `%` sets the rate of time."""
        return self._led is not None

    @property
    def steady(self) -> bool:
        """Whether the present value equals the commanded one."""
        return self.percent == self._goal

    @property
    def stopped(self) -> bool:
        """Whether no trajectory time passes, nor will without another command."""
        return self.percent == 0.0 and self._goal == 0.0

    @property
    def _goal(self) -> float:
        if self.holding:
            return 0.0
        return self._override if self._led is None else self._led

    def set_override(self, percent: float) -> None:
        """Command another rate, up to the controller's maximum. Raises PmacError: 003, not a number from 0."""
        if not (math.isfinite(percent) and percent >= 0.0):
            raise PmacError(ErrorCode.DATA_ERROR, f"%{percent}; from 0")
        self._override = min(percent, REAL_TIME_PERCENT * _WIDEST / self._units())
        self._note()

    def lead(self, units: int | None) -> None:
        """Take the source's value for this servo cycle, 2^-23 ms; None returns the command to `%`."""
        self._led = None if units is None else REAL_TIME_PERCENT * units / self._units()
        self._note()

    def hold(self) -> None:
        """Slew to a stop."""
        self.holding, self._resuming = True, False
        self._note()

    def release(self) -> None:
        """Slew back to the `%` command, after a feed hold."""
        self._resuming = self._resuming or self.holding
        self.holding = False
        self._note()

    def restart(self) -> None:
        """Clear a hold when the motion is over: the next one begins at the `%` command."""
        if self.holding or self._resuming:
            self.holding = self._resuming = False
            self.percent = self._goal
            self._note()

    def reset(self) -> None:
        """Return to real time, as at power-up."""
        self.holding = self._resuming = False
        self.percent = self._override = REAL_TIME_PERCENT
        self._led = None
        self._note()

    def play(self, player: Player, cycles: int, cycle_ms: float) -> list[list[float]]:
        """Return a block of positions for each motor at this rate, cycle by cycle while it changes."""
        if self.steady:
            return player.sample(cycles, cycle_ms, cycle_ms * (self.percent / REAL_TIME_PERCENT))
        tracks: list[list[float]] = [[] for _ in player.position]
        for _ in range(cycles):
            self.advance(1)
            sampled = player.sample(1, cycle_ms, cycle_ms * (self.percent / REAL_TIME_PERCENT))
            for track, (position,) in zip(tracks, sampled, strict=True):
                track.append(position)
        return tracks

    def advance(self, cycles: int) -> None:
        """Slew for so many servo cycles."""
        slew = _HOLD_SLEW if self.holding or self._resuming else _OVERRIDE_SLEW
        units = max(0.0, self._variables.system(self._system, slew))
        most = cycles * units * REAL_TIME_PERCENT / self._units()
        change = self._goal - self.percent
        if abs(change) <= most:
            self.percent = self._goal
            self._resuming = False
        else:
            self.percent += math.copysign(most, change)
        self._note()

    def _note(self) -> None:
        self.real_time = self._led is None and self.steady and self.percent == REAL_TIME_PERCENT

    def _units(self) -> int:
        """A servo cycle as I10 states it, in 2^-23 ms."""
        return max(1, int(self._variables.i(10)) % I10_PER_MS)
