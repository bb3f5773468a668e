"""Machine thread from inside: handle one command or one poll at a time, and settle every stop.

It is independent of any screen. Its driver calls `step` again and again; the result is `state`, replaced and
never changed. A command while another is carried out is refused, not queued. A stop does not pass through here:
it goes straight to the link, and the station finds it latched.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

from console.session.cut.alignment import observe_poll
from console.session.cut.trip_cause import BY_FRICTION, with_cause
from console.session.data.records import LEFT_IN_PART
from console.session.errors import SessionError, fault_problem
from console.session.station import commands, watches
from console.session.station.adjustment import adjust_refusal, hold_refusal
from console.session.station.alarms import OF_A_CUT, Priority, acknowledge_shown_alarms
from console.session.station.context import StationContext
from console.session.station.handlers import HANDLERS, begin_as
from console.session.station.link.holding import HolderWatch, LeftRuns
from console.session.station.link.reconnecting import SILENT_CODES, Reconnection
from console.session.station.progress import SpindleWatch
from console.session.station.state import IDLE, MOVING, Activity, StationState
from console.session.station.stops import MachineStops, leaves_tool_in_part
from console.session.station.training import Instruct, carry_out
from drivers.clock import boot_s
from drivers.errors import ControllerError, DriverError, LinkError, RefusedError
from drivers.lathe.guards import unasked_motion
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StoppedError
from drivers.link.base import GONE
from drivers.requests.side_line import RequestConditions, SideLine
from profiles.problem import Problem, ProblemError

SCREEN_TIMEOUT_S = 2.0  # timeout of a silent screen while something moves
OBSERVERS_COMMANDS = (commands.Verify, commands.Recover, commands.TakeControl, commands.ReadLoop)
"""Commands open to a console that only observes; a stop needs no permission."""


def _end_cut(context: StationContext, _: commands.EndCut) -> Problem | None:
    cutting = context.state.activity is Activity.CUTTING
    context.end_asked = context.end_asked or cutting
    return None if cutting else Problem(code="session.nothing_to_hold")


def _hold(context: StationContext, command: commands.HoldFeed | commands.ResumeFeed) -> Problem | None:
    problem = hold_refusal(command, context.state)
    context.hold_asked = command if problem is None else context.hold_asked
    return problem


def _adjust(context: StationContext, command: commands.Adjust) -> Problem | None:
    problem = adjust_refusal(command, context.state)
    if problem is None:
        context.adjust_asked.append(command)
    return problem


def _inject(context: StationContext, command: commands.InjectFault) -> Problem | None:
    if context.shop is None:
        return Problem(code="session.not_simulated")
    context.faults_asked.append(command.line)
    return None


_AT_ONCE: dict[type[commands.Command], Callable[[StationContext, Any], Problem | None]] = {
    commands.Acknowledge: lambda context, command: context.change_alarms(
        partial(acknowledge_shown_alarms, shown=command.shown)
    ),
    commands.EndCut: _end_cut,
    commands.HoldFeed: _hold,
    commands.ResumeFeed: _hold,
    commands.Adjust: _adjust,
    commands.InjectFault: _inject,
    commands.NoteJog: lambda context, command: context.tell(jog_enabled=command.enabled),
    Instruct: lambda context, command: context.orders.append(command.carry_out),
}
"""Commands that do not wait their turn: taken from any thread, whatever the machine is doing."""


def _taken_at_once(context: StationContext, command: commands.Command) -> tuple[Problem, ...] | None:
    """Take what does not wait its turn: return why not, empty if it was taken; None for all else."""
    take = next((take for kind, take in _AT_ONCE.items() if isinstance(command, kind)), None)
    if take is not None:
        if command.logged:
            context.log_command(command)
        problem = take(context, command)
    elif context.state.speed != 0.0:
        return None
    elif isinstance(command, commands.Recover) and context.training is not None:
        context.training.clock.ask_on()  # its instructor may be gone
        problem = None
    else:
        problem = Problem(code="instruct.paused")
    return () if problem is None else (problem,)


class Station:
    """One machine under one operator."""

    def __init__(self, context: StationContext) -> None:
        self._context = context
        self._command: commands.Command | None = None
        self._posted_s = 0.0
        self._beat_s: float | None = None
        self._slot = threading.Lock()
        self._link_time = watches.LinkTime()
        self._spindle = SpindleWatch(context.loaded_machine.machine.spindle.counts_per_rev)
        self._stops, self._sight = MachineStops(context, self._spindle.forget), watches.ChuckSight(context)
        self._holder, self._left = HolderWatch(context), LeftRuns(context)
        self._reconnecting = Reconnection(context, self._stops)
        self._pause = watches.PollPause(context)
        context.pause_problem = self._pause.problem

    @property
    def state(self) -> StationState:
        """The newest state."""
        return self._context.state

    def take_poll(self, snapshot: Snapshot) -> None:
        """Take a status poll, from whatever wait it was made in: the lathe calls this."""
        context, before = self._context, self._context.state
        alignment = observe_poll(
            before.alignment,
            drives_on=snapshot.loops_closed,
            homed=snapshot.homed,
            at=context.local_time(),
            chuck_open=not snapshot.inputs.get("chuck_closed", True),
        )
        context.tell(
            snapshot=snapshot,
            spindle_rpm=self._spindle.see(snapshot),
            alignment=alignment,
            at_s=context.clock.now_s(),
            round_trip_ms=self._link_time.see(context.clock.now_s(), context.lathe.round_trip_s),
        )
        context.tell_standing()
        watches.watch_poll(context, before, snapshot)
        watches.watch_armed(context, snapshot)
        self._stops.watch(snapshot)
        if context.seen is not None:
            context.seen(snapshot)
            watches.watch_phase(context)
        else:
            context.end_alarms(*OF_A_CUT)
        if not self._stops.leaving:  # whoever leaves looks at the chuck no more, and an answer may take its time
            watches.give_faults(context)
            carry_out(context)
            self._sight.sample()
        context.check_record()
        silent = self._beat_s is not None and context.screen_s() - self._beat_s > SCREEN_TIMEOUT_S
        if silent and context.state.activity in MOVING and context.lathe.stop.reason is None:
            context.lathe.stop.stop("screen")
            context.alarm(Problem(code="session.screen_silent", limit=f"{SCREEN_TIMEOUT_S:g} s"))
        if context.side is not None:
            context.side.serve(self._moment(snapshot))

    @property
    def side(self) -> SideLine | None:
        """Where worker threads ask the controller, between two polls."""
        return self._context.side

    @property
    def run_id(self) -> str | None:
        """The record of the current run, None if there is none."""
        record = self._context.record
        return None if record is None else record.run_id

    @property
    def parts(self) -> int:
        """The number of parts that were cut to their end."""
        return self._context.parts

    def _moment(self, snapshot: Snapshot) -> RequestConditions:
        """Return what requests beside the polls are judged by; with a command waiting, as in motion."""
        state, stopped = self._context.state, self._context.lathe.stop.reason is not None
        return RequestConditions(
            at_rest=snapshot.at_rest and state.activity in IDLE and self._command is None,
            controls=state.controls,
            homing=state.activity is Activity.HOMING,
            stopping=stopped and (state.stop is None or state.stop.rest_s is None),
            lost=state.activity is Activity.LOST,
        )

    def connect(self) -> bool:
        """Set up the link and compare the controller with its profile; False when no PMAC answers yet."""
        context = self._context
        if not self._reconnecting.reopen_connection():
            return False
        try:
            version, kind = context.lathe.connect()
        except ProblemError as error:
            # Whatever is at the other end received no motion command, and may not understand a stop.
            for problem in error.problems:
                context.alarm_once(problem)
            context.tell(activity=Activity.LOST)
            self._reconnecting.give_up_connection(error.problems[0])
            return False
        context.end_alarms(*GONE, *SILENT_CODES)
        context.tell(controller=f"{kind} {version}", firmware=(version, kind), lost_link=None)
        try:
            context.owning.claim()
        except ProblemError as error:  # only observe
            for problem in error.problems:
                context.alarm(problem, Priority.MEDIUM)
        context.tell_standing()
        self._left.ask()
        self._carry_out(commands.Verify())
        begins = context.begins
        if begins is not None:
            context.tell(activity=Activity.SWITCHING)
            self._guard_operation(lambda: begin_as(context, begins))
        return True

    def post(self, intent: commands.Command) -> bool:
        """Take a command, from any thread; False if it is refused because the machine is busy."""
        context = self._context
        refused = _taken_at_once(context, intent)
        if refused is not None:
            return self._refuse(refused[0]) if refused else True
        with self._slot:
            if context.state.activity is Activity.LOST:
                return self._refuse(Problem(code="session.lost"))
            if not context.state.controls and not isinstance(intent, OBSERVERS_COMMANDS):
                holder = context.state.holder
                free = Problem(code="owner.free")
                return self._refuse(Problem(code="owner.observer", value=str(holder)) if holder else free)
            if context.state.activity not in IDLE or self._command is not None:
                return self._refuse(Problem(code="session.busy"))
            if context.state.stop is not None and not isinstance(intent, commands.Recover):
                return self._refuse(Problem(code="session.stopped"))
            if context.side is not None and context.side.reading and not isinstance(intent, commands.Recover):
                return self._refuse(Problem(code="beside.reading"))
            self._command, self._posted_s = intent, boot_s()
            return True

    def _refuse(self, problem: Problem) -> bool:
        self._context.tell(refusals=(problem,))
        return False

    def beat(self) -> None:
        """Note that the screen is alive."""
        self._beat_s = self._context.screen_s()

    def step(self) -> None:
        """Settle a stop, or carry out a command, or poll. Never raises."""
        with self._slot:
            command, self._command = self._command, None
        try:
            self._step(command)
        except Exception as fault:
            # An internal fault; the thread continues, because nothing else could stop the machine.
            if self.state.controls:
                self._context.lathe.stop.stop("fault")
            self._context.alarm(fault_problem(fault))

    def _step(self, command: commands.Command | None) -> None:
        context = self._context
        watches.give_faults(context)
        carry_out(context)
        if self._stops.gone:
            if context.side is not None:  # nobody polls any more, and somebody may wait for an answer
                context.side.serve(RequestConditions(at_rest=False, controls=False, lost=True))
            self._reconnecting.step()
            return
        if context.lathe.stop.reason is not None and not isinstance(command, commands.Recover):
            self._stops.settle()
            self._reconnecting.note_rest()
            self._pause.end()
        else:
            self._stops.commanded, freezes = command is not None, context.lathe.stop.freezes
            if command is not None and (old := watches.age_problem(command, self._posted_s)) is not None:
                command = None
                self._refuse(old)
            if command is not None:
                if freezes is not None:
                    freezes.forget()
                self._carry_out(command)
                self._pause.end(froze_s=0.0 if freezes is None else freezes.froze_s)
            else:
                self._guard_operation(self._poll)
        armed = context.state.armed
        if armed is not None and context.clock.now_s() > armed.until_s:
            context.tell(armed=None, refusals=(Problem(code="session.arm_expired"),))

    def close(self, reason: str) -> None:
        """Leave the machine at rest with its drives off, as far as possible; then write. Never raises."""
        self._stops.leaving = True
        context, lathe, snapshot = self._context, self._context.lathe, self.state.snapshot
        # A drive may be on: enabled by us, or on when control was taken.
        if self.state.controls and (lathe.has_moved or snapshot is None or not snapshot.loops_open):
            if self.state.may_move or lathe.stop.reason is not None:
                lathe.stop.stop(reason)
                self._stops.settle()
            lathe.stop.kill(reason)
            if not lathe.stop.given_up:
                self._stops.settle()
                with suppress(ProblemError):
                    lathe.program.put_back()
        if not lathe.stop.given_up:  # a machine left in doubt stays ours: the next console must check it
            context.owning.release()
        self._stops.write_later()
        marked = leaves_tool_in_part(context)
        if marked:
            context.note_anyway(LEFT_IN_PART)
        context.end_record(marked=marked)

    def _carry_out(self, command: commands.Command) -> None:
        activity, work = HANDLERS[type(command)]
        context = self._context
        context.end_asked, context.hold_asked = False, None
        context.adjust_asked.clear()
        if not isinstance(command, commands.Arm):  # that one begins a record of its own
            context.log_command(command)
        if not isinstance(command, commands.Start):
            context.tell(armed=None)  # what was read in the summary may have changed
        shown = activity if context.state.stop is None else context.state.activity
        context.tell(refusals=(), ends_s=None, ends_at_most=False, activity=shown)

        def worked() -> None:
            work(context, command)
            self._sight.sample_now()
            if isinstance(command, commands.TakeControl):
                self._left.ask()

        self._guard_operation(worked)

    def _poll(self) -> None:
        context = self._context
        snapshot = context.lathe.snapshot()
        self._pause.see()
        watches.watch_loss(context, snapshot)
        on = not snapshot.loops_open
        if self.state.controls and context.lathe.stop.inside_guard and on:
            # It was not us: somebody else, or a PLC of the controller. The stop is a control-K then.
            raise DriverError(Problem(code="machine.energised"))
        context.limits_seen &= snapshot.limits  # a limit that was left and is reached again is reported again
        faults = tuple(fault for fault in snapshot.axis_faults if fault not in context.limits_seen)
        if faults and not on and context.state.armed is not None:
            context.tell(armed=None)
        if faults and on and self.state.controls:
            context.lathe.stop.stop(faults[0])
            raise DriverError(Problem(code="machine.fault", key="poll", value=", ".join(faults)))
        unasked = unasked_motion(snapshot)
        if unasked is not None and self.state.controls and not snapshot.lost:
            raise DriverError(unasked)  # hands may be at a machine that is shown at rest
        context.end_alarms("link.silent")
        watches.watch_axes(context, snapshot)
        self._holder.look()
        if self.state.controls and snapshot.at_rest and self.state.armed is None:
            self._left.look()

    def _guard_operation(self, work: Callable[[], None]) -> None:
        """Run an operation on the machine; on any error, report it and stop the machine."""
        context = self._context
        try:
            work()
        except StoppedError:
            self._stops.settle()
        except (SessionError, ControllerError, RefusedError) as refused:
            # Before any motion a refusal leaves the machine alone; during a motion it stops it.
            snapshot, activity = context.state.snapshot, context.state.activity
            at_rest = snapshot is not None and snapshot.at_rest
            if activity is Activity.CUTTING or (activity in MOVING and not at_rest):
                self._report_failure(refused)
            else:
                context.log_refusal(refused.problems)
                context.tell(refusals=tuple(refused.problems), activity=Activity.READY)
        except ProblemError as error:
            self._report_failure(error)
        except Exception as fault:
            # A fault of the console itself must stop the machine too.
            self._report_failure(SessionError(fault_problem(fault)))
        else:
            after = Activity.READY if context.lathe.stop.reason is None else Activity.STOPPING
            if context.state.activity is not after:  # most often a poll of a machine that is ready
                context.tell(activity=after)

    def _report_failure(self, error: ProblemError) -> None:
        context, lost = self._context, isinstance(error, LinkError)
        if context.lathe.anothers:  # another console controls the machine: nothing is sent to it
            for problem in error.problems:
                context.alarm_once(problem)
            self._stops.gone = any(problem.code in GONE for problem in error.problems)
            context.tell(activity=Activity.LOST if lost else Activity.READY, armed=None)
            return
        if lost:
            context.lathe.in_doubt()
        context.lathe.stop.stop(error.problems[0].code)
        now = [problem for problem in error.problems if problem.code != BY_FRICTION]
        for problem in now:
            context.alarm(problem)
        self._stops.settle(lost=lost)
        explained = with_cause(context.lathe, error.problems) if context.lathe.stop.proven else error.problems
        for problem in explained:
            if problem not in now:
                context.alarm(problem)
