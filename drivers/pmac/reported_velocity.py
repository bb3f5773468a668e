"""The velocity that V and control-V of a Turbo report: averaged over the last 16 positions that were kept."""

from __future__ import annotations

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

    def kept_cycles(self, cycles: int, before: int) -> range:
        """Return which of the next servo cycles are kept, after `before` of them."""
        if self._variables.i_revision != self._revision:
            self._follow_settings()
        return range(self._period - 1 - before % self._period, cycles, self._period)

    def keep(self, position: float) -> None:
        """Take the position in such a cycle, counts."""
        self._change = position - self._slots[self._oldest]
        self._slots[self._oldest] = position
        self._oldest = (self._oldest + 1) % SLOTS

    def rebase(self, offset: float) -> None:
        """Count from a new zero."""
        self._slots = [position - offset for position in self._slots]

    def _follow_settings(self) -> None:
        variables = self._variables
        self._revision = variables.i_revision
        self._period = max(1, int(variables.i(self._period_number)) + 1)
        self._shift = max(0, min(int(variables.i(self._shift_number)), _LARGEST_SHIFT))


def averaged_velocity(variables: VariableStore) -> AveragedVelocity | None:
    """Return a new buffer, None in a family whose reports are not averaged."""
    numbers = variables.dialect.velocity_average
    return None if numbers is None else AveragedVelocity(variables, numbers)
