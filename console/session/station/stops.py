"""Handling of every stop: shown, followed until the controller proves rest, and recorded."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

from console.session.station.actions import stopped_by
from console.session.station.context import StationContext
from console.session.station.jogging import behind_face_mm, tool_in_part
from console.session.station.progress import RUNNING, CutStage
from console.session.station.state import MOVING, Activity, StopState
from console.session.station.watches import watch_axes
from drivers.errors import DriverError, RefusedError
from drivers.lathe.console_role import ConsoleRole
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.standstill import STILL_COUNTS
from drivers.link.base import GONE
from profiles.problem import Problem, ProblemError

RESTED_S = 1.0  # for how long nothing may have moved before a stop that asks for no reset
NEEDS_NO_RESET = frozenset({"space", "escape", "f12"})
"""Stop keys: pressed at rest, they are no reason for a reset. F9 has disabled the drives, and asks for one."""


def leaves_tool_in_part(context: StationContext) -> bool:
    """Whether a cut leaves the tool in the part of a real machine, or where nobody knows, as it is left."""
    state, snapshot = context.state, context.state.snapshot
    if context.shop is not None or context.record is None or state.cut is None or not state.controls:
        return False
    return snapshot is None or tool_in_part(snapshot, context.machine, state.alignment) is not False


class MachineStops:
    """Stops of one machine. `gone` is whether the connection is lost: nothing answers until it is opened anew.

    `commanded` is whether the last thing that the station did before a stop was a command, and no poll. While
    `leaving`, the record waits: the machine comes to rest first, and files are written after it (`write_later`).
    """

    def __init__(self, context: StationContext, forget_speed: Callable[[], None]) -> None:
        """Take `forget_speed`: the polls of a spindle coming to rest give no valid speed."""
        self._context, self._forget_speed = context, forget_speed
        self.gone, self.commanded = False, True
        self.leaving = False
        self._later: list[tuple[str, dict[str, object]]] = []
        self._moved_s = float("-inf")
        self._last: Snapshot | None = None  # poll since the stop
        self._still_s: float | None = None
        self._noted: tuple[bool, bool] | None = None  # of the last stop in the record: rest proven, drives off

    def settle(self, *, lost: bool = False) -> None:
        """Wait after a stop until the controller proves rest, and report how the machine was left."""
        context, stop = self._context, self._context.lathe.stop
        before = context.state.stop
        if before is not None and before.rest_s is not None and stop.proven:
            self._poll_stopped()
            return
        under_way = before is not None and before.rest_s is None
        idle = self._idle() if before is None else None
        current = replace(
            before or self._begun_stop(),
            reason=stop.reason or "",
            killed=stop.killed,
            sent_s=before.sent_s if before is not None and under_way else context.clock.now_s(),
            delivered=stop.delivered,
            taken_s=before.taken_s if before is not None and under_way else None,
            rest_s=None,
            still_s=None,
            tool_in_part=None,
            can_retract=False,
        )
        context.tell(stop=current, armed=None, activity=Activity.LOST if lost else Activity.STOPPING)
        try:
            snapshot = self._wait_for_rest(at_rest=idle is not None)
        except ProblemError as unproven:
            # A lost link stays lost; a silent one is asked again.
            self.gone = any(problem.code in GONE for problem in unproven.problems)
            known = {alarm.problem.code for alarm in context.state.alarms}
            for problem in unproven.problems:
                if problem.code not in known:
                    context.alarm(problem)
            self._keep(current, proven=False)
            current = replace(current, killed=stop.killed, delivered=stop.delivered)
            context.tell(stop=current, activity=Activity.LOST)
        else:
            self._report_rest(current, snapshot)
            drives = snapshot.loops_open, snapshot.open_loops
            if idle is not None and drives == (idle.loops_open, idle.open_loops):  # none was enabled or disabled
                self._let_go(snapshot)

    def _wait_for_rest(self, *, at_rest: bool) -> Snapshot:
        """Wait for rest; where nothing moved, also until a held stop key is let go: it is one stop, not many."""
        stop = self._context.lathe.stop
        while True:
            count, snapshot = stop.count, self._context.lathe.wait_for_rest()
            if not at_rest or stop.count == count or stop.leave_by_s < math.inf:
                return snapshot

    def _idle(self) -> Snapshot | None:
        """Return the last poll where a stop key was pressed and nothing has moved for a while; else None.

        Between two steps of a jog it is a stop like any other.
        """
        state = self._context.state
        if self._context.clock.now_s() - self._moved_s < RESTED_S:
            return None
        pressed = self._context.lathe.stop.reason in NEEDS_NO_RESET and not self.commanded
        at_rest = state.snapshot is not None and state.snapshot.at_rest and not state.snapshot.lost
        return state.snapshot if pressed and at_rest else None

    def _let_go(self, snapshot: Snapshot) -> None:
        """End a stop that has found nothing to stop: what was armed is over, and no reset is asked for."""
        context = self._context
        try:
            context.lathe.stop.release(drives_known=True)
        except RefusedError:  # another stop came meanwhile
            return
        context.limits_seen = snapshot.limits
        told = (Problem(code="session.stopped_at_rest"),)
        context.tell(stop=None, activity=Activity.READY, refusals=told)

    def _begun_stop(self) -> StopState:
        """Return the state of a stop that has just come; what it ended stays with it until F2.

        A tool that comes to rest in a turning part cuts a groove there, deeper than its path in places.
        """
        context, state = self._context, self._context.state
        if state.standing is ConsoleRole.OBSERVER:
            with suppress(ProblemError):  # the owner of the machine then knows who ended its cut
                context.lathe.say_stopped()
        cut = state.cut if state.activity is Activity.CUTTING else None
        in_part = cut is not None and cut.stage is CutStage.CUT and not cut.in_air
        mark_mm = self._behind_face_mm() if in_part else None
        if cut is not None and in_part and mark_mm is None:
            mark_mm = cut.z_mm  # as it was before a reset took the positions
        self._noted = None
        context.tell(stops=state.stops + 1, marks_mm=(*state.marks_mm, *(() if mark_mm is None else (mark_mm,))))
        of_cut = cut is not None and cut.stage in RUNNING
        return StopState(reason="", killed=False, sent_s=0.0, of_cut=of_cut, mark_mm=mark_mm)

    def _behind_face_mm(self) -> float | None:
        """Return the place of the tool in the clamped part at the last poll; None if it is unknown."""
        context, clamping = self._context, self._context.state.alignment.clamping
        snapshot = context.state.snapshot
        if snapshot is None or clamping is None or not snapshot.homed:
            return None
        return behind_face_mm(snapshot, context.loaded_machine.machine, clamping.overhang_mm)

    def forget_mark(self) -> None:
        """Take back the mark of the present stop: the tool has left the part by its path, and stood nowhere in it.

        Where it is in the part, nothing is taken back.
        """
        context, stop = self._context, self._context.state.stop
        snapshot, alignment = context.state.snapshot, context.state.alignment
        if stop is None or stop.mark_mm is None or snapshot is None:
            return
        if tool_in_part(snapshot, context.loaded_machine.machine, alignment) is False:
            context.tell(stop=replace(stop, mark_mm=None), marks_mm=context.state.marks_mm[:-1])

    def _report_rest(self, current: StopState, snapshot: Snapshot) -> None:
        context = self._context
        mark_mm = current.mark_mm
        if mark_mm is not None and (found_mm := self._behind_face_mm()) is not None:
            mark_mm = found_mm
            context.tell(marks_mm=(*context.state.marks_mm[:-1], mark_mm))
        self._forget_speed()
        rest = replace(
            context.state.stop or current,
            mark_mm=mark_mm,
            killed=context.lathe.stop.killed,
            delivered=True,
            rest_s=context.clock.now_s(),
            still_s=self._still_s,
            tool_in_part=tool_in_part(snapshot, context.loaded_machine.machine, context.state.alignment),
            can_retract=snapshot.loops_closed,
        )
        self._keep(rest, proven=True)
        watch_axes(context, snapshot)
        context.tell(stop=rest, spindle_rpm=None, activity=Activity.STOPPED, refusals=())

    def _poll_stopped(self) -> None:
        context = self._context
        try:
            snapshot = context.lathe.snapshot()
        except DriverError as error:
            self.gone = any(problem.code in GONE for problem in error.problems)
            for problem in error.problems:
                context.alarm_once(problem)
            context.tell(activity=Activity.LOST)
        else:
            watch_axes(context, snapshot)
            self._let_loose(snapshot)
            context.tell(activity=Activity.STOPPED)

    def _let_loose(self, snapshot: Snapshot) -> None:
        """Take back that the drives hold the tool, once they no longer do, as after a reset."""
        context, stop = self._context, self._context.state.stop
        if stop is not None and stop.can_retract and not snapshot.loops_closed:
            in_part = tool_in_part(snapshot, context.loaded_machine.machine, context.state.alignment)
            context.tell(stop=replace(stop, can_retract=False, tool_in_part=in_part))

    def _keep(self, stop: StopState, *, proven: bool) -> None:
        """Record a stop once, and later its outcome: rest proven, drives off."""
        context, before, killed = self._context, self._noted, self._context.lathe.stop.killed
        self._noted = (proven, killed)
        if before is None:
            cut = context.state.cut if stop.of_cut else None
            self._note(
                "stopped",
                reason=stop.reason,
                by=stopped_by(stop.reason),
                turn=None if cut is None else cut.turn,
                proven=proven,
                killed=killed,
                taken_after_s=_time_after_stop_s(stop, stop.taken_s if proven else None),
                **(_times(stop) if proven else {}),
            )
        elif killed and not before[1]:
            self._note("killed", proven=proven)
        elif proven and not before[0]:
            self._note("at_rest", **_times(stop))

    def _note(self, kind: str, **data: object) -> None:
        self._later.append((kind, data))
        if not self.leaving:
            self.write_later()

    def write_later(self) -> None:
        """Write into the record what has waited."""
        while self._later:
            kind, data = self._later.pop(0)
            self._context.note_anyway(kind, **data)

    def watch(self, snapshot: Snapshot) -> None:
        """Note when something moves, and when the controller first obeys a stop, by a poll requested after it."""
        if snapshot.moving or self._context.state.activity in MOVING - {Activity.STOPPING}:
            self._moved_s = self._context.clock.now_s()
        context, stop = self._context, self._context.state.stop
        if stop is None or snapshot.asked_s < stop.sent_s:
            return
        self._see_still(snapshot, stop)
        if context.state.activity is Activity.LOST and stop.rest_s is None and not self.gone:
            context.tell(activity=Activity.STOPPING)  # it answers: what is left is the proof of rest
        if stop.taken_s is not None:
            return
        if snapshot.obeys_stop(killed=context.lathe.stop.killed):
            context.tell(stop=replace(stop, taken_s=snapshot.at_s))

    def _see_still(self, snapshot: Snapshot, stop: StopState) -> None:
        """Note the first poll since the stop from which on no axis has moved."""
        before = self._last if self._last is not None and self._last.asked_s >= stop.sent_s else None
        self._last = snapshot
        if before is None or not (before.at_rest and snapshot.still(before, STILL_COUNTS)):
            self._still_s = None
        elif self._still_s is None:
            self._still_s = before.at_s


def _time_after_stop_s(stop: StopState, at_s: float | None) -> float | None:
    return None if at_s is None else at_s - stop.sent_s


def _times(stop: StopState) -> dict[str, object]:
    """Return for the record how long after a stop nothing moved any more, and when that was proven."""
    return {
        "still_after_s": _time_after_stop_s(stop, stop.still_s),
        "proven_after_s": _time_after_stop_s(stop, stop.rest_s),
    }
