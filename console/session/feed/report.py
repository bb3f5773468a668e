"""One moment of a console as the plain values of a line of its feed; docs/feed.md describes each. Pure.

Only what is named here is published. So the truth of a simulated lathe (`state.seen`, `state.truth`) is not.
"""

from __future__ import annotations

import json
import math
from typing import Any

from console.session.feed.feed_state import (
    LONGEST_TEXT,
    FeedAlarm,
    FeedAxes,
    FeedCut,
    FeedOwner,
    FeedState,
    FeedStep,
)
from console.session.feed.observed_state import RUN, ObservedState, ShownCut
from console.session.feed.request import SCHEMA
from console.session.station.alarms import Alarm
from console.session.station.jogging import counts_per_unit, tool_radius_mm
from console.session.station.state import Activity, StationState
from drivers.lathe.snapshot import AxisName
from profiles.files import printable

AUTOMATIC = frozenset({Activity.ARMING, Activity.CUTTING})
UNAVAILABLE = frozenset({Activity.CONNECTING, Activity.LOST})
TURN_DEG = 360.0
IN_PART = "cut"  # the stage of a cut in which the tool follows its path


def line_of(values: dict[str, Any]) -> bytes:
    """Return a line of the feed: ASCII, whatever is in it."""
    return json.dumps(values, allow_nan=False, separators=(",", ":")).encode("ascii") + b"\n"


def report(observed: ObservedState, *, process: int, operator: str, at_utc: str) -> FeedState:
    """Return the state at a moment; `operator` is whoever works this console."""
    state, cut = observed.state, observed.shown_cut
    age_s = state.age_s(observed.now_s)
    return FeedState(
        schema=SCHEMA,
        at_utc=at_utc,
        process=process,
        program=observed.program,
        simulated=state.simulated,
        machine=state.machine,
        job=observed.job,
        activity=str(state.activity),
        execution=execution(state),
        mode="automatic" if state.armed is not None or state.activity in AUTOMATIC else "manual",
        controls=state.controls,
        controlled_by=_controlled_by(state, operator),
        age_s=_number(age_s, 3),
        stale=state.is_stale(observed.now_s),
        spindle_rpm=_number(state.spindle_rpm, 3),
        axes=_axes(observed),
        cut=_feed_cut(cut),
        tool_error_um=_number(cut.tool_error_um, 3) if cut is not None and cut.stage == IN_PART else None,
        parts=observed.parts,
        run_id=observed.run_id,
        alarms=tuple(_alarm(alarm, observed) for alarm in state.alarms),
        cut_verdict=observed.judgement,
        next=_next(observed),
    )


def execution(state: StationState) -> str:
    """Return what the machine does, in the words of MTConnect."""
    if state.activity in UNAVAILABLE:
        return "unavailable"
    if state.paused:
        return "feed_hold"
    if state.stop is not None:
        return "stopped"
    return "active" if state.seen_moving else "ready"


def _controlled_by(state: StationState, operator: str) -> FeedOwner | None:
    """Return who controls the machine; None where nobody does, as far as known."""
    if state.controls:
        return FeedOwner(number=state.holder or None, name=operator, host=None)
    if not state.holder:
        return None
    by = state.held_by
    name, host = (None, None) if by is None else (by.name or None, by.host or None)
    return FeedOwner(number=state.holder, name=name, host=host)


def _axes(observed: ObservedState) -> FeedAxes:
    """Return the position of each axis, None before it is homed: the counts mean nothing then."""
    snapshot, machine = observed.state.snapshot, observed.machine
    places: dict[str, float | None] = dict.fromkeys(AxisName)
    if snapshot is not None:
        for axis in AxisName:
            state = snapshot.axis(axis)
            if "home_complete" not in state.flags:
                continue
            if axis is AxisName.TOOL:
                places[axis] = tool_radius_mm(state.position, machine, observed.state.alignment)
            else:
                places[axis] = state.position / counts_per_unit(machine, axis)
    spindle = places[AxisName.SPINDLE]
    return FeedAxes(
        tool_radius_mm=_number(places[AxisName.TOOL], 5),
        carriage_mm=_number(places[AxisName.CARRIAGE], 5),
        spindle_deg=None if spindle is None else _number(spindle % TURN_DEG, 3),
    )


def _feed_cut(cut: ShownCut | None) -> FeedCut | None:
    if cut is None:
        return None
    left_s, turns = _number(cut.left_s, 1), _number(cut.turns, 2)
    return FeedCut(stage=cut.stage, turn=_number(cut.turn, 2), turns=turns, left_s=left_s)


def _alarm(alarm: Alarm, observed: ObservedState) -> FeedAlarm:
    problem = alarm.problem
    return FeedAlarm(
        number=observed.numbers.get((problem.code, problem.key)),
        code=problem.code,
        priority=alarm.priority.name.lower(),
        state=_alarm_state(alarm),
        text=printable(str(problem), LONGEST_TEXT),
    )


def _alarm_state(alarm: Alarm) -> str:
    if not alarm.active:
        return "returned"
    return "acknowledged" if alarm.acknowledged else "new"


def _next(observed: ObservedState) -> FeedStep | None:
    """Return the next step at the screens; `console run` asks nobody for one."""
    if observed.program == RUN:
        return None
    from console.session.guide.refusals import why_not  # not before somebody reads: it takes its time
    from console.session.guide.rows import next_step
    from console.session.guide.situation import Situation

    state, work = observed.state, observed.work
    now = Situation(state=state, work=work, machine=observed.machine, now_s=observed.now_s)
    row, job = next_step(now), now.job
    until_s = state.loading_until_s if state.armed is None else state.armed.until_s
    return FeedStep(
        word=row.word,
        key=row.key,
        left_s=None if until_s is None else _number(max(until_s - observed.now_s, 0.0), 1),
        force_n=None if job is None else job.chucking_force_n,
        radius_mm=None if job is None else job.radius_mm,
        why=why_not(row, now),
    )


def _number(value: float | None, digits: int) -> float | None:
    """Return a number as JSON can have it."""
    return None if value is None or not math.isfinite(value) else round(value, digits)
