"""What a motor drives: an axis, ideal or not, its scale, and the hard stops at its ends. Motor counts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

ROUNDS: Final = 1.5 * 2.0**52  # a number plus this, less this, is rounded half to even as by `round`
FARTHEST: Final = 1e12  # counts; far inside +-2^51, where that is so

# The reading for a true position, both in counts: the built-in itself, because it is in the innermost loop of all.
read_encoder: Callable[[float], int] = round
DRAWN_AT_ONCE = 4096
OPEN_LOOP_COUNTS_PER_S = 100_000.0  # speed of an ideal axis at full output, reached as it coasts
BARE_COAST_S = 0.1  # coasting time constant of an axis without a machine
BARE_ORIGIN = 500.0  # position of such an axis at power-up, in counts from a home trigger


def count_position(place: float) -> float:
    """Return the whole count that an encoder reads at a true position."""
    return place + ROUNDS - ROUNDS if -FARTHEST < place < FARTHEST else float(round(place))


def counted_along(places: list[float]) -> list[float]:
    """Return the counts that an encoder reads on its way, at least one."""
    if -FARTHEST < min(places) and max(places) < FARTHEST:
        return [place + ROUNDS - ROUNDS for place in places]
    return [float(round(place)) for place in places]


class Axis(Protocol):
    """The axis that a motor of the simulated controller drives.

    Positions are motor counts; `origin` is the machine position of motor zero, so that homing can shift the zero
    without moving the axis. While `encoder_lost`, the encoder does not count and a closed loop sees its last
    reading; while `jammed`, the axis stands still whatever the force.
    """

    origin: float
    encoder_lost: bool
    jammed: bool

    def close_loop(self) -> float:
        """Hold the present position; return it as the commanded one, in motor counts."""

    def follow(self, commands: Sequence[float]) -> list[float]:
        """Run one servo cycle per command (counts); return the true position at each cycle."""

    def push(self, output: float, cycles: int) -> list[float]:
        """Run `cycles` in open loop; `output` is the fraction of Ix69, -1 to 1. Return the true positions."""

    def coast(self, cycles: int) -> list[float]:
        """Run `cycles` with the amplifier disabled; return the true position at each cycle."""

    def rebase(self, counts: float) -> None:
        """Make the present `counts` the new zero of the motor; the axis does not move."""


class EncoderAxis:
    """The state of every axis, in counts: its zero, its position, and the reading of its encoder.

    `at_end` is whether an end of its travel has held the axis in the last block, `hit_end` whether one has since
    that was last cleared from outside: a block of the controller may be several of the axis.
    """

    def __init__(self, origin: float) -> None:
        self.origin = origin
        self.encoder_lost = False
        self.jammed = False
        self.at_end = self.hit_end = False
        self._x = 0.0
        self._reading = 0.0  # the last one, while the encoder does not count
        self._blind = False  # whether the encoder was lost when it was last read

    def rebase(self, counts: float) -> None:
        """Shift the motor's zero by `counts`.

        An encoder that counts again continues from its last reading: the zero moves, the reading does not.
        """
        self.origin += counts
        self._x -= counts
        if self._blind and not self.encoder_lost:
            self._blind = False
        else:
            self._shift_reading(counts)

    def _shift_reading(self, counts: float) -> None:
        self._reading -= counts


class Scale:
    """A scale without noise. `now` and `before` are the noise of its last two readings, in counts.

    `drawn` is the noise of the readings that were last drawn together, None after a single one or without noise.
    """

    noisy = False

    def __init__(self) -> None:
        self.now = 0.0
        self.before = 0.0
        self.drawn: list[float] | None = None

    def read(self, place: float) -> int:
        """Return the reading at a true position, counts."""
        return read_encoder(place)

    def draw(self, count: int) -> list[float] | None:
        """Return the noise of the next readings, at least one, counts; None without noise."""
        return None


class NoisyScale(Scale):
    """A scale whose every reading has independent Gaussian noise before it is rounded."""

    noisy = True

    def __init__(self, rms_counts: float, seed: int) -> None:
        super().__init__()
        self._rms_counts = rms_counts
        self._generator = np.random.default_rng(seed)
        self._drawn: list[float] = []

    def read(self, place: float) -> int:
        """Return the reading at a true position, counts."""
        if not self._drawn:
            self._drawn = self._generator.normal(0.0, self._rms_counts, DRAWN_AT_ONCE).tolist()
        self.before, self.now, self.drawn = self.now, self._drawn.pop(), None
        return round(place + self.now)

    def draw(self, count: int) -> list[float] | None:
        """Return the noise of the next readings, as so many calls of `read` would draw it."""
        drawn = self._drawn
        if len(drawn) > count:
            noise = drawn[: -count - 1 : -1]
            del drawn[-count:]
            self.before = noise[-2] if count > 1 else self.now
            self.now, self.drawn = noise[-1], noise
            return noise
        noise = []
        for _ in range(count):
            self.read(0.0)
            noise.append(self.now)
        self.drawn = noise
        return noise


class IdealAxis(EncoderAxis):
    """An axis that is at its commanded position; disabled, it coasts with a time constant.

    It has no mass: jammed, or at an end of its travel, it stands, and once freed, it is at once at its commanded
    position.
    """

    def __init__(self, cycle_s: float, coast_s: float, origin: float = 0.0, ends: Ends | None = None) -> None:
        super().__init__(origin)
        self._ends = ends
        self._unseen = 0.0  # its distance from a lost reading when its loop was closed on that
        self._step = 0.0
        self._keep = math.exp(-cycle_s / coast_s)
        self._full_step = OPEN_LOOP_COUNTS_PER_S * cycle_s
        self._told: Sequence[float] | None = None
        self._done: list[float] = []
        self._rest: list[float] = []

    def close_loop(self) -> float:
        """Hold the present position, independent of the reading."""
        self._step = 0.0
        if not self.encoder_lost:
            self._unseen = 0.0
            return self._x
        self._unseen = self._x - self._reading
        return self._reading

    def rebase(self, counts: float) -> None:
        """Shift the motor's zero by `counts`."""
        if self._blind and not self.encoder_lost:
            self._unseen = 0.0
        self._told = None
        super().rebase(counts)

    def follow(self, commands: Sequence[float]) -> list[float]:
        """Follow the commands; without an encoder, with the offset present when the loop was closed."""
        if self.jammed:
            return self._stand(len(commands))
        if commands is self._told and not self._unseen:
            # As in the last block, which is returned again: its motor sees at once that nothing has moved.
            positions = self._done
        else:
            positions = [command + self._unseen for command in commands] if self._unseen else list(commands)
        if positions:
            before = positions[-2] if len(positions) > 1 else self._x
            self._x, self._step = positions[-1], positions[-1] - before
        done = self._limit_positions(positions)
        self._told, self._done = (commands, done) if done is positions and not self._unseen else (None, done)
        return done

    def push(self, output: float, cycles: int) -> list[float]:
        """Approach the speed of an open-loop output."""
        if self.jammed:
            return self._stand(cycles)
        positions = []
        gained = (1.0 - self._keep) * self._full_step * output
        if not gained and self._x + self._keep * self._step == self._x:
            return self._limit_positions(self._fade(cycles))
        for _ in range(cycles):
            self._step = self._keep * self._step + gained
            self._x += self._step
            positions.append(self._x)
        return self._limit_positions(positions)

    def coast(self, cycles: int) -> list[float]:
        """Coast."""
        return self.push(0.0, cycles)

    def _fade(self, cycles: int) -> list[float]:
        """Stand, as the speed is too little to move anything and only fades: the same list in each block."""
        keep, step = self._keep, self._step
        for _ in range(cycles if step else 0):
            step = keep * step + 0.0
        self._step = step
        if len(self._rest) != cycles or self._rest[0] != self._x:
            self._rest = [self._x] * cycles
        return self._rest

    def _limit_positions(self, positions: list[float]) -> list[float]:
        ends, self.at_end = self._ends, False
        if ends is not None and positions and ends.holds(self._x + self.origin) != self._x + self.origin:
            positions = [ends.holds(position + self.origin) - self.origin for position in positions]
            self._x, self._step = positions[-1], 0.0
            self.at_end = self.hit_end = True
        self._blind = self.encoder_lost
        if not self._blind:
            self._reading = self._x
        return positions

    def _stand(self, cycles: int) -> list[float]:
        self._step = 0.0
        return [self._x] * cycles


@dataclass(frozen=True, slots=True, kw_only=True)
class Ends:
    """Machine positions in counts: the limits of the axis, which stops there."""

    lowest: float
    highest: float

    def leave(self, lowest: float, highest: float, last: float, origin: float) -> bool:
        """Whether they do not touch an axis between two positions, and at a last one, all from its `origin`."""
        if not self.lowest <= last + origin <= self.highest:
            return False
        return self.lowest <= lowest + origin and highest + origin <= self.highest

    def holds(self, place: float) -> float:
        """Return the position of the axis when something would move it to `place`."""
        return min(max(place, self.lowest), self.highest)


def ends_at(ends_mm: tuple[float, float] | None, counts_per_mm: float) -> Ends | None:
    """Return the ends of an axis in its counts."""
    return ends_mm and Ends(lowest=ends_mm[0] * counts_per_mm, highest=ends_mm[1] * counts_per_mm)
