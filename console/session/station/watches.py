"""Monitors run on every status poll, each with an alarm for as long as its condition holds.

An armed cut is what was read in its summary: it is disarmed at a poll that shows anything else, or comes late.
"""

from __future__ import annotations

import time
from collections import deque

from console.session.cut.alignment import HANDED_OVER, NOT_KEPT, handed_over
from console.session.cut.telemetry import lag_left_um_pp
from console.session.station import commands
from console.session.station.alarms import (
    COLLISION_CODES,
    HOME_LOST,
    NOBODYS,
    OPENED,
    OUSTED,
    Priority,
    collision_problems,
    with_faults,
)
from console.session.station.context import StationContext
from console.session.station.progress import CutStage
from console.session.station.state import IDLE, MOVING, Activity, StationState
from drivers.clock import FROZEN_S, OLD_S, boot_s
from drivers.errors import LinkError
from drivers.lathe.console_role import ConsoleRole
from drivers.lathe.guards import reset_problem, unasked_opening
from drivers.lathe.safety import device_problems
from drivers.lathe.snapshot import REAL_TIME_PERCENT, Snapshot
from drivers.lathe.stop import way_problems
from drivers.pmac.heartbeat.arming import lost_problem
from profiles.problem import Problem, ProblemError

OVERRIDE_BAND_PERCENT = 0.5
AWAKE_S = 0.5  # time after a pause in which what waited through it may still be read
AT_ANY_AGE = (
    commands.Acknowledge,
    commands.DisableDrives,
    commands.Disarm,
    commands.EndCut,
    commands.HoldFeed,
    commands.ReadLoop,
    commands.Recover,
    commands.TakeControl,
    commands.Verify,
)
"""Commands that move nothing, or end a motion."""


def watch_armed(context: StationContext, snapshot: Snapshot) -> None:
    """Disarm once a poll differs from what was armed: alignment, drives, home; somebody moves an axis."""
    armed = context.state.armed
    if armed is None:
        return
    changed = None
    if context.state.alignment != armed.alignment:
        changed = Problem(code="session.arm_realigned")
    elif snapshot.moving:
        changed = Problem(code="session.arm_moved")
    elif abs(snapshot.override_percent - REAL_TIME_PERCENT) > OVERRIDE_BAND_PERCENT:
        changed = Problem(code="session.arm_override")
    if changed is not None:
        context.tell(armed=None, refusals=(changed,))


def age_problem(command: commands.Command, posted_s: float) -> Problem | None:
    """Return why a command of a time of `boot_s` is too old to be carried out, None if it may be."""
    age_s = boot_s() - posted_s
    return None if age_s <= OLD_S or isinstance(command, AT_ANY_AGE) else _frozen_problem(age_s)


class PollPause:
    """Pauses of the polls of an idle machine, or of this process: nothing stays armed through one."""

    def __init__(self, context: StationContext) -> None:
        self._context = context
        self._polled = self._read_clocks()

    def end(self, froze_s: float = 0.0) -> None:
        """Note the end of a command, which polls as it needs; disarm if this process was frozen within it."""
        self._polled = self._read_clocks()
        self._judge(froze_s)

    def see(self) -> None:
        """Note a poll; after a pause disarm."""
        screen, machine, asleep = (now - at for now, at in zip(self._read_clocks(), self._polled, strict=True))
        self._polled = self._read_clocks()
        # The time since the last poll, less that of a paused lathe, plus that of a suspended computer.
        self._judge(min(screen, machine) + asleep)

    def _judge(self, pause_s: float) -> None:
        if pause_s > FROZEN_S and self._context.state.armed is not None:
            self._context.tell(armed=None, refusals=(_frozen_problem(pause_s),))

    def problem(self) -> Problem | None:
        """Return why an order that has no date is not obeyed; None if there was no pause just now."""
        freezes = self._context.lathe.stop.freezes
        pause_s = 0.0 if freezes is None else freezes.woke_from_s(AWAKE_S)
        return _frozen_problem(pause_s) if pause_s else None

    def _read_clocks(self) -> tuple[float, float, float]:
        return self._context.screen_s(), self._context.clock.now_s(), boot_s() - time.monotonic()


def _frozen_problem(pause_s: float) -> Problem:
    return Problem(code="session.frozen", value=f"{pause_s:.1f} s")


HELD_S = 0.3  # for how long a simulated lathe may hold its time between two samples, unmentioned
KEPT_S = 5.0  # window over which the longest response time is reported
SIGHT_PERIOD_S = 0.15  # sampling period of the chuck view
SIGHT_PERIOD_IN_MOTION_S = 1.0
"""The same in motion, when polls and the watchdog come first; collisions must still be reported."""


