"""Steps of one jog key that were asked for: how many are made, and how many still wait.

The queue is in the screen, so that nothing moves any more when the screen is gone: the machine only ever knows one
finite step. The next one is commanded when the machine has proven the one before to be in position
(`StationState.jogs`), and never again once it was refused, stopped or lost.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from console.session.station.state import StationState
from profiles.problem import Problem

MOST_WAITING = 10
"""Steps that may wait. More could come only of a terminal that repeats a held key slowly."""

SERIES_S = 2.0  # presses further apart than this are counted anew
HELD_UP_S = 1.0  # a screen that was not drawn for so long had something else to do: nothing continues after it


@dataclass(frozen=True, slots=True)
class _Posted:
    """State of the machine when a step was posted."""

    jogs: int
    refusals: tuple[Problem, ...]


class StepQueue:
    """Steps of one key. `asked` and `made` count those of the present series. Times are machine time."""

    def __init__(self) -> None:
        self.key: str | None = None
        self.asked = self.made = 0
        self._posted: _Posted | None = None
        self._asked_s = self._followed_s = -math.inf

    @property
    def left(self) -> int:
        """Steps that were asked for and are not made, with the one under way."""
        return self.asked - self.made

    @property
    def waiting(self) -> int:
        """Steps that were not commanded yet."""
        return self.left - (self._posted is not None)

    @property
    def is_due(self) -> bool:
        """Whether the next step is to be commanded, as soon as the machine is at rest."""
        return self._posted is None and self.left > 0

    def add(self, key: str, now_s: float) -> bool:
        """Ask for one more step; return False where too many wait already."""
        if self.waiting >= MOST_WAITING:
            return False
        if key != self.key or (not self.left and now_s - self._asked_s > SERIES_S):
            self.asked = self.made = 0
        if not self.left:
            self._followed_s = now_s
        self.key, self._asked_s = key, now_s
        self.asked += 1
        return True

    def posted(self, state: StationState) -> None:
        """Note that the next step was commanded in this state."""
        self._posted = _Posted(state.jogs, state.refusals)

    def follow(self, state: StationState, now_s: float) -> bool:
        """Note what became of the step under way; return False where those that wait were dropped.

        They are dropped with a step that the machine has refused, and after a screen that was held up.
        """
        held_up, self._followed_s = now_s - self._followed_s > HELD_UP_S, now_s
        step = self._posted
        if step is not None and state.jogs != step.jogs:
            self.made, self._posted = self.made + 1, None
        elif step is not None and not state.moving and state.refusals and state.refusals is not step.refusals:
            self.forget()
            return False
        if held_up and self.waiting:
            self.drop()
            return False
        return True

    def drop(self) -> int:
        """Drop the steps that wait, and return their number; the one under way goes to its end."""
        dropped = self.waiting
        if self._posted is None:
            self.forget()
        else:
            self.asked -= dropped
        return dropped

    def forget(self) -> None:
        """Drop every step and the count: the machine was stopped, or something else is asked of it."""
        self.asked = self.made = 0
        self.key, self._posted = None, None
