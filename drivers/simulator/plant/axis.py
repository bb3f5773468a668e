"""An ideal follower, in place of an axis whose servo is of no interest. Positions are motor counts."""

from __future__ import annotations

import math
from collections.abc import Sequence

from drivers.simulator.plant.ends import Ends

OPEN_LOOP_COUNTS_PER_S = 100_000.0
"""Speed that a full open-loop output drives an ideal axis to, in the time constant with which it runs out."""

BARE_COAST_S = 0.1
"""How an axis runs out that has no machine behind it, time constant."""

BARE_ORIGIN = 500.0
"""Where such an axis stands at power-up, in counts from a home trigger."""


class IdealAxis:
    """An axis that is where it is told to be; switched off, it runs out with a time constant.

    It has no mass: jammed, or at an end of its travel, it stands, and freed, it is at once where it is told to be.
    `at_end` is whether it was held by an end in the last block.
    """

    def __init__(self, cycle_s: float, coast_s: float, origin: float = 0.0, ends: Ends | None = None) -> None:
        self.origin = origin
        self.encoder_lost = False
        self.jammed = False
        self.at_end = False
        self._ends = ends
        self._x = 0.0
        self._reading = 0.0  # the last one, while the encoder does not count
        self._unseen = 0.0  # how far it was from there when its loop was closed on it
        self._blind = False
        self._step = 0.0
        self._keep = math.exp(-cycle_s / coast_s)
        self._full_step = OPEN_LOOP_COUNTS_PER_S * cycle_s

    def close_loop(self) -> float:
        """Stand still where it is, whatever the reading."""
        self._step = 0.0
        if not self.encoder_lost:
            self._unseen = 0.0
            return self._x
        self._unseen = self._x - self._reading
        return self._reading

    def rebase(self, counts: float) -> None:
        """Shift the motor's zero by `counts`.

        An encoder that counts again goes on from its last reading: the zero moves, what was read does not.
        """
        self.origin += counts
        self._x -= counts
        if self._blind and not self.encoder_lost:
            self._blind, self._unseen = False, 0.0
            return
        self._reading -= counts

    def follow(self, commands: Sequence[float]) -> list[float]:
        """Be where the commands say; without an encoder, as far from there as when the loop was closed."""
        if self.jammed:
            return self._stand(len(commands))
        positions = [command + self._unseen for command in commands] if self._unseen else list(commands)
        if positions:
            before = positions[-2] if len(positions) > 1 else self._x
            self._x, self._step = positions[-1], positions[-1] - before
        return self._within(positions)

    def push(self, output: float, cycles: int) -> list[float]:
        """Approach the speed of an open-loop output."""
        if self.jammed:
            return self._stand(cycles)
        positions = []
        gained = (1.0 - self._keep) * self._full_step * output
        for _ in range(cycles):
            self._step = self._keep * self._step + gained
            self._x += self._step
            positions.append(self._x)
        return self._within(positions)

    def coast(self, cycles: int) -> list[float]:
        """Run out."""
        return self.push(0.0, cycles)

    def _within(self, positions: list[float]) -> list[float]:
        """Stop at the ends of travel, and read the encoder."""
        ends, self.at_end = self._ends, False
        if ends is not None and positions and ends.holds(self._x + self.origin) != self._x + self.origin:
            positions = [ends.holds(position + self.origin) - self.origin for position in positions]
            self._x, self._step, self.at_end = positions[-1], 0.0, True
        self._blind = self.encoder_lost
        if not self._blind:
            self._reading = self._x
        return positions

    def _stand(self, cycles: int) -> list[float]:
        self._step = 0.0
        return [self._x] * cycles


def bare_axis(cycle_s: float) -> IdealAxis:
    """Return an axis with nothing behind it, for a motor that the machine does not use."""
    return IdealAxis(cycle_s, BARE_COAST_S, origin=BARE_ORIGIN)
