"""Play pieces of motion at servo instants."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from itertools import accumulate, repeat
from typing import Final

from drivers.pmac.requests import DeferredValue
from drivers.pmac.trajectory.pieces import Piece, Vector, position_at

Refill = Callable[[], Iterable[Piece]]
Assign = Callable[[tuple[DeferredValue, ...]], None]
FARTHEST_AHEAD: Final = 1000  # cycles; pieces may be endless
SAME_COUNTS: Final = 1e-6  # two motions no further apart than this are the same


class Player:
    """A queue of pieces with its own clock, sampled one servo cycle after another.

    `refill` is asked for more when a piece begins that is marked `calculates`, and when the queue is empty; an
    empty reply means rest. `assign` gets the deferred assignments of a piece that begins. Time left over between
    two pieces is carried into the next one.
    """

    def __init__(self, position: Vector, refill: Refill | None = None, assign: Assign | None = None) -> None:
        self.position = position
        self._refill = refill
        self._assign = assign
        self._queue: deque[Piece] = deque()
        self._elapsed_ms = 0.0
        self._entered = False
        self._pace = (0, 0.0)  # number and distance, ms, of the `_instants`
        self._instants: list[float] = []

    @property
    def idle(self) -> bool:
        """Whether nothing is left to play."""
        return not self._queue

    @property
    def left_ms(self) -> float:
        """How long the present piece still takes."""
        return max(0.0, self._queue[0].duration_ms - self._elapsed_ms) if self._queue else 0.0

    @property
    def in_real_time(self) -> bool:
        """Whether the present piece runs at the rate of the servo clock, whatever the time base is."""
        return self._entered and bool(self._queue) and self._queue[0].real_time

    def forget_debt(self) -> None:
        """Continue from the start of the present piece, if time was taken back beyond it."""
        self._elapsed_ms = max(self._elapsed_ms, 0.0)

    def append(self, pieces: Iterable[Piece]) -> None:
        """Add pieces to the end."""
        self._queue.extend(pieces)

    def replace(self, old: Sequence[Piece], new: Sequence[Piece]) -> bool:
        """Play `new` in place of `old`, the pieces that were added last.

        When those have begun, both must be the same up to now; if not, nothing is changed, and False is returned.
        """
        ahead = [piece for piece in self._queue if not any(piece is each for each in old)]
        if ahead:
            self._queue = deque((*ahead, *new))
            return True
        place = next((at for at, each in enumerate(old) if self._queue and each is self._queue[0]), len(old))
        elapsed_ms = self._elapsed_ms + sum(piece.duration_ms for piece in old[:place])
        for at, piece in enumerate(new):
            if elapsed_ms < piece.duration_ms:
                there = [position_at(cubic, elapsed_ms) for cubic in piece.cubics]
                if any(abs(a - b) > SAME_COUNTS for a, b in zip(there, self.position, strict=True)):
                    return False
                self._queue, self._elapsed_ms = deque(new[at:]), elapsed_ms
                return True
            elapsed_ms -= piece.duration_ms
        return False

    def sample(self, count: int, cycle_ms: float, rate_ms: float | None = None) -> list[list[float]]:  # noqa: C901 - one branch a case
        """Return `count` positions for each motor, one servo cycle apart, the first one cycle from now.

        `rate_ms` is the trajectory time that passes in a servo cycle; None is `cycle_ms`, real time. Below 0 it
        runs backwards, but no further than the start of the present piece: there the position waits until the time
        has come again.
        """
        rate_ms = cycle_ms if rate_ms is None else rate_ms
        if self._entered and self._queue and self._elapsed_ms >= 0.0:
            # As most blocks: all of it in one piece, so that nothing of what follows has anything to do.
            piece = self._queue[0]
            step_ms = cycle_ms if piece.real_time else rate_ms
            if step_ms > 0.0 and (piece.duration_ms - self._elapsed_ms) / step_ms >= count > 0:
                return self._go_on(piece, count, step_ms)
        track: list[list[float]] = [[] for _ in self.position]
        left = count
        before_ms = 0.0
        while left and self._enter():
            piece = self._queue[0]
            step_ms = cycle_ms if piece.real_time else rate_ms
            if step_ms != before_ms and before_ms:
                # The rest of a servo cycle is worth more or less in a piece that runs at another rate.
                self._elapsed_ms *= step_ms / before_ms
            before_ms = step_ms
            room = (piece.duration_ms - self._elapsed_ms) / step_ms if step_ms > 0.0 else math.inf
            steps = left if room >= left else int(room)
            if steps:
                start = self._elapsed_ms
                times = [start + step_ms * k for k in range(1, steps + 1)]
                self._elapsed_ms = times[-1]
                if start < 0.0 or step_ms < 0.0:
                    times = [max(time, 0.0) for time in times]
                for at, (c0, c1, c2, c3) in enumerate(piece.cubics):
                    track[at] += [((c3 * t + c2) * t + c1) * t + c0 for t in times]
                left -= steps
            if left:
                self._finish(piece)
        if left:
            self._elapsed_ms = 0.0
            for positions, last in zip(track, self.position, strict=True):
                positions.extend([last] * left)
        elif count:
            self.position = tuple([positions[-1] for positions in track])
        return track

    def _go_on(self, piece: Piece, count: int, step_ms: float) -> list[list[float]]:
        """Return positions within the present piece."""
        start = self._elapsed_ms
        if self._pace != (count, step_ms):
            self._pace, self._instants = (count, step_ms), [step_ms * k for k in range(1, count + 1)]
        return self._positions_at(piece, [start + instant for instant in self._instants])

    def whole_cycles(self, cycle_ms: float) -> int:
        """Return for how many servo cycles the present piece certainly goes on in real time, and one more."""
        if not (self._entered and self._queue and self._elapsed_ms >= 0.0):
            return 0
        left = (self._queue[0].duration_ms - self._elapsed_ms) / cycle_ms
        return int(min(left, FARTHEST_AHEAD)) - 1

    def sample_singly(self, count: int, cycle_ms: float) -> list[list[float]]:
        """Return what so many calls for one cycle would, in real time; no more than `whole_cycles`."""
        times = accumulate(repeat(cycle_ms, count), initial=self._elapsed_ms)
        next(times)
        return self._positions_at(self._queue[0], list(times))

    def _positions_at(self, piece: Piece, times: list[float]) -> list[list[float]]:
        """Play up to the last of these times."""
        self._elapsed_ms = times[-1]
        # Terms of the polynomial that are exactly 0 change nothing.
        track = [
            [((c3 * t + c2) * t + c1) * t + c0 for t in times]
            if c2 or c3
            else ([c1 * t + c0 for t in times] if c1 else [c0] * len(times))
            for c0, c1, c2, c3 in piece.cubics
        ]
        self.position = tuple([positions[-1] for positions in track])
        return track

    def _enter(self) -> bool:
        """Make sure that there is a piece to play, and calculate ahead where it is marked."""
        if not self._queue:
            if self._refill is None:
                return False
            self._queue.extend(self._refill())
            if not self._queue:
                return False
        if not self._entered:
            self._entered = True
            piece = self._queue[0]
            if piece.deferred and self._assign is not None:
                self._assign(piece.deferred)
            if piece.calculates and self._refill is not None:
                self._queue.extend(self._refill())
        return True

    def _finish(self, piece: Piece) -> None:
        """Leave a piece; the last one at its exact end, so that rest is exactly at the end of the move."""
        self._queue.popleft()
        self._elapsed_ms -= piece.duration_ms
        self._entered = False
        if not self._queue:
            self.position = tuple([position_at(cubic, piece.duration_ms) for cubic in piece.cubics])
