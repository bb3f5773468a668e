"""The moment before an event, at which a practice begins: the last one at rest. Pure.

Something that moves cannot be taken over. Where the event came in a motion, the practice begins before it, and the
trainee starts that motion. The event is the one for which the recording was frozen, with the simulated fault that
is like it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from console.flight.recorded_forms import RecordedMoment, RecordedWork
from console.flight.recording import Recording
from console.session.cut.alignment import Alignment
from console.session.station.alarms import FAULT
from console.session.station.state import MOVING, Activity
from drivers.lathe.snapshot import AxisName
from profiles.problem import Problem, refusal_error

BEFORE_S = 10.0  # of a practice that does not say how long before its event it is to begin
JUST_S = 2.0  # so long before an event its motion may have ended; a link that is lost is noticed within it
IN_PART = "cut"  # of `CutStage`
SET_UP: Mapping[str, Callable[[Alignment], bool]] = MappingProxyType(
    {
        "clamped": lambda alignment: alignment.clamping is not None,
        "drives_on": lambda alignment: alignment.drives_on,
        "homed": lambda alignment: alignment.homed,
        "jaw_found": lambda alignment: alignment.jaw is not None,
        "touched_off": lambda alignment: alignment.touch_off is not None,
    }
)
"""Steps of the set-up, by the names of lessons, in their order; whether each is made."""

OF_A_CUT = frozenset({Activity.ARMING, Activity.POSITIONING, Activity.CUTTING})
SILENT = ("link.silent", "link.out_of_step", "link.not_in_step")
LOST, TIMEOUT, LAPSED = "link.lost", "machine.timeout", "heartbeat.lapsed"
OUT_OF_PHASE = ("cut.out_of_phase", "cut.tool_leads")

OVER_S = 20
"""How long a fault lasts that ends by itself: a trainee has no other way to mend the lathe."""

_AXIS_FAULTS = {
    "fatal_following_error": "following-error-trip motor={axis}",
    "amplifier_fault": f"amplifier-fault motor={{axis}} for={OVER_S}",
    "positive_limit": f"limit motor={{axis}} direction=positive for={OVER_S}",
    "negative_limit": f"limit motor={{axis}} direction=negative for={OVER_S}",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PracticeStart:
    """Where a practice begins, and when its event comes.

    `moment` is the recorded one at `at_s`; where a cut is older than the recording it is one of the cut, and the
    axes are to be at the start of its program (`at_start`). `during` is the motion in which the event came, None
    at rest. `work` is the job that was cut, or the open one. In a cut `turn` is that of the event and `after_s`
    the time since the tool was in the part, or since it was armed where the tool never was (`turn` None); else it
    is the time from the beginning, or since the last of the steps that are `missing` there: those of the set-up
    that were made before the event. `drives_then` is whether the drives were enabled when it came.
    """

    at_s: float
    moment: RecordedMoment
    during: Activity | None
    work: RecordedWork | None
    turn: float | None
    after_s: float
    at_start: bool = False
    missing: tuple[str, ...] = ()
    drives_then: bool = False

    @property
    def of_cut(self) -> bool:
        """Whether the event came in a cut, or on the way to it."""
        return self.during in OF_A_CUT


@dataclass(frozen=True, slots=True, kw_only=True)
class SuspectedFault:
    """A fault as `console fault` takes it; `doubt` names why the cause may have been another, else ""."""

    fault: str
    doubt: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedEvent:
    """One event at machine time: its reason, the problem of its alarm, and the fault that is like it."""

    at_s: float
    reason: str
    problem: Problem | None = None
    like: SuspectedFault | None = None

    @property
    def fault(self) -> str:
        """The name of the fault, "" without one."""
        return "" if self.like is None else self.like.fault.split()[0]


def event_of(recording: Recording) -> RecordedEvent:
    """Return the event to practise: the first that a fault is surely like, else may be like, else the first."""
    found = list(_events(recording))
    sure = [each for each in found if each.like is not None and not each.like.doubt]
    alike = [each for each in found if each.like is not None]
    return (sure or alike or found)[0]


def _events(recording: Recording) -> Iterator[RecordedEvent]:
    header = recording.header
    if not header.causes:
        yield RecordedEvent(at_s=header.ended_s, reason="")
    for cause in header.causes:
        alarms = recording.moments[recording.place_at(cause.at_s)].state.alarms
        problem = next((each.problem for each in alarms if each.problem.code == cause.reason), None)
        like = None if problem is None else likeness(problem)
        yield RecordedEvent(at_s=cause.at_s, reason=cause.reason, problem=problem, like=like)


def likeness(problem: Problem) -> SuspectedFault | None:
    """Return the fault that raises an alarm like this one, None where the catalogue has none."""
    if problem.code == FAULT:
        return _of_axis(problem.value)
    if problem.code == LOST:
        return SuspectedFault(fault=f"cut-cable for={OVER_S}")
    if problem.code in SILENT:
        return SuspectedFault(fault="hang for=3", doubt="practice.doubt_silent")
    if problem.code == LAPSED:
        return SuspectedFault(fault="hang for=0.5", doubt="practice.doubt_silent")
    if problem.code in OUT_OF_PHASE:
        return SuspectedFault(fault="following-error-trip motor=tool", doubt="practice.doubt_phase")
    what, _, axis = problem.key.partition(" ")
    if problem.code == TIMEOUT and what == "home" and axis in tuple(AxisName):
        return SuspectedFault(fault=f"index-lost motor={axis} for=75", doubt="practice.doubt_index")
    return None


def _of_axis(faults: str) -> SuspectedFault | None:
    """Return what is like the first of some faults of axes (`tool: amplifier_fault, ...`)."""
    for each in faults.split(", "):
        axis, _, flag = each.partition(": ")
        if flag in _AXIS_FAULTS and axis in tuple(AxisName):
            return SuspectedFault(fault=_AXIS_FAULTS[flag].format(axis=axis))
    return None


def find_practice_start(recording: Recording, event: RecordedEvent, before_s: float | None) -> PracticeStart:
    """Return the moment at rest, `before_s` or more before an event, and before the motion in which it came.

    Raises:
        ProfileError: `practice.not_so_long`, the recording does not go back so far; `practice.never_at_rest`.
    """
    last = _in_motion(recording, event.at_s)
    during = None if last is None else recording.moments[last].state.activity
    newest = recording.place_at(event.at_s) if last is None else last
    resting = [each for each in range(newest + 1) if _rests(recording.moments[each], armed=during in OF_A_CUT)]
    if not resting and last is not None and during in OF_A_CUT and recording.moments[last].state.armed is not None:
        return _from_its_plan(recording, event, last)
    if not resting:
        raise refusal_error("practice.never_at_rest")
    then = recording.moments[resting[-1] if last is None else last].state.alignment
    place = _find_resting_moment(recording, event, resting, before_s, then)
    missing = missing_steps(recording.moments[place].state.alignment, then)
    turn, after_s = _locate_event(recording, event.at_s, (place, last), during, missing)
    return PracticeStart(
        at_s=recording.times_s[place],
        moment=recording.moments[place],
        during=during,
        work=_work(recording, place, last),
        turn=turn,
        after_s=after_s,
        missing=missing,
        drives_then=then.drives_on,
    )


def _find_resting_moment(
    recording: Recording, event: RecordedEvent, resting: list[int], before_s: float | None, then: Alignment
) -> int:
    """Return the last resting moment so long before an event; unasked, none before the set-up, else the first."""
    wanted_s = event.at_s - (BEFORE_S if before_s is None else before_s)
    if before_s is None:
        ready = [place for place in resting if not missing_steps(recording.moments[place].state.alignment, then)]
        resting = ready or resting
    found = [place for place in resting if recording.times_s[place] <= wanted_s]
    if not found and before_s is not None:
        limit = f"{event.at_s - recording.times_s[resting[0]]:.1f} s"
        raise refusal_error("practice.not_so_long", key="--before", value=f"{before_s:g} s", limit=limit)
    return found[-1] if found else resting[0]


def missing_steps(now: Alignment, then: Alignment) -> tuple[str, ...]:
    """Return the steps of the set-up, by the names of lessons, that had been made then and not yet now."""
    return tuple(step for step, known in SET_UP.items() if known(then) and not known(now))


def _in_motion(recording: Recording, event_s: float) -> int | None:
    """Return the last moment in which the station moved the machine, just before an event; None at rest."""
    for place in reversed(range(recording.place_at(event_s) + 1)):
        if recording.moments[place].state.activity in MOVING - {Activity.STOPPING}:
            return place
        if recording.times_s[place] < event_s - JUST_S:
            return None
    return None


def _rests(moment: RecordedMoment, *, armed: bool) -> bool:
    """Whether the machine is at rest and ready, with no stop; where a cut is to be `armed`, not armed yet."""
    state = moment.state
    if state.activity is not Activity.READY or state.stop is not None or state.snapshot is None:
        return False
    return state.snapshot.at_rest and not (armed and state.armed)


def _from_its_plan(recording: Recording, event: RecordedEvent, last: int) -> PracticeStart:
    """Return the beginning of a cut that is older than its recording: the start of its program."""
    moment = recording.moments[last]
    armed, cut = moment.state.armed, moment.state.cut
    assert armed is not None
    inside = cut is not None and cut.stage == IN_PART
    feed_mm_per_s = armed.job.feed_mm_per_rev * armed.job.spindle_speed_rpm / 60.0
    return PracticeStart(
        at_s=recording.times_s[0],
        moment=moment,
        during=Activity.CUTTING,
        work=moment.work,
        turn=cut.turn if inside and cut is not None else None,
        after_s=max(cut.z_mm, 0.0) / feed_mm_per_s if inside and cut is not None else 0.0,
        drives_then=True,
        at_start=True,
    )


def _work(recording: Recording, place: int, last: int | None) -> RecordedWork | None:
    """Return the job as it was when its cut was armed, else the one that was open at the beginning."""
    since = recording.moments[place : place + 1 if last is None else last + 1]
    armed = [moment for moment in since if moment.state.armed is not None]
    return (armed or [recording.moments[place]])[0].work


def _locate_event(
    recording: Recording,
    event_s: float,
    between: tuple[int, int | None],
    during: Activity | None,
    missing: tuple[str, ...],
) -> tuple[float | None, float]:
    """Return the turn of an event in a cut, and how long after it is to come."""
    begins, last = between
    if last is None or during not in OF_A_CUT:
        made = (
            place
            for place in range(begins, len(recording.moments))
            if all(SET_UP[step](recording.moments[place].state.alignment) for step in missing)
        )
        return None, max(event_s - recording.times_s[next(made, begins)], 0.0)
    found = [(place, recording.moments[place].state) for place in range(begins, last + 1)]
    inside = [
        (place, state.cut)
        for place, state in found
        if state.activity is Activity.CUTTING and state.cut is not None and state.cut.stage == IN_PART
    ]
    armed = [(place, state.armed) for place, state in found if state.armed is not None]
    if not inside or not armed:
        return None, event_s - recording.times_s[armed[0][0] if armed else begins]
    (_, begun), (place, ended) = inside[0], inside[-1]
    rpm = armed[-1][1].job.spindle_speed_rpm
    # By turns: a hold or an override has cost time in which nothing was cut. What followed is added as it was.
    later_s = min(event_s - recording.times_s[place], JUST_S)
    return ended.turn, (ended.turn - begun.turn) * 60.0 / rpm + later_s
