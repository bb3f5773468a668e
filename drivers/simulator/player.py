"""Playing pieces of motion at servo instants."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable

from drivers.pmac.trajectory.pieces import Piece, Vector

Refill = Callable[[], Iterable[Piece]]


class Player:
    """A queue of pieces with a clock of its own, sampled one servo cycle after another.

    `refill` is asked for more when a piece begins that is marked `calculates`, and when the queue is empty;
    an empty answer means rest. Time that is left over between two pieces is carried into the next one.
    """

    def __init__(self, position: Vector, refill: Refill | None = None) -> None:
        self.position = position
        self._refill = refill
        self._queue: deque[Piece] = deque()
        self._elapsed_ms = 0.0
        self._entered = False

    @property
    def idle(self) -> bool:
        """Whether nothing is left to play."""
        return not self._queue

    def append(self, pieces: Iterable[Piece]) -> None:
        """Add pieces to the end."""
        self._queue.extend(pieces)

    def sample(self, count: int, cycle_ms: float) -> list[list[float]]:
        """Return `count` positions for each motor, one servo cycle apart, the first one cycle from now."""
        track: list[list[float]] = [[] for _ in self.position]
        left = count
        while left and self._enter():
            piece = self._queue[0]
            room = (piece.duration_ms - self._elapsed_ms) / cycle_ms
            steps = left if room >= left else int(room)
            if steps:
                start = self._elapsed_ms
                times = [start + cycle_ms * k for k in range(1, steps + 1)]
                for positions, (c0, c1, c2, c3) in zip(track, piece.cubics, strict=True):
                    positions.extend([((c3 * t + c2) * t + c1) * t + c0 for t in times])
                self._elapsed_ms = times[-1]
                left -= steps
            if left:
                self._finish(piece)
        if left:
            self._elapsed_ms = 0.0
            for positions, last in zip(track, self.position, strict=True):
                positions.extend([last] * left)
        elif count:
            self.position = tuple(positions[-1] for positions in track)
        return track

    def _enter(self) -> bool:
        """Make sure that a piece is there to be played, and calculate ahead where it says so."""
        if not self._queue:
            if self._refill is None:
                return False
            self._queue.extend(self._refill())
            if not self._queue:
                return False
        if not self._entered:
            self._entered = True
            if self._queue[0].calculates and self._refill is not None:
                self._queue.extend(self._refill())
        return True

    def _finish(self, piece: Piece) -> None:
        """Leave a piece at its exact end, so that rest is exactly where the move was to end."""
        self._queue.popleft()
        self._elapsed_ms -= piece.duration_ms
        self._entered = False
        end = piece.duration_ms
        self.position = tuple(((c3 * end + c2) * end + c1) * end + c0 for c0, c1, c2, c3 in piece.cubics)
