"""One try of a lesson: what was reached when, as the states of the station come. Pure."""

from __future__ import annotations

from dataclasses import dataclass, replace

from console.session.stages import Stage
from console.session.station.state import StationState
from console.session.training.lesson import Lesson
from console.session.training.milestones import MILESTONES, Change


@dataclass(frozen=True, slots=True, kw_only=True)
class Attempt:
    """How far a try has come. Times are s since it began.

    `reached` has the time of each milestone that was reached, by its name. The steps of a lesson are reached in
    their order: what happens before its step is due does not count. `stops` counts the stops, `met` has the
    kinds of collision.
    """

    lesson: Lesson
    began_s: float
    reached: tuple[tuple[str, float], ...] = ()
    stops: int = 0
    met: tuple[str, ...] = ()
    last: StationState | None = None
    stage: Stage | None = None

    @property
    def step(self) -> int:
        """The number of the step that is due, from 0; that of the steps once the lesson is done."""
        return len(self.reached)

    @property
    def done(self) -> bool:
        """Whether all steps are made."""
        return self.step == len(self.lesson.steps)

    def left_s(self, now_s: float) -> float:
        """Return how much of the time is left, below 0 once it is over; that of a lesson which is done stands."""
        at_s = self.reached[-1][1] if self.done else now_s - self.began_s
        return self.lesson.minutes * 60.0 - at_s

    def seen(self, state: StationState, now_s: float) -> Attempt:
        """Return the try after one more state of the station."""
        before = self.last
        if before is None or before is state:
            return replace(self, last=state)
        stage = Stage(state.armed.made.stage) if state.armed is not None else self.stage
        change = Change(before=before, now=state, stage=stage)
        reached = self.reached
        while len(reached) < len(self.lesson.steps):
            name = self.lesson.steps[len(reached)]
            if not MILESTONES[name](change):
                break
            reached = (*reached, (name, now_s - self.began_s))
        met = state.seen.collisions if state.seen is not None else ()
        return replace(
            self,
            last=state,
            stage=stage,
            reached=reached,
            stops=self.stops + (state.stop is not None and before.stop is None),
            met=(*self.met, *(kind for kind in met if kind not in self.met)),
        )