def watch_poll(context: StationContext, before: StationState, snapshot: Snapshot) -> None:
    """Check what every poll may show, in motion and at rest; `before` is the state of the poll before."""
    _watch_home(context, before, snapshot)
    _watch_loops(context, before, snapshot)
    _watch_devices(context, before.snapshot, snapshot)
    if (
        context.lathe.find_guard_problem is not None
    ):  # something moves, and the controller's watchdog no longer guards it
        context.alarm_once(context.lathe.find_guard_problem)
    _watch_stop_way(context)


def _watch_home(context: StationContext, before: StationState, snapshot: Snapshot) -> None:
    """Raise one alarm where an axis has lost its home since the last poll: a reset, or another host's home search.

    In motion, the wait for the motion stops the machine and raises the alarm; an axis that comes to rest after a
    stop is checked only here.
    """
    if before.snapshot is None or not before.controls:
        return
    homed = before.snapshot.homed_axes
    stopping = before.activity is Activity.STOPPING
    # A stopped home search has lost the home of its own axis, and of no other.
    searched = stopping and len(homed - snapshot.homed_axes) == 1
    if before.activity in MOVING and (not stopping or searched):
        return
    problem = reset_problem(homed, snapshot)
    if problem is not None:
        context.tell(armed=None)
        context.alarm(problem)


def _watch_loops(context: StationContext, before: StationState, snapshot: Snapshot) -> None:
    """Raise an alarm where an axis at rest has lost its drive, until all have the same state again."""
    if snapshot.loops_closed or snapshot.loops_open:
        context.end_alarms(OPENED)
    idle = before.activity in IDLE and context.state.activity in IDLE and context.lathe.stop.reason is None
    if before.snapshot is None or not before.controls or not idle:
        return
    problem = unasked_opening(before.snapshot, snapshot)
    if problem is not None:
        context.tell(armed=None)
        context.alarm(problem)


def _watch_devices(context: StationContext, before: Snapshot | None, snapshot: Snapshot) -> None:
    """Report the safety device that drops while drives are on: automatic motion ends, and no command is sent.

    In motion, the wait for it stops the machine, and reports it.
    """
    problems = device_problems(snapshot.inputs)
    if snapshot.inputs and not problems:
        context.end_alarms("safety.not_good")
    on = not snapshot.loops_open or (before is not None and not before.loops_open)
    if problems and on and context.state.controls and context.state.activity not in MOVING:
        context.tell(armed=None)
        context.alarm_new(problems)


def _watch_stop_way(context: StationContext) -> None:
    """Report once that the stop connection is lost: every stop still works, but no new cut is begun."""
    problems = way_problems(context.lathe.stop.way)
    if not problems:
        context.end_alarms("stops.connection_lost")
        return
    context.tell(armed=None)
    context.alarm_new(problems)


def watch_axes(context: StationContext, snapshot: Snapshot) -> None:
    """Report who controls the machine, and axis faults not reported elsewhere."""
    if context.state.standing is ConsoleRole.OUSTED:  # the alignment made here is no longer known
        why = HANDED_OVER if snapshot.owner else NOT_KEPT
        context.tell(alignment=handed_over(context.state.alignment, context.local_time(), why))
        _tell_ousted(context, snapshot)
    if snapshot.homed:
        context.end_alarms(*HOME_LOST)
    now_s = context.clock.now_s()
    context.change_alarms(lambda alarms: with_faults(alarms, snapshot.axis_faults, now_s))


def _tell_ousted(context: StationContext, snapshot: Snapshot) -> None:
    """Raise one alarm of who controls the machine in place of this console: another one, or nobody any more.

    A controller that was restarted has forgotten its owner and every home, and holds no axis.
    """
    code = OUSTED
    if not snapshot.owner:
        code = NOBODYS[0] if not snapshot.homed_axes and snapshot.loops_open else NOBODYS[1]
        if any(context.has_alarm(each) for each in NOBODYS):
            return
    if not context.has_alarm(code):
        context.end_alarms(OUSTED, *NOBODYS)
        context.tell(armed=None)
        context.alarm(Problem(code=code, value=str(snapshot.owner) if snapshot.owner else ""))


def watch_loss(context: StationContext, snapshot: Snapshot) -> None:
    """Report once what the controller has ended after losing its host; after a stop, settling the stop does."""
    if not snapshot.lost:
        context.end_alarms("heartbeat.lost")
    elif not context.has_alarm("heartbeat.lost"):
        context.alarm(lost_problem(snapshot.lost))


