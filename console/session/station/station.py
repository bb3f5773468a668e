"""The machine's own thread, seen from inside: it takes one order or one look at a time, and settles every stop.

It knows no screen. Whoever drives it calls `step` again and again; what came of it is `state`, replaced and
never changed. An order while another is carried out is refused, not queued. A stop does not pass through here:
it goes straight to the link, and the station finds it latched.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

from console.session.cut.alignment import observed
from console.session.errors import SessionError
from console.session.station.alarms import COLLISION_CODES, OF_A_CUT, Priority, collision_problems, seen
from console.session.station.home_watch import watch_home
from console.session.station.intents import Acknowledge, Hold, Intent, Recover, Start, TakeOver, Verify
from console.session.station.jogging import behind_face_mm, tool_in_part
from console.session.station.link_time import LinkTime
from console.session.station.orders import ORDERS
from console.session.station.progress import RUNNING, CutStage, SpindleWatch
from console.session.station.state import IDLE, MOVING, Activity, StationState, StopState
from console.session.station.watches import watch_axes, watch_devices, watch_guard, watch_loss
from console.session.station.workplace import Workplace, watch_stop_way
from drivers.errors import ControllerError, DriverError, LinkError, RefusedError
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.standing import Standing
from drivers.lathe.stop import StoppedError
from drivers.link.base import GONE
from profiles.problem import Problem, ProblemError

SCREEN_TIMEOUT_S = 2.0
"""How long the screen may be silent while something moves."""

SIGHT_PERIOD_S = 0.15
"""Between two looks at the chuck of the simulated shop."""

SIGHT_PERIOD_IN_MOTION_S = 1.0
"""The same while something moves, when looks and leases come first; what the tool runs into is to be told."""


OBSERVERS_ORDERS = (Verify, Recover, TakeOver)
"""What a console may ask for that only looks on; a stop needs nobody's leave."""


