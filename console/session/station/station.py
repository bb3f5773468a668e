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

from console.session.cut.alignment import observed
from console.session.errors import SessionError
from console.session.station.alarms import OF_A_CUT, Priority, seen
from console.session.station.chuck_sight import ChuckSight
from console.session.station.commands import Acknowledge, Command, EndCut, Recover, Start, TakeControl, Verify
from console.session.station.context import StationContext, watch_stop_way
from console.session.station.handlers import HANDLERS
from console.session.station.home_watch import watch_home
from console.session.station.link_time import LinkTime
from console.session.station.progress import SpindleWatch
from console.session.station.state import IDLE, MOVING, Activity, StationState
from console.session.station.stops import Stops
from console.session.station.watches import watch_axes, watch_devices, watch_guard, watch_loss, watch_phase
from drivers.errors import ControllerError, DriverError, LinkError, RefusedError
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StoppedError
from drivers.link.base import GONE
from profiles.problem import Problem, ProblemError

SCREEN_TIMEOUT_S = 2.0
"""Timeout of a silent screen while something moves."""

OBSERVERS_COMMANDS = (Verify, Recover, TakeControl)
"""Commands open to a console that only observes; a stop needs no permission."""


class Station:
    """One machine under one operator."""

    def __init__(self, place: StationContext) -> None:
        self._place = place
        self._command: Command | None = None
        self._beat_s: float | None = None
        self._slot = threading.Lock()
        self._link_time = LinkTime()
        self._spindle = SpindleWatch(place.loaded_machine.machine.spindle.counts_per_rev)
        self._stops, self._sight = Stops(place, self._spindle.forget), ChuckSight(place)

    @property
    def state(self) -> StationState:
        """The newest state."""
        return self._place.state

    def seen(self, snapshot: Snapshot) -> None:
        """Take a status poll, from whatever wait it was made in: the lathe calls this."""
        place, state = self._place, self._place.state
        alignment = observed(
            state.alignment,
            drives_on=snapshot.loops_closed,
            homed=snapshot.homed,
            at=place.local_time(),
            chuck_open=not snapshot.inputs.get("chuck_closed", True),
        )
        place.tell(
            snapshot=snapshot,
            spindle_rpm=self._spindle.see(snapshot),
            alignment=alignment,
            at_s=place.clock.now_s(),
            round_trip_ms=self._link_time.see(place.clock.now_s(), place.lathe.round_trip_s),
        )
        place.tell_standing()
        watch_home(place, state, snapshot)
        watch_devices(place, state.snapshot, snapshot)
        watch_guard(place)
        watch_stop_way(place)
        self._stops.watch(snapshot)
        if place.seen is not None:
            place.seen(snapshot)
            watch_phase(place)
        else:
            place.end_alarms(*OF_A_CUT)
        self._sight.look()
        self._watch_screen()

    def connect(self) -> bool:
        """Set up the link and compare the controller with its profile; False when nothing like a PMAC answers."""
        try:
            version, kind = self._place.lathe.connect()
        except ProblemError as error:
            # Whatever is at the other end received no motion command, and may not understand a stop.
            for problem in error.problems:
                self._place.alarm(problem)
            self._place.tell(activity=Activity.LOST)
            return False
        self._place.tell(controller=f"{kind} {version}")
        self._claim()
        self._carry_out(Verify())
        return True

    def _claim(self) -> None:
        """Take control of the machine, or only observe where that is refused."""
        place = self._place
        try:
            place.owning.claim()
        except ProblemError as error:
            for problem in error.problems:
                place.alarm(problem, Priority.MEDIUM)
        place.tell_standing()

    def post(self, intent: Command) -> bool:
        """Take a command, from any thread; False where it is refused because the machine is busy."""
        place = self._place
        if isinstance(intent, Acknowledge):
            place.change_alarms(partial(seen, shown=intent.shown))
            return True
        if isinstance(intent, EndCut):
            return self._hold()
        with self._slot:
            if place.state.activity is Activity.LOST:
                return self._refuse(Problem(code="session.lost"))
            if not place.state.controls and not isinstance(intent, OBSERVERS_COMMANDS):
                holder = place.state.holder
                free = Problem(code="owner.free")
                return self._refuse(Problem(code="owner.observer", value=str(holder)) if holder else free)
            if place.state.activity not in IDLE or self._command is not None:
                return self._refuse(Problem(code="session.busy"))
            if place.state.stop is not None and not isinstance(intent, Recover):
                return self._refuse(Problem(code="session.stopped"))
            self._command = intent
            return True

    def beat(self) -> None:
        """Note that the screen is alive."""
        self._beat_s = self._place.clock.now_s()

    def step(self) -> None:
        """Settle a stop, or carry out a command, or poll. Never raises."""
        with self._slot:
            command, self._command = self._command, None
        try:
            self._step(command)
        except Exception as fault:
            # An internal fault; the thread continues, because nothing else could stop the machine.
            if self.state.controls:
                self._place.lathe.stop.stop("fault")
            self._place.alarm(_fault_problem(fault))

    def _step(self, command: Command | None) -> None:
        if self._stops.gone:
            return
        if self._place.lathe.stop.reason is not None and not isinstance(command, Recover):
            self._stops.settle()
        elif command is not None:
            self._carry_out(command)
        else:
            self._guarded(self._look)
        self._disarm_in_time()

    def close(self, reason: str) -> None:
        """Leave the machine at rest with its drives off, as far as possible. Never raises."""
        place, lathe = self._place, self._place.lathe
        if self.state.controls and self._may_be_on():
            if self.state.may_move or lathe.stop.reason is not None:
                lathe.stop.stop(reason)
                self._stops.settle()
            lathe.stop.kill(reason)
            if not lathe.stop.given_up:
                self._stops.settle()
                with suppress(ProblemError):
                    lathe.program.put_back()
        if not lathe.stop.given_up:  # a machine left in doubt stays ours: the next console must check it
            place.owning.release()
        place.end_record()

    def _may_be_on(self) -> bool:
        """Whether a drive may be on: enabled by us, or on when control was taken."""
        snapshot = self.state.snapshot
        return self._place.lathe.has_moved or snapshot is None or not snapshot.loops_open

    def _hold(self) -> bool:
        if self._place.state.activity is not Activity.CUTTING:
            return self._refuse(Problem(code="session.nothing_to_hold"))
        self._place.end_asked = True
        return True

    def _refuse(self, problem: Problem) -> bool:
        self._place.tell(refusals=(problem,))
        return False

    def _carry_out(self, command: Command) -> None:
        activity, work = HANDLERS[type(command)]
        place = self._place
        place.end_asked = False
        if not isinstance(command, Start):
            place.tell(armed=None)  # what was read in the summary may have changed
        place.tell(refusals=(), activity=activity if place.state.stop is None else place.state.activity)
        self._guarded(lambda: self._worked(work, command))

    def _worked(self, work: Callable[[StationContext, Any], None], command: Command) -> None:
        work(self._place, command)
        self._sight.look_now()

    def _look(self) -> None:
        snapshot = self._place.lathe.snapshot()
        watch_loss(self._place, snapshot)
        if self.state.controls and self._place.lathe.stop.inside_guard and not snapshot.loops_open:
            # It was not us: somebody else, or a PLC of the controller. The stop is a control-K then.
            raise DriverError(Problem(code="machine.energised"))
        place = self._place
        place.limits_seen &= snapshot.limits  # a limit that was left and is reached again is reported again
        faults = tuple(fault for fault in snapshot.axis_faults if fault not in place.limits_seen)
        problem = Problem(code="machine.fault", key="look", value=", ".join(faults))
        if faults and snapshot.loops_open and self._place.state.armed is not None:
            self._place.tell(armed=None)
        if faults and not snapshot.loops_open and self.state.controls:
            self._place.lathe.stop.stop(faults[0])
            raise DriverError(problem)
        place.end_alarms("link.silent")
        watch_axes(place, snapshot)

    def _guarded(self, work: Callable[[], None]) -> None:
        """Run an operation on the machine; on any error, report it and stop the machine."""
        place = self._place
        try:
            work()
        except StoppedError:
            self._stops.settle()
        except (SessionError, ControllerError, RefusedError) as refused:
            self._refused(refused)
        except ProblemError as error:
            self._failed(error)
        except Exception as fault:
            # A fault of the console itself must stop the machine too.
            self._failed(SessionError(_fault_problem(fault)))
        else:
            place.tell(activity=Activity.READY if place.lathe.stop.reason is None else Activity.STOPPING)

    def _refused(self, error: ProblemError) -> None:
        """Handle a refusal: before any motion it leaves the machine alone; during a motion it stops it."""
        place = self._place
        moving = place.state.activity in MOVING and not _at_rest(place.state)
        if moving or place.state.activity is Activity.CUTTING:
            self._failed(error)
            return
        place.tell(refusals=tuple(error.problems), activity=Activity.READY)

    def _failed(self, error: ProblemError) -> None:
        place = self._place
        if place.lathe.anothers:
            self._told_apart(error)
            return
        if isinstance(error, LinkError):
            place.lathe.in_doubt()
        place.lathe.stop.stop(error.problems[0].code)
        for problem in error.problems:
            place.alarm(problem)
        self._stops.settle(lost=isinstance(error, LinkError))

    def _told_apart(self, error: ProblemError) -> None:
        """Report an error on a machine that another console controls: nothing is sent to it."""
        place = self._place
        for problem in error.problems:
            if not place.alarmed(problem.code):
                place.alarm(problem)
        self._stops.gone = any(problem.code in GONE for problem in error.problems)
        lost = isinstance(error, LinkError)
        place.tell(activity=Activity.LOST if lost else Activity.READY, armed=None)

    def _watch_screen(self) -> None:
        place = self._place
        silent = self._beat_s is not None and place.clock.now_s() - self._beat_s > SCREEN_TIMEOUT_S
        if silent and place.state.activity in MOVING and place.lathe.stop.reason is None:
            place.lathe.stop.stop("screen")
            place.alarm(Problem(code="session.screen_silent", limit=f"{SCREEN_TIMEOUT_S:g} s"))

    def _disarm_in_time(self) -> None:
        armed = self._place.state.armed
        if armed is not None and self._place.clock.now_s() > armed.until_s:
            self._place.tell(armed=None, refusals=(Problem(code="session.arm_expired"),))


def _fault_problem(fault: Exception) -> Problem:
    return Problem(code="session.fault", value=" ".join(f"{type(fault).__name__}: {fault}".split()))


def _at_rest(state: StationState) -> bool:
    return state.snapshot is not None and state.snapshot.at_rest