def watch_phase(context: StationContext) -> None:
    """Report once a cut that the tool is too far off its path for the part, or that the spindle stands."""
    cut, plan = context.state.cut, context.plan
    if cut is None or cut.stage is not CutStage.CUT:
        return
    if cut.in_phase is False and cut.lag_deg is not None and plan is not None:
        problem = Problem(
            code="cut.out_of_phase" if cut.lag_deg > 0.0 else "cut.tool_leads",
            key=f"{lag_left_um_pp(plan.target, cut.lag_deg):.1f} um",
            value=f"{abs(cut.lag_deg):.1f} deg",
            limit=f"± {cut.phase_limit_deg:.1f} deg",
        )
        context.alarm_once(problem, Priority.MEDIUM)
    elif cut.is_lost:
        context.alarm_once(Problem(code="cut.spindle_stands"))


class LinkTime:
    """Longest of the recent response times, rounded up so that the figure stays constant in normal operation."""

    def __init__(self) -> None:
        self._answers: deque[tuple[float, float]] = deque()

    def see(self, at_s: float, answer_s: float) -> float:
        """Take the time of a response, s; return the figure to report, ms."""
        answers = self._answers
        while answers and answers[0][0] < at_s - KEPT_S:
            answers.popleft()
        while answers and answers[-1][1] <= answer_s:  # can no longer be the longest
            answers.pop()
        answers.append((at_s, answer_s))
        return rounded_up_ms(1000.0 * answers[0][1])


def rounded_up_ms(answer_ms: float) -> float:
    """Return the next of 1, 2, 5, 10, 20 ... that is not less."""
    decade = 1.0
    while answer_ms > 10.0 * decade:
        decade *= 10.0
    return next(step * decade for step in (1.0, 2.0, 5.0, 10.0) if answer_ms <= step * decade)


def give_faults(context: StationContext) -> None:
    """Give the simulated lathe the requested faults; raise an alarm for a fault it refuses."""
    while context.shop is not None and context.faults_asked:
        line = context.faults_asked.popleft()
        try:
            context.shop.fault(line)
            context.note_anyway("fault", line=line)
        except ProblemError as error:
            context.alarm_once(error.problems[0], Priority.MEDIUM)


class ChuckSight:
    """Periodic samples of the chuck view of a simulated workshop, with an alarm for each collision."""

    def __init__(self, context: StationContext) -> None:
        self._context, self._seen_s = context, float("-inf")
        self._collisions: tuple[str, ...] = ()
        self._held_s, self._moved = 0.0, False

    def sample_now(self) -> None:
        """Sample at once: the view has to show the end of a command, not a moment before it."""
        self._seen_s = float("-inf")
        self.sample()

    def sample(self) -> None:
        """Sample, unless that was done a moment ago."""
        context = self._context
        now_s = context.clock.now_s()
        period_s = SIGHT_PERIOD_IN_MOTION_S if context.state.activity in MOVING else SIGHT_PERIOD_S
        if context.shop is None or now_s - self._seen_s < period_s:
            return
        self._seen_s = now_s
        try:
            view = context.shop.look()
        except LinkError as error:
            # The chuck view is no part of the machine: a failure is reported, and nothing else depends on it.
            context.tell(seen=None)
            context.alarm_once(error.problems[0], Priority.MEDIUM)
        else:
            context.tell(seen=view)
            context.end_alarms("simulator.gone", "simulator.refused")
            self._report(view.collisions)
            self._report_held(view.held_s)

    def _report_held(self, held_s: float) -> None:
        """Say once that the lathe has held its time in a motion; at rest the console may be at work itself."""
        grown_s, self._held_s = held_s - self._held_s, held_s
        moved, self._moved = self._moved, self._context.state.activity in MOVING
        if moved and grown_s > HELD_S:
            self._context.alarm_once(Problem(code="simulator.held", value=f"{grown_s:.1f} s"), Priority.LOW)

    def _report(self, collisions: tuple[str, ...]) -> None:
        """Raise an alarm once for each collision; a new blank starts without any."""
        known, self._collisions = self._collisions, collisions
        if known and not collisions:
            self._context.end_alarms(*COLLISION_CODES)
        fresh = [kind for kind in collisions if kind not in known]
        for kind, problem in zip(fresh, collision_problems(fresh), strict=True):
            self._context.alarm(problem)
            self._context.note_anyway("collision", met=kind)
