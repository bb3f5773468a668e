"""The machine's own thread, seen from inside: it takes one order or one look at a time, and settles every stop.

It knows no screen. Whoever drives it calls `step` again and again; what came of it is `state`, replaced and
never changed. An order while another is carried out is refused, not queued. A stop does not pass through here:
it goes straight to the link, and the station finds it latched.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from console.session.alarms import Priority, acknowledged, cleared
from console.session.alignment import observed
from console.session.errors import SessionError
from console.session.intents import Acknowledge, Hold, Intent, Recover, Verify
from console.session.orders import ORDERS
from console.session.sequence import tool_clear
from console.session.state import IDLE, MOVING, Activity, StationState, StopState
from console.session.workplace import Workplace
from drivers.errors import ControllerError, DriverError, LinkError, RefusedError
from drivers.snapshot import Snapshot
from drivers.stop import StoppedError
from profiles.problem import Problem, ProblemError

SCREEN_TIMEOUT_S = 2.0
"""How long the screen may be silent while something moves."""

SIGHT_PERIOD_S = 0.15
"""Between two looks at the chuck of the simulated shop."""


class Station:
    """One machine under one operator."""

    def __init__(self, place: Workplace) -> None:
        self._place = place
        self._order: Intent | None = None
        self._beat_s: float | None = None
        self._sight_s = float("-inf")

    @property
    def state(self) -> StationState:
        """The newest state."""
        return self._place.state

    def seen(self, snapshot: Snapshot) -> None:
        """Take in a look at the machine, from whatever wait it was made in: the lathe calls this."""
        place, state = self._place, self._place.state
        alignment = observed(
            state.alignment, drives_on=snapshot.loops_closed, homed=snapshot.homed, at=place.local_time()
        )
        place.tell(
            snapshot=snapshot,
            alignment=alignment,
            at_s=place.clock.now_s(),
            looked_s=place.clock.now_s(),
            round_trip_ms=1000.0 * place.lathe.round_trip_s,
        )
        if place.seen is not None:
            place.seen(snapshot)
        self._look_at_chuck()
        self._watch_screen()

    def connect(self) -> bool:
        """Set the link up and compare the controller with its profile; False when nothing like a PMAC answers."""
        try:
            version, kind = self._place.lathe.connect()
        except ProblemError as error:
            # Whatever is at the other end, it was not told to move, and it may not know what a stop is.
            for problem in error.problems:
                self._place.alarm(problem)
            self._place.tell(activity=Activity.LOST)
            return False
        self._place.tell(controller=f"{kind} {version}", activity=Activity.VERIFYING)
        self._carry_out(Verify())
        return True

    def post(self, intent: Intent) -> bool:
        """Take an order, from any thread; False where it is refused because the machine is busy."""
        place = self._place
        if isinstance(intent, Acknowledge):
            place.tell(alarms=acknowledged(place.state.alarms))
            return True
        if isinstance(intent, Hold):
            return self._hold()
        if place.state.activity not in IDLE or self._order is not None:
            return self._busy()
        if place.state.stop is not None and not isinstance(intent, Recover):
            place.tell(refusals=(Problem(code="session.stopped"),))
            return False
        self._order = intent
        return True

    def beat(self) -> None:
        """The screen is alive."""
        self._beat_s = self._place.clock.now_s()

    def step(self) -> None:
        """Settle a stop, or carry out an order, or take a look. Never raises."""
        order, self._order = self._order, None
        if self._place.lathe.stop.reason is not None and not isinstance(order, Recover):
            self._settle()
        elif order is not None:
            self._carry_out(order)
        else:
            self._guarded(self._look)
        self._disarm_in_time()

    def close(self, reason: str) -> None:
        """Leave the machine at rest with its drives off, as far as it can be told. Never raises."""
        place, lathe = self._place, self._place.lathe
        if lathe.has_moved:
            if self.state.moving or lathe.stop.reason is not None:
                lathe.stop.stop(reason)
                self._settle()
            lathe.stop.kill(reason)
            self._settle()
        place.end_record()

    def _hold(self) -> bool:
        if self._place.state.activity is not Activity.CUTTING:
            self._place.tell(refusals=(Problem(code="session.nothing_to_hold"),))
            return False
        self._place.hold_asked = True
        return True

    def _busy(self) -> bool:
        self._place.tell(refusals=(Problem(code="session.busy", value=self._place.state.activity.value),))
        return False

    def _carry_out(self, order: Intent) -> None:
        activity, work = ORDERS[type(order)]
        place = self._place
        place.hold_asked = False
        place.tell(refusals=(), activity=activity if place.state.stop is None else place.state.activity)
        self._guarded(lambda: self._worked(work, order))

    def _worked(self, work: Callable[[Workplace, Any], None], order: Intent) -> None:
        work(self._place, order)
        # What is seen at the chuck belongs to the end of the order, not to a moment on the way.
        self._sight_s = float("-inf")
        self._look_at_chuck()

    def _look(self) -> None:
        snapshot = self._place.lathe.snapshot()
        faults = snapshot.axis_faults
        if faults:
            self._place.lathe.stop.stop(faults[0])
            raise DriverError(Problem(code="machine.fault", key="look", value=", ".join(faults)))
        self._place.tell(alarms=cleared(self._place.state.alarms, "link.lost", "link.silent"))

    def _guarded(self, work: Callable[[], None]) -> None:
        """Do something with the machine; whatever goes wrong, it is told, and the machine is stopped for it."""
        place = self._place
        try:
            work()
        except StoppedError:
            self._settle()
        except (SessionError, ControllerError, RefusedError) as refused:
            self._refused(refused)
        except ProblemError as error:
            self._failed(error)
        except Exception as fault:
            # A fault of the console itself is no reason for the machine to go on.
            what = " ".join(f"{type(fault).__name__}: {fault}".split())
            self._failed(SessionError(Problem(code="session.fault", value=what)))
        else:
            place.tell(activity=Activity.READY if place.lathe.stop.reason is None else Activity.STOPPING)

    def _refused(self, error: ProblemError) -> None:
        """What is refused before anything moved leaves the machine alone; in the midst of a motion it stops it."""
        place = self._place
        moving = place.state.activity in MOVING and not _at_rest(place.state)
        if moving or place.state.activity is Activity.CUTTING:
            self._failed(error)
            return
        place.tell(refusals=tuple(error.problems), activity=Activity.READY)

    def _failed(self, error: ProblemError) -> None:
        place = self._place
        place.lathe.stop.stop(error.problems[0].code)
        for problem in error.problems:
            place.alarm(problem)
        self._settle(lost=isinstance(error, LinkError))

    def _settle(self, *, lost: bool = False) -> None:
        """After a stop: wait until the controller proves rest, and say how the machine was left."""
        place, stop = self._place, self._place.lathe.stop
        if place.state.stop is not None and place.state.stop.rest_s is not None and stop.proven:
            self._guarded_look()
            return
        began_s = place.state.stop.sent_s if place.state.stop else place.clock.now_s()
        told = StopState(reason=stop.reason or "", killed=stop.killed, sent_s=began_s)
        place.tell(stop=told, armed=None, activity=Activity.LOST if lost else Activity.STOPPING)
        try:
            snapshot = place.lathe.wait_for_rest()
        except ProblemError as unproven:
            self._note_end(told.reason, proven=False)
            for problem in unproven.problems:
                place.alarm(problem)
            place.tell(activity=Activity.LOST)
            return
        self._rested(told, snapshot)

    def _rested(self, told: StopState, snapshot: Snapshot) -> None:
        place = self._place
        in_part = None
        if place.plan is not None and snapshot.homed:
            in_part = not tool_clear(snapshot, place.plan)
        rest = StopState(
            reason=told.reason,
            killed=place.lathe.stop.killed,
            sent_s=told.sent_s,
            rest_s=place.clock.now_s(),
            tool_in_part=in_part,
            can_retract=snapshot.loops_closed,
        )
        self._note_end(told.reason, proven=True)
        place.tell(stop=rest, activity=Activity.STOPPED)

    def _guarded_look(self) -> None:
        """A look at a stopped machine; it stays stopped."""
        place = self._place
        try:
            place.lathe.snapshot()
        except DriverError as error:
            for problem in error.problems:
                place.alarm(problem, Priority.HIGH)
            place.tell(activity=Activity.LOST)
        else:
            place.tell(activity=Activity.STOPPED)

    def _note_end(self, reason: str, *, proven: bool) -> None:
        """Keep in the record how it ended; a record that cannot take it does not matter now."""
        try:
            self._place.note("stopped", reason=reason, proven=proven)
        except SessionError as error:
            self._place.alarm(error.problems[0], Priority.MEDIUM)

    def _look_at_chuck(self) -> None:
        place = self._place
        now_s = place.clock.now_s()
        # Not in a cut: every look then belongs to the controller.
        if (
            place.shop is None
            or place.state.activity is Activity.CUTTING
            or now_s - self._sight_s < SIGHT_PERIOD_S
        ):
            return
        self._sight_s = now_s
        try:
            place.tell(seen=place.shop.look())
        except LinkError as error:
            # Eyes on the chuck are no part of the machine: it is told, and nothing else depends on it.
            place.tell(seen=None)
            place.alarm(error.problems[0], Priority.MEDIUM)

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


def _at_rest(state: StationState) -> bool:
    return state.snapshot is not None and state.snapshot.at_rest
