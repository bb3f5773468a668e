"""One try of a lesson: what was reached and what happened when, as the states of the station come. Pure."""

from __future__ import annotations

from dataclasses import dataclass, replace

from console.school.instructing.mailbox import InstructorAct
from console.school.instructing.order import OrderKind
from console.school.training.event import CONSOLE
from console.school.training.happenings import Happening, HappeningKind, PartFact, happenings, part_fact
from console.school.training.lesson import MILESTONES, STEP, Lesson, StateChange
from console.session.stages import Stage
from console.session.station.state import StationState

INJECT = "inject "


@dataclass(frozen=True, slots=True, kw_only=True)
class TraineeFindings:
    """What the trainee found, as far as it is known: jaw 1 and the tool tip as in `Alignment`, and the lobe.

    `lobe_um_pp` and `jaws` are those of the job that was armed last.
    """

    jaw_1_deg: float | None = None
    zero_radius_mm: float | None = None
    lobe_um_pp: float | None = None
    jaws: int = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Attempt:
    """How far a try has come. Times are s since it began.

    `reached` has the time of each milestone that was reached, by its name. The steps of a lesson are reached in
    their order: what happens before its step is due does not count. `seed` is that of its lathe, `trainee` a name
    or "". `given` are the events that have come, by their numbers. `part` is the last one that was measured.
    `answer` is the one that was chosen, from 0. `continued` is the number of steps with which a try went on that
    had been left. `checkpoints` is how many steps were made at each of the instructor's: those made since are made
    again after a return. `ended_s` is when the trainee ended it: nothing counts any more.
    """

    lesson: Lesson
    began_s: float
    seed: int | None = None
    trainee: str = ""
    reached: tuple[tuple[str, float], ...] = ()
    happened: tuple[Happening, ...] = ()
    given: frozenset[int] = frozenset()
    found: TraineeFindings = TraineeFindings()
    part: PartFact | None = None
    answer: int | None = None
    continued: int = 0
    checkpoints: tuple[tuple[str, int], ...] = ()
    ended_s: float | None = None
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

    @property
    def asks(self) -> bool:
        """Whether the question of the lesson is not answered yet."""
        return STEP in self.lesson.steps and self.answer is None and self.ended_s is None

    @property
    def asks_now(self) -> bool:
        """Whether it is due."""
        return self.asks and not self.done and self.lesson.steps[self.step] == STEP

    @property
    def stops(self) -> int:
        """How many stops there were."""
        return sum(each.what is HappeningKind.STOP for each in self.happened)

    @property
    def faults(self) -> int:
        """How many faults were given to the lathe, by the lesson or by an instructor."""
        given = [each.word for each in self.happened if each.what is HappeningKind.FAULT]
        return sum(not word.startswith(CONSOLE) for word in given)

    @property
    def collision_kinds(self) -> tuple[str, ...]:
        """Kinds of collision, in the order in which they first came."""
        return tuple(dict.fromkeys(each.word for each in self.happened if each.what is HappeningKind.MET))

    def took_s(self, now_s: float) -> float:
        """Return how long it took: to the last step, or else to its end, or to now."""
        if self.done:
            return self.reached[-1][1]
        return self.ended_s if self.ended_s is not None else now_s - self.began_s

    def left_s(self, now_s: float) -> float:
        """Return how much of the time is left, below 0 once it is over; that of a lesson which is done stands."""
        return self.lesson.minutes * 60.0 - self.took_s(now_s)

    def see_state(self, state: StationState, now_s: float) -> Attempt:
        """Return the try after one more state of the station."""
        before, at_s = self.last, now_s - self.began_s
        if before is None or before is state or self.ended_s is not None:
            return replace(self, last=state)
        stage = Stage(state.armed.made.stage) if state.armed is not None else self.stage
        change = StateChange(before=before, now=state, stage=stage, answered=self.answer is not None)
        fresh = happenings(before, state, at_s)
        reached = self.reached
        while len(reached) < len(self.lesson.steps):
            name = self.lesson.steps[len(reached)]
            if not MILESTONES[name](change):
                break
            reached = (*reached, (name, at_s))
        steps = [Happening(at_s=at_s, what=HappeningKind.STEP, word=name) for name, _ in reached[self.step :]]
        measured = state.measured if any(each.what is HappeningKind.PART for each in fresh) else None
        return replace(
            self,
            last=state,
            stage=stage,
            reached=reached,
            happened=(*self.happened, *fresh, *steps),
            found=_update_findings(self.found, state),
            part=self.part if measured is None else part_fact(measured),
        )

    def due_events(self, now_s: float) -> tuple[int, ...]:
        """Return the numbers of the events that have to come now."""
        at_s, reached = now_s - self.began_s, {"": 0.0, **dict(self.reached)}
        if self.ended_s is not None:
            return ()
        return tuple(
            number
            for number, event in enumerate(self.lesson.events)
            if number not in self.given and event.after in reached and at_s >= reached[event.after] + event.wait_s
        )

    def gave(self, number: int, now_s: float) -> Attempt:
        """Return the try after an event has come."""
        word = self.lesson.events[number].word
        fault = Happening(at_s=now_s - self.began_s, what=HappeningKind.FAULT, word=word)
        return replace(self, given=self.given | {number}, happened=(*self.happened, fault))

    def answer_question(self, number: int) -> Attempt:
        """Return the try with the question answered: once, when it is due."""
        return replace(self, answer=number) if self.asks_now else self

    def record_instruction(self, act: InstructorAct) -> Attempt:
        """Return the try after the instructor has done something: a fault counts as those of the lesson do."""
        if self.ended_s is not None:
            return self
        what, word = HappeningKind.INSTRUCTOR, act.order.line
        if word.startswith(INJECT):
            what, word = HappeningKind.FAULT, word.removeprefix(INJECT)
        fresh = Happening(at_s=act.at_s - self.began_s, what=what, word=word)
        name, steps, reached = act.order.name, dict(self.checkpoints), self.reached
        if act.order.do is OrderKind.CHECKPOINT:
            steps[name] = self.step
        elif act.order.do is OrderKind.RETURN:
            reached = reached[: steps.get(name, self.step)]
        marks = tuple(steps.items())
        return replace(self, happened=(*self.happened, fresh), reached=reached, checkpoints=marks)

    def end_attempt(self, now_s: float) -> Attempt:
        """Return the try after the trainee has ended it."""
        return self if self.ended_s is not None else replace(self, ended_s=now_s - self.began_s)


def _update_findings(found: TraineeFindings, state: StationState) -> TraineeFindings:
    """Return what is known now; what was lost since stays what was found last."""
    jaw, touch_off, armed = state.alignment.jaw, state.alignment.touch_off, state.armed
    if jaw is not None and jaw.angle_deg != found.jaw_1_deg:
        found = replace(found, jaw_1_deg=jaw.angle_deg)
    if touch_off is not None and touch_off.zero_radius_mm != found.zero_radius_mm:
        found = replace(found, zero_radius_mm=touch_off.zero_radius_mm)
    if armed is not None and armed.job.lobe_error_um_pp != found.lobe_um_pp:
        found = replace(found, lobe_um_pp=armed.job.lobe_error_um_pp, jaws=armed.job.jaws)
    return found
