"""The velocity that V and control-V of a Turbo report: averaged over the last 16 positions that were kept."""

from __future__ import annotations

from collections.abc import Sequence
from math import ldexp

from drivers.pmac.variables import VariableStore

SLOTS = 16  # positions of a motor that are kept
_LARGEST_SHIFT = 255


class AveragedVelocity:
    """The rotary buffer of a motor: every I60 + 1 servo cycles its position takes the place of the oldest one."""

    def __init__(self, variables: VariableStore, numbers: tuple[int, int]) -> None:
        """`numbers` are those of the period less one, I60, and of the shift, I61."""
        self._variables = variables
        self._period_number, self._shift_number = numbers
        self._revision = -1
        self._period = 1
        self._shift = 0
        self._slots: list[float] = [0.0] * SLOTS
        self._oldest = 0
        self._change = 0.0

    @property
    def counts_per_cycle(self) -> float:
        """The change of the position over 16 (I60 + 1) servo cycles, shifted right by I61 bits."""
        self._follow_settings()
        return ldexp(self._change, -self._shift)

    def pass_by(self, encoders: Sequence[float], before: int) -> None:
        """Take the positions of a block of servo cycles, counts, of which `before` have gone before."""
        self._follow_settings()
        period = self._period
        for at in range(period - 1 - before % period, len(encoders), period):
            position = encoders[at]
            self._change = position - self._slots[self._oldest]
            self._slots[self._oldest] = position
            self._oldest = (self._oldest + 1) % SLOTS

    def due(self, cycles: int, before: int) -> bool:
        """Return whether one of the next cycles is kept."""
        self._follow_settings()
        return self._period - 1 - before % self._period < cycles

    def rebase(self, offset: float) -> None:
        """Count from a new zero."""
        self._slots = [position - offset for position in self._slots]

    def _follow_settings(self) -> None:
        variables = self._variables
        if variables.i_revision != self._revision:
            self._revision = variables.i_revision
            self._period = max(1, int(variables.i(self._period_number)) + 1)
            self._shift = max(0, min(int(variables.i(self._shift_number)), _LARGEST_SHIFT))
