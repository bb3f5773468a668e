"""The moment before an event, at which a practice begins: the last one at rest. Pure.

Something that moves cannot be taken over. Where the event came in a motion, the practice begins before it, and the
trainee starts that motion.
"""

from __future__ import annotations

from dataclasses import dataclass

from console.session.flight.recorded_forms import Moment, RecordedWork
from console.session.flight.recording import Recording
from console.session.practice.recorded_event import RecordedEvent
from console.session.station.state import MOVING, Activity
from profiles.problem import refused

BEFORE_S = 10.0  # of a practice that does not say how long before its event it is to begin
JUST_S = 2.0  # so long before an event its motion may have ended; a link that is lost is noticed within it
IN_PART = "cut"  # of `CutStage`
OF_A_CUT = frozenset({Activity.ARMING, Activity.POSITIONING, Activity.CUTTING})


@dataclass(frozen=True, slots=True, kw_only=True)
class Before:
    """Where a practice begins, and when its event comes.

    `moment` is the recorded one at `at_s`; where a cut is older than the recording it is one of the cut, and the
    axes are to be at the start of its program (`at_start`). `during` is the motion in which the event came, None
    at rest. `work` is the job that was cut, or the open one. In a cut `turn` is that of the event and `after_s`
    the time since the tool was in the part, or since it was armed where the tool never was (`turn` None); else it
    is the time from the beginning.
    """

    at_s: float
    moment: Moment
    during: Activity | None
    work: RecordedWork | None
    turn: float | None
    after_s: float
    at_start: bool = False

    @property
    def of_cut(self) -> bool:
        """Whether the event came in a cut, or on the way to it."""
        return self.during in OF_A_CUT


def before(recording: Recording, event: RecordedEvent, before_s: float | None) -> Before:
    """Return the moment at rest, `before_s` or more before an event, and before the motion in which it came.

    Raises:
        ProfileError: `practice.not_so_long`, the recording does not go back so far; `practice.never_at_rest`.
    """
    past_s = event.at_s - recording.times_s[0]
    if before_s is not None and before_s > past_s:
        raise refused("practice.not_so_long", key="--before", value=f"{before_s:g} s", limit=f"{past_s:.0f} s")
    last = _in_motion(recording, event.at_s)
    newest = recording.place_at(event.at_s - (BEFORE_S if before_s is None else before_s))
    newest = newest if last is None else min(newest, last)
    during = None if last is None else recording.moments[last].state.activity
    resting = [each for each in range(newest + 1) if _rests(recording.moments[each], armed=during in OF_A_CUT)]
    if not resting and last is not None and during in OF_A_CUT and recording.moments[last].state.armed is not None:
        return _from_its_plan(recording, event, last)
    if not resting:
        raise refused("practice.never_at_rest")
    place = resting[-1]
    turn, after_s = _when(recording, event.at_s, place, last, during)
    return Before(
        at_s=recording.times_s[place],
        moment=recording.moments[place],
        during=during,
        work=_work(recording, place, last),
        turn=turn,
        after_s=after_s,
    )


def _in_motion(recording: Recording, event_s: float) -> int | None:
    """Return the last moment in which the station moved the machine, just before an event; None at rest."""
    for place in reversed(range(recording.place_at(event_s) + 1)):
        if recording.moments[place].state.activity in MOVING - {Activity.STOPPING}:
            return place
        if recording.times_s[place] < event_s - JUST_S:
            return None
    return None


def _rests(moment: Moment, *, armed: bool) -> bool:
    """Whether the machine is at rest and ready, with no stop; where a cut is to be `armed`, not armed yet."""
    state = moment.state
    if state.activity is not Activity.READY or state.stop is not None or state.snapshot is None:
        return False
    return state.snapshot.at_rest and not (armed and state.armed)


def _from_its_plan(recording: Recording, event: RecordedEvent, last: int) -> Before:
    """Return the beginning of a cut that is older than its recording: the start of its program."""
    moment = recording.moments[last]
    armed, cut = moment.state.armed, moment.state.cut
    assert armed is not None
    inside = cut is not None and cut.stage == IN_PART
    feed_mm_per_s = armed.job.feed_mm_per_rev * armed.job.spindle_speed_rpm / 60.0
    return Before(
        at_s=recording.times_s[0],
        moment=moment,
        during=Activity.CUTTING,
        work=moment.work,
        turn=cut.turn if inside and cut is not None else None,
        after_s=max(cut.z_mm, 0.0) / feed_mm_per_s if inside and cut is not None else 0.0,
        at_start=True,
    )


def _work(recording: Recording, place: int, last: int | None) -> RecordedWork | None:
    """Return the job as it was when its cut was armed, else the one that was open at the beginning."""
    since = recording.moments[place : place + 1 if last is None else last + 1]
    armed = [moment for moment in since if moment.state.armed is not None]
    return (armed or [recording.moments[place]])[0].work


def _when(
    recording: Recording, event_s: float, begins: int, last: int | None, during: Activity | None
) -> tuple[float | None, float]:
    """Return the turn of an event in a cut, and how long after it is to come."""
    if last is None or during not in OF_A_CUT:
        return None, event_s - recording.times_s[begins]
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
