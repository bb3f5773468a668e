"""Detect when a program loops for ever, and how long to watch the loop before ending it.

Two signs: a WHILE that nothing inside it can end (`Loop.endless`), and a program that returns to a place with
exactly the same values in its variables as before.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from drivers.pmac.analysis.loops import Loop, around
from drivers.pmac.analysis.step import Step, same_motion
from drivers.pmac.language.syntax import VariableKind

MOST_PASSES = 400
"""Maximum passes of an endless loop whose motion never repeats."""

STEADY_PASSES = 3
STEADY_TURNS = 3.0
"""How long the repeated motion of an endless loop is watched: passes, and turns of the spindle."""

Written = Mapping[tuple[VariableKind, int, int], float]
"""The values that a program has set: by kind, number and coordinate system."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Turning:
    """The motor that turns the part, by its place in every vector, and its counts per turn."""

    index: int
    counts: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Circle:
    """An endless loop of a program: the WHILE (None: without one), and whether its motion repeats.

    The last `period` steps, where they repeat, are one round; there were `passes` of them.
    """

    loop: Loop | None
    period: int | None
    passes: int


class EndlessWatch:
    """Checks every step of a walk for endless loops."""

    def __init__(self, loops: Sequence[Loop], turning: Turning | None) -> None:
        """Take the loops of the program that is started."""
        self._endless = tuple(loop for loop in loops if loop.endless)
        self._loops = tuple(loops)
        self._turning = turning
        self._recurrence = _Recurrence()
        self._rounds: dict[tuple[Loop | None, tuple[int, ...]], _Rounds] = {}

    def forget(self) -> None:
        """Start again: a flag has been set from outside."""
        self._rounds.clear()
        self._recurrence = _Recurrence()

    def look(self, steps: Sequence[Step], written: Written) -> Circle | None:
        """Return the endless loop that the program is in, once it has been watched for long enough."""
        newest = steps[-1]
        loop = next(around(self._loops, newest.main_line), None)
        if loop is not None and any(around(self._endless, newest.main_line)):
            # A line of an inner loop, which ends by itself, recurs within one pass.
            return self._pass(steps, loop) if loop.endless else None
        return self._pass(steps, loop) if self._recurrence.has_come_again(newest.place, written) else None

    def _pass(self, steps: Sequence[Step], loop: Loop | None) -> Circle | None:
        # Which of the places in a loop recurs shows in time: each is counted by itself.
        rounds = self._rounds.setdefault((loop, steps[-1].place), _Rounds())
        rounds.starts.append(len(steps) - 1)
        passes = len(rounds.starts) - 1
        if not passes:
            return None
        rounds.steady = rounds.steady + 1 if _repeats(steps, rounds.starts) else 0
        if rounds.steady >= STEADY_PASSES and self._turned(steps, rounds):
            return Circle(loop=loop, period=rounds.starts[-1] - rounds.starts[-2], passes=passes)
        return Circle(loop=loop, period=None, passes=passes) if passes >= MOST_PASSES else None

    def _turned(self, steps: Sequence[Step], rounds: _Rounds) -> bool:
        """Return whether the spindle stands, or has made its turns since the motion repeats."""
        if self._turning is None:
            return True
        index = self._turning.index
        now, before = steps[-1].at[index], steps[rounds.starts[-2]].at[index]
        since = steps[rounds.starts[-1 - rounds.steady]].at[index]
        return now == before or abs(now - since) >= STEADY_TURNS * self._turning.counts


@dataclass(slots=True)
class _Rounds:
    """The steps at which a place was reached, and how many of the last rounds repeat the one before them."""

    starts: list[int] = field(default_factory=list)
    steady: int = 0


def _repeats(steps: Sequence[Step], starts: Sequence[int]) -> bool:
    if len(starts) < 3:
        return False
    first, second, third = starts[-3:]
    return same_motion(steps[second + 1 : third + 1], steps[first + 1 : second + 1])


@dataclass(slots=True)
class _Recurrence:
    """Detects a recurring program state, by Brent's method: one state is kept, at distances that double."""

    place: tuple[int, ...] = ()
    written: dict[tuple[VariableKind, int, int], float] = field(default_factory=dict)
    since: int = 0
    power: int = 1

    def has_come_again(self, place: tuple[int, ...], written: Written) -> bool:
        self.since += 1
        if place == self.place and written == self.written:
            self.since = 0
            return True
        if self.since >= self.power:
            self.place, self.written = place, dict(written)
            self.power, self.since = 2 * self.power, 0
        return False