class Station:
    """One machine under one operator."""

    def __init__(self, place: Workplace) -> None:
        self._place = place
        self._order: Intent | None = None
        self._beat_s: float | None = None
        self._sight_s = float("-inf")
        self._met: tuple[str, ...] = ()
        self._slot = threading.Lock()
        self._gone = False
        self._link_time = LinkTime()
        self._noted: tuple[bool, bool] | None = None  # of the last stop in the record: rest proven, drives off
        self._spindle = SpindleWatch(place.loaded_machine.machine.spindle.counts_per_rev)

    @property
    def state(self) -> StationState:
        """The newest state."""
        return self._place.state

    def seen(self, snapshot: Snapshot) -> None:
        """Take in a look at the machine, from whatever wait it was made in: the lathe calls this."""
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
        self._watch_stop(snapshot)
        if place.seen is not None:
            place.seen(snapshot)
            self._watch_phase()
        else:
            place.end_alarms(*OF_A_CUT)
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
        self._place.tell(controller=f"{kind} {version}")
        self._claim()
        self._carry_out(Verify())
        return True

    def _claim(self) -> None:
        """Take control of the machine, or look on where that is not to be had."""
        place = self._place
        try:
            place.owning.claim()
        except ProblemError as error:
            for problem in error.problems:
                place.alarm(problem, Priority.MEDIUM)
        place.tell_standing()

    def post(self, intent: Intent) -> bool:
        """Take an order, from any thread; False where it is refused because the machine is busy."""
        place = self._place
        if isinstance(intent, Acknowledge):
            place.change_alarms(partial(seen, shown=intent.shown))
            return True
        if isinstance(intent, Hold):
            return self._hold()
        with self._slot:
            if place.state.activity is Activity.LOST:
                return self._refuse(Problem(code="session.lost"))
            if not place.state.controls and not isinstance(intent, OBSERVERS_ORDERS):
                holder = place.state.holder
                free = Problem(code="owner.free")
                return self._refuse(Problem(code="owner.observer", value=str(holder)) if holder else free)
            if place.state.activity not in IDLE or self._order is not None:
                return self._refuse(Problem(code="session.busy"))
            if place.state.stop is not None and not isinstance(intent, Recover):
                return self._refuse(Problem(code="session.stopped"))
            self._order = intent
            return True

    def beat(self) -> None:
        """The screen is alive."""
        self._beat_s = self._place.clock.now_s()

    def step(self) -> None:
        """Settle a stop, or carry out an order, or take a look. Never raises."""
        with self._slot:
            order, self._order = self._order, None
        try:
            self._step(order)
        except Exception as fault:
            # The console's own fault; the thread goes on, because nobody else could stop the machine.
            if self.state.controls:
                self._place.lathe.stop.stop("fault")
            self._place.alarm(_fault_problem(fault))

    def _step(self, order: Intent | None) -> None:
        if self._gone:
            return
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
        if self.state.controls and self._may_be_on():
            if self.state.may_move or lathe.stop.reason is not None:
                lathe.stop.stop(reason)
                self._settle()
            lathe.stop.kill(reason)
            if not lathe.stop.given_up:
                self._settle()
                with suppress(ProblemError):
                    lathe.put_back()
        if not lathe.stop.given_up:  # a machine that is left in doubt stays ours: whoever comes next looks at it
            place.owning.release()
        place.end_record()

    def _may_be_on(self) -> bool:
        """Whether a drive may be on: ours, or one that was on when the machine was taken over."""
        snapshot = self.state.snapshot
        return self._place.lathe.has_moved or snapshot is None or not snapshot.loops_open

    def _hold(self) -> bool:
        if self._place.state.activity is not Activity.CUTTING:
            return self._refuse(Problem(code="session.nothing_to_hold"))
        self._place.hold_asked = True
        return True

    def _refuse(self, problem: Problem) -> bool:
        self._place.tell(refusals=(problem,))
        return False

    def _carry_out(self, order: Intent) -> None:
        activity, work = ORDERS[type(order)]
        place = self._place
        place.hold_asked = False
        if not isinstance(order, Start):
            place.tell(armed=None)  # what was read in the summary may not be so any more
        place.tell(refusals=(), activity=activity if place.state.stop is None else place.state.activity)
        self._guarded(lambda: self._worked(work, order))

    def _worked(self, work: Callable[[Workplace, Any], None], order: Intent) -> None:
        work(self._place, order)
        # What is seen at the chuck belongs to the end of the order, not to a moment on the way.
        self._sight_s = float("-inf")
        self._look_at_chuck()

    def _look(self) -> None:
        snapshot = self._place.lathe.snapshot()
        watch_loss(self._place, snapshot)
        if self.state.controls and self._place.lathe.stop.hands_in and not snapshot.loops_open:
            # It was not us: somebody else, or a PLC of the card. The stop is a control-K then.
            raise DriverError(Problem(code="machine.energised"))
        place = self._place
        place.limits_seen &= snapshot.limits  # one that was left, and is met again, is news
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
            self._failed(SessionError(_fault_problem(fault)))
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
        if place.lathe.anothers:
            self._told_apart(error)
            return
        if isinstance(error, LinkError):
            place.lathe.in_doubt()
        place.lathe.stop.stop(error.problems[0].code)
        for problem in error.problems:
            place.alarm(problem)
        self._settle(lost=isinstance(error, LinkError))

    def _told_apart(self, error: ProblemError) -> None:
        """Tell what went wrong on a machine that another console controls: nothing is sent to it for that."""
        place = self._place
        for problem in error.problems:
            if not self._told(problem.code):
                place.alarm(problem)
        self._gone = any(problem.code in GONE for problem in error.problems)
        lost = isinstance(error, LinkError)
        place.tell(activity=Activity.LOST if lost else Activity.READY, armed=None)

    def _settle(self, *, lost: bool = False) -> None:
        """After a stop: wait until the controller proves rest, and say how the machine was left."""
        place, stop = self._place, self._place.lathe.stop
        before = place.state.stop
        if before is not None and before.rest_s is not None and stop.proven:
            self._guarded_look()
            return
        under_way = before is not None and before.rest_s is None
        told = replace(
            before or self._begun_stop(),
            reason=stop.reason or "",
            killed=stop.killed,
            sent_s=before.sent_s if before is not None and under_way else place.clock.now_s(),
            delivered=stop.delivered,
            taken_s=before.taken_s if before is not None and under_way else None,
            rest_s=None,
            tool_in_part=None,
            can_retract=False,
        )
        place.tell(stop=told, armed=None, activity=Activity.LOST if lost else Activity.STOPPING)
        try:
            snapshot = place.lathe.wait_for_rest()
        except ProblemError as unproven:
            self._not_rested(told, unproven)
        else:
            self._rested(told, snapshot)

    def _begun_stop(self) -> StopState:
        """Return what the state tells of a stop that has just come; what it ended stays with it until F2.

        A tool that comes to rest in a part that still turns cuts a circle there, deeper than its path in places.
        """
        place, state = self._place, self._place.state
        if state.standing is Standing.OBSERVER:
            with suppress(ProblemError):  # whoever controls the machine then knows by whom its cut was ended
                place.lathe.say_stopped()
        cut = state.cut if state.activity is Activity.CUTTING else None
        in_part = cut is not None and cut.stage is CutStage.CUT and not cut.in_air
        mark_mm = self._behind_face_mm() if in_part else None
        marks_mm = state.marks_mm if mark_mm is None else (*state.marks_mm, mark_mm)
        self._noted = None
        place.tell(stops=state.stops + 1, marks_mm=marks_mm)
        of_cut = cut is not None and cut.stage in RUNNING
        return StopState(reason="", killed=False, sent_s=0.0, of_cut=of_cut, mark_mm=mark_mm)

    def _behind_face_mm(self) -> float | None:
        """Return where the tool stands in the clamped part, by the last look; None where that is not known."""
        place, clamping = self._place, self._place.state.alignment.clamping
        if place.state.snapshot is None or clamping is None:
            return None
        return behind_face_mm(place.state.snapshot, place.loaded_machine.machine, clamping.overhang_mm)

    def _not_rested(self, told: StopState, unproven: ProblemError) -> None:
        """Nobody can tell how the machine is. A link that is gone stays so; one that is silent is asked again."""
        place = self._place
        self._gone = any(problem.code in GONE for problem in unproven.problems)
        known = {alarm.problem.code for alarm in place.state.alarms}
        for problem in unproven.problems:
            if problem.code not in known:
                place.alarm(problem)
        self._note_stop(told, proven=False)
        told = replace(told, killed=place.lathe.stop.killed, delivered=place.lathe.stop.delivered)
        place.tell(stop=told, activity=Activity.LOST)

    def _rested(self, told: StopState, snapshot: Snapshot) -> None:
        place = self._place
        mark_mm = None if told.mark_mm is None else self._behind_face_mm()
        if mark_mm is not None:
            place.tell(marks_mm=(*place.state.marks_mm[:-1], mark_mm))
        self._spindle.forget()  # how it came to rest is no speed that it has
        rest = replace(
            place.state.stop or told,
            mark_mm=mark_mm,
            killed=place.lathe.stop.killed,
            delivered=True,
            rest_s=place.clock.now_s(),
            tool_in_part=tool_in_part(snapshot, place.loaded_machine.machine, place.state.alignment),
            can_retract=snapshot.loops_closed,
        )
        taken = None if rest.taken_s is None else rest.taken_s - rest.sent_s
        self._note_stop(told, proven=True, taken_after_s=taken)
        watch_axes(place, snapshot)
        place.tell(stop=rest, spindle_rpm=None, activity=Activity.STOPPED, refusals=())

    def _guarded_look(self) -> None:
        """A look at a stopped machine; it stays stopped."""
        place = self._place
        try:
            snapshot = place.lathe.snapshot()
        except DriverError as error:
            for problem in error.problems:
                place.alarm(problem, Priority.HIGH)
            place.tell(activity=Activity.LOST)
        else:
            watch_axes(place, snapshot)
            place.tell(activity=Activity.STOPPED)

    def _note_stop(self, told: StopState, *, proven: bool, taken_after_s: float | None = None) -> None:
        """Keep a stop in the record once, and later what has become of it: rest that is proven, drives off."""
        before, killed = self._noted, self._place.lathe.stop.killed
        self._noted = (proven, killed)
        if before is None:
            self._note("stopped", reason=told.reason, proven=proven, killed=killed, taken_after_s=taken_after_s)
            return
        was_proven, was_killed = before
        if killed and not was_killed:
            self._note("killed", proven=proven)
        elif proven and not was_proven:
            self._note("at_rest")

    def _note(self, kind: str, **data: object) -> None:
        """Keep in the record what happened; a record that cannot take it does not matter now."""
        try:
            self._place.note(kind, **data)
        except SessionError as error:
            self._place.alarm(error.problems[0], Priority.MEDIUM)

    def _look_at_chuck(self) -> None:
        place = self._place
        now_s = place.clock.now_s()
        period_s = SIGHT_PERIOD_IN_MOTION_S if place.state.activity in MOVING else SIGHT_PERIOD_S
        if place.shop is None or now_s - self._sight_s < period_s:
            return
        self._sight_s = now_s
        try:
            view = place.shop.look()
        except LinkError as error:
            # Eyes on the chuck are no part of the machine: it is told, and nothing else depends on it.
            place.tell(seen=None)
            if not self._told(error.problems[0].code):
                place.alarm(error.problems[0], Priority.MEDIUM)
        else:
            place.tell(seen=view)
            place.end_alarms("simulator.gone", "simulator.refused")
            self._tell_collisions(view.collisions)

    def _tell_collisions(self, met: tuple[str, ...]) -> None:
        """Raise an alarm for each collision once; a new blank has met nothing."""
        place, known = self._place, self._met
        self._met = met
        if known and not met:
            place.end_alarms(*COLLISION_CODES)
        fresh = [kind for kind in met if kind not in known]
        for kind, problem in zip(fresh, collision_problems(fresh), strict=True):
            place.alarm(problem)
            self._note("collision", met=kind)

    def _watch_stop(self, snapshot: Snapshot) -> None:
        """Take note of when the controller first obeys a stop, by a look that was asked for behind it."""
        stop = self._place.state.stop
        if stop is None or stop.taken_s is not None or snapshot.asked_s < stop.sent_s:
            return
        if snapshot.obeys_stop(killed=self._place.lathe.stop.killed):
            self._place.tell(stop=replace(stop, taken_s=snapshot.at_s))

    def _told(self, code: str) -> bool:
        return self._place.alarmed(code)

    def _watch_phase(self) -> None:
        """Say once for each cut that tool and lobe are not in phase, or that the spindle stands."""
        cut = self._place.state.cut
        if cut is None or cut.stage is not CutStage.CUT:
            return
        if cut.in_phase is False and not self._told("cut.out_of_phase"):
            problem = Problem(code="cut.out_of_phase", limit=f"± {cut.phase_limit_deg:.2g} deg")
            self._place.alarm(problem, Priority.MEDIUM)
        elif cut.is_lost and cut.in_phase is not False and not self._told("cut.spindle_stands"):
            self._place.alarm(Problem(code="cut.spindle_stands"))

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
