"""Wait for the end of a motion, however it ends; check travel limits and stopping distances.

Explain an axis that lagged until its following-error limit opened its loops: by how much, and the likely cause.
Dry friction of the tool is the usual one. While the tool sticks, its integrator pushes with the friction force F.
On reversal that force and F in the other direction must be overcome, and the loop yields by c F for each: it lags
by 2 c F, with c = 1 / (K Kp) its compliance without the integrator.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count, repeat

from drivers.errors import DriverError, RefusedError
from drivers.lathe.commands import Wiring
from drivers.lathe.console_role import ConsoleRole
from drivers.lathe.guards import Guard, accept_any_state, open_loop_problem, reset_problem
from drivers.lathe.heartbeat import LAPSED, Heartbeat
from drivers.lathe.lengths import Lengths, motor_of, settings_of
from drivers.lathe.safety import device_problems
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.pmac.analysis.units import shown_length
from drivers.pmac.heartbeat.plc import Policy
from drivers.pmac.motor_settings import MotorSettings
from profiles.axis.servo import tool_compliance_um_per_n
from profiles.axis.stiffness import ASSUMED_FRICTION_N
from profiles.machine import MachineProfile
from profiles.problem import Problem

CUT_POLL_S = 0.023  # mean pause between two polls of a cut
UNEVEN, GOLDEN = 1.2, 0.618034
"""The pauses are spread evenly over this fraction of their mean, in the order of the golden section: so every
angle is sampled, however long a turn takes.
"""
WAY_HOME_S = 10.0  # of a program ended early, after its retract: a table is left in its row of zeros
JOG_POLL_S = 0.05  # polling interval for an axis in motion
LINK_LATENCY_MS = 50.0  # allowance for a stop from the key to the controller
BEHIND = "fatal_following_error"


def _pauses_s(*, of_cut: bool) -> Iterator[float]:
    """Yield the pauses between the polls of a program; those of a cut are uneven."""
    spread = UNEVEN if of_cut else 0.0
    return (CUT_POLL_S * (1.0 + spread * (number * GOLDEN % 1.0 - 0.5)) for number in count())


def left_behind(machine: MachineProfile, before: Snapshot | None, seen: Snapshot) -> tuple[Problem, ...]:
    """Return the following error of each tripped axis; `before` is the poll before the one that saw the trip.

    A controller that opens a loop sets the command to the actual position, so the poll that shows the trip no
    longer shows the error.
    """
    return tuple(
        _of_axis(machine, axis, [each for each in (before, seen) if each is not None])
        for axis in AxisName
        if BEHIND in seen.axis(axis).flags
    )


def _tripping_friction_n(machine: MachineProfile) -> float:
    """Return the dry friction, N, at which the tool trips on reversal after a standstill."""
    steady = replace(machine, tool=replace(machine.tool, gain_ki_v_per_m_s=0.0))
    compliance_um_per_n = abs(complex(tool_compliance_um_per_n(steady, 0.0)))
    limit_um = MotorSettings(machine, machine.tool.motor).error_limit_counts * machine.tool.count_um
    return limit_um / (2.0 * compliance_um_per_n)


def _of_axis(machine: MachineProfile, axis: AxisName, polls: list[Snapshot]) -> Problem:
    motor = motor_of(machine, axis)
    behind = max(abs(poll.axis(axis).following_error) for poll in polls)
    limit = MotorSettings(machine, motor).error_limit_counts
    lengths = [shown_length(machine, motor, counts) for counts in (behind, limit)]
    value, allowed = (f"{length['length']:.3g} {length['unit']}" for length in lengths)
    allowed = f"{allowed} (I{motor}11)"
    if axis is not AxisName.TOOL:
        return Problem(code="machine.left_behind", key=axis, value=value, limit=allowed)
    friction, assumed = f"{_tripping_friction_n(machine):.1f} N", f"{ASSUMED_FRICTION_N:g} N"
    return Problem(code="machine.tool_left_behind", where=friction, key=assumed, value=value, limit=allowed)


class MotionWaits:
    """The waits of one machine. Travel limits on which an axis stands when it begins to move off are no fault."""

    def __init__(self, wiring: Wiring, hold: Callable[[], None]) -> None:
        """`hold` asks the running program to end early, with its tool retracted."""
        self._machine, self._clock, self._stop = wiring.machine, wiring.clock, wiring.stop
        self._poller, self._heartbeat, self._ownership = wiring.poller, wiring.heartbeat, wiring.ownership
        self._hold = hold

    def until(
        self,
        done: Callable[[Snapshot], bool],
        timeout_s: float,
        what: str,
        watch: Callable[[Snapshot], None] | None = None,
        *,
        guard: Guard = accept_any_state,
        homing: AxisName | None = None,
        waits: Callable[[], bool] = lambda: False,
    ) -> Snapshot:
        """Poll until the motion is over; `watch` is called with each poll of a cut. `what` names it in errors.

        `guard` judges each poll. The axis that is `homing` may lose its zero; every other must keep it. While it
        `waits` for somebody the timeout does not run.

        Raises:
            DriverError: `machine.fault`, `machine.timeout`, `safety.not_good`, `controller.was_reset`,
                `machine.loop_open`, those of the guard, the machine was stopped before;
                `heartbeat.plc_silent`, see `_end_unguarded`; and what ends it from outside, see `_next_poll`.
        """
        with self._poller.positions.commanding():
            return self._follow_motion(done, timeout_s, what, watch, guard, homing, waits)

    def _follow_motion(
        self,
        done: Callable[[Snapshot], bool],
        timeout_s: float,
        what: str,
        watch: Callable[[Snapshot], None] | None,
        guard: Guard,
        homing: AxisName | None,
        waits: Callable[[], bool],
    ) -> Snapshot:
        """Poll as `until` says."""
        deadline = self._clock.now_s() + timeout_s
        last = self._poller.last
        homed = frozenset() if last is None else last.homed_axes - {homing}
        standing_on = frozenset() if watch is not None or last is None else last.limits
        alone: tuple[Problem, ...] = ()
        pauses_s = _pauses_s(of_cut=guard is not accept_any_state) if watch is not None else repeat(JOG_POLL_S)
        while True:
            before, snapshot = self._poller.last, self._next_poll(next(pauses_s), deadline, watch, homed)
            faults = snapshot.axis_faults if watch is None else snapshot.faults
            self._refuse_faults(before, snapshot, what, [fault for fault in faults if fault not in standing_on])
            self._refuse_astray(snapshot, guard)
            if not alone and self._heartbeat is not None and self._heartbeat.silent is not None:
                alone = (self._heartbeat.silent,)
                deadline = min(deadline, self._end_unguarded(self._heartbeat, alone[0], in_cut=watch is not None))
            if watch is not None:
                watch(snapshot)
            if done(snapshot):
                if self._heartbeat is not None:
                    self._heartbeat.end_guarding()
                if alone:
                    raise DriverError(*alone)
                return snapshot
            if waits() and not alone:
                deadline = self._clock.now_s() + timeout_s
            if self._clock.now_s() > deadline:
                self._stop.stop(f"{what}: {timeout_s:g} s")
                raise DriverError(*alone, Problem(code="machine.timeout", key=what, value=f"{timeout_s:g} s"))

    def _refuse_faults(self, before: Snapshot | None, snapshot: Snapshot, what: str, faults: list[str]) -> None:
        """Stop on a fault; a safety device that has ended the motion itself is reported first."""
        problems = device_problems(snapshot.inputs)
        if faults:
            problems = (*problems, Problem(code="machine.fault", key=what, value=", ".join(faults)))
            problems = (*problems, *left_behind(self._machine, before, snapshot))
        if problems:
            self._stop.stop(faults[0] if faults else problems[0].key)
            raise DriverError(*problems)

    def _refuse_astray(self, snapshot: Snapshot, guard: Guard) -> None:
        """Stop a motion that deviates from its command, at the poll that shows it.

        What our own stop has opened or moved since the last poll does not count.
        """
        self._stop.check()
        found = (open_loop_problem(snapshot), self._poller.changed, *guard(snapshot))
        problems = [problem for problem in found if problem is not None]
        if problems:
            self._stop.stop(problems[0].code)
            raise DriverError(*problems)

    def _end_unguarded(self, heartbeat: Heartbeat, problem: Problem, *, in_cut: bool) -> float:
        """End what the controller would no longer end, as it would; return when it must be over.

        A cut that may continue without a host continues: it is as safe as before.
        """
        if not in_cut or heartbeat.policy is Policy.STOP:
            self._stop.stop(problem.code)
            raise DriverError(problem)
        if heartbeat.policy is Policy.RETRACT:
            self._hold()
        return self._clock.now_s() + heartbeat.ends_within_s + WAY_HOME_S

    def _next_poll(
        self, pause_s: float, deadline: float, watch: Callable[[Snapshot], None] | None, homed: frozenset[AxisName]
    ) -> Snapshot:
        """Let time pass with the watchdog renewed, then poll; `homed` are the axes that must have kept their zero.

        In the pause some of what shapes a cut is read.
        A controller that was reset has also forgotten its owner, so lost positions are judged first.

        Raises:
            DriverError: `heartbeat.lapsed`, the controller ended the motion; `controller.was_reset`,
                `controller.home_lost`; `owner.ousted`, the machine is no longer ours.
            StoppedError: somebody stopped the machine.
        """
        begun_s = self._clock.now_s()
        try:
            self._poller.read_beside()
            pause_s = max(begun_s + pause_s - self._clock.now_s(), 0.0)
            if self._heartbeat is None:
                self._clock.wait(pause_s)
            else:
                self._heartbeat.pause(pause_s, self._poller.quick_timeout_s)
            self._stop.check()
            snapshot = self._poller.look()
            if (lost := reset_problem(homed, snapshot)) is not None:
                self._stop.stop(lost.code)
                raise DriverError(lost)
            if snapshot.lost and self._heartbeat is not None and self._heartbeat.guarding:
                raise self._heartbeat.lapse()
        except DriverError as error:
            if error.problems[0].code == LAPSED:
                self._see_it_end(deadline, watch)
            raise
        if self._ownership is not None:
            self._ownership.refuse_ousted()
        return snapshot

    def _see_it_end(self, deadline: float, watch: Callable[[Snapshot], None] | None) -> None:
        """Watch while the controller ends a motion that lost its host: a stop would leave the tool in the part.

        A cut that it lets finish is followed as before: a request to end early is passed on.
        """
        heartbeat = self._heartbeat
        assert heartbeat is not None  # it has reported this
        deadline = min(deadline, self._clock.now_s() + heartbeat.ends_within_s)
        while self._clock.now_s() < deadline:
            self._stop.check()
            snapshot = self._poller.look()
            if snapshot.at_rest and not heartbeat.is_ending():
                return
            if self._ownership is not None and self._ownership.standing is ConsoleRole.OUSTED:
                return  # what moves now is another console's
            if watch is not None:
                watch(snapshot)
            self._clock.wait(CUT_POLL_S)


def refuse_beyond_travel(machine: MachineProfile, axis: AxisName, counts: float) -> None:
    """Refuse a position outside the software limits. Raises RefusedError: `machine.beyond_travel`."""
    settings, lengths, limit = settings_of(machine, axis), Lengths(machine), ""
    high, low = settings.highest_counts, settings.lowest_counts
    if high is not None and counts > high:
        limit = f"<= {lengths.format_position(axis, high)}"
    if low is not None and counts < low:
        limit = f">= {lengths.format_position(axis, low)}"
    if limit:
        value = lengths.format_position(axis, counts)
        raise RefusedError(Problem(code="machine.beyond_travel", key=axis, value=value, limit=limit))
