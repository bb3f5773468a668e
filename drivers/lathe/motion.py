"""Wait for the end of a motion, however it ends; check travel limits and stopping distances."""

from __future__ import annotations

from collections.abc import Callable

from drivers.clock import Clock
from drivers.errors import DriverError, RefusedError
from drivers.lathe.control_state import Standing
from drivers.lathe.guards import Guard, open_loop_problem, reset_problem, unguarded
from drivers.lathe.heartbeat import LAPSED, Heartbeat
from drivers.lathe.left_behind import left_behind
from drivers.lathe.lengths import Lengths
from drivers.lathe.ownership import Ownership
from drivers.lathe.polling import Poller
from drivers.lathe.safety import device_problems
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.lathe.stop import StopPath
from drivers.pmac.heartbeat.plc import Policy
from drivers.pmac.motor_settings import MotorSettings
from profiles.machine import MachineProfile
from profiles.problem import Problem

CUT_POLL_S = 0.023
"""Polling interval during a cut: not an integer fraction of any usual turn, so that every angle is sampled."""

WAY_HOME_S = 10.0
"""How long a program ended early may run after its retract: a table is left in its row of zeros."""

JOG_POLL_S = 0.05
"""Polling interval for an axis in motion."""

LINK_LATENCY_MS = 50.0
"""Allowance for a stop from the key to the controller."""


class Motion:
    """The waits of one machine. Travel limits on which an axis stands when it begins to move off are no fault."""

    def __init__(
        self,
        machine: MachineProfile,
        looks: Poller,
        stop: StopPath,
        clock: Clock,
        heartbeat: Heartbeat | None,
        ownership: Ownership | None,
        hold: Callable[[], None],
    ) -> None:
        """`hold` asks the running program to end early, with its tool retracted."""
        self._machine, self._poller, self._stop, self._clock = machine, looks, stop, clock
        self._heartbeat, self._ownership, self._hold = heartbeat, ownership, hold

    def _pause(self, seconds: float) -> None:
        if self._heartbeat is None:
            self._clock.wait(seconds)
        else:
            self._heartbeat.pause(seconds, self._poller.patience_s)

    def until(
        self,
        done: Callable[[Snapshot], bool],
        timeout_s: float,
        what: str,
        watch: Callable[[Snapshot], None] | None = None,
        *,
        guard: Guard = unguarded,
        homing: AxisName | None = None,
    ) -> Snapshot:
        """Poll until the motion is over; `watch` is called with each poll of a cut. `what` names it in errors.

        `guard` judges each poll. The axis that is `homing` may lose its zero; every other must keep it.

        Raises:
            DriverError: `machine.fault`, `machine.timeout`, `safety.not_good`, `controller.was_reset`,
                `machine.loop_open`, those of the guard, the machine was stopped before;
                `heartbeat.plc_silent`, see `_end_unguarded`; and what ends it from outside, see `_next_look`.
        """
        deadline = self._clock.now_s() + timeout_s
        homed = frozenset() if self._poller.last is None else self._poller.last.homed_axes - {homing}
        standing_on: frozenset[str] = (
            frozenset() if watch is not None or self._poller.last is None else self._poller.last.limits
        )
        alone: tuple[Problem, ...] = ()
        while True:
            before, snapshot = self._poller.last, self._next_look(deadline, watch, homed)
            met = snapshot.axis_faults if watch is None else snapshot.faults
            self._refuse_faults(before, snapshot, what, [fault for fault in met if fault not in standing_on])
            self._refuse_astray(snapshot, guard)
            if not alone and self._heartbeat is not None and self._heartbeat.silent is not None:
                alone = (self._heartbeat.silent,)
                deadline = min(deadline, self._end_unguarded(self._heartbeat, alone[0], in_cut=watch is not None))
            self._poller.watch_constants()
            if watch is not None:
                watch(snapshot)
            if done(snapshot):
                if self._heartbeat is not None:
                    self._heartbeat.ended()
                if alone:
                    raise DriverError(*alone)
                return snapshot
            if self._clock.now_s() > deadline:
                self._stop.stop(f"{what}: {timeout_s:g} s")
                raise DriverError(*alone, Problem(code="machine.timeout", key=what, value=f"{timeout_s:g} s"))

    def _refuse_faults(self, before: Snapshot | None, snapshot: Snapshot, what: str, faults: list[str]) -> None:
        """Stop on a fault; a safety device that has ended the motion itself is reported first.

        Raises:
            DriverError: `safety.not_good`, `machine.fault`, `machine.left_behind`, `machine.tool_left_behind`.
        """
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

        Raises:
            StoppedError: the machine was stopped meanwhile.
            DriverError: `machine.loop_open`, those of the guard, `controller.constant_differs` of the program.
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

        Raises:
            DriverError: the problem; what moved is stopped.
        """
        if not in_cut or heartbeat.policy is Policy.STOP:
            self._stop.stop(problem.code)
            raise DriverError(problem)
        if heartbeat.policy is Policy.RETRACT:
            self._hold()
        return self._clock.now_s() + heartbeat.ends_within_s + WAY_HOME_S

    def _next_look(
        self, deadline: float, watch: Callable[[Snapshot], None] | None, homed: frozenset[AxisName]
    ) -> Snapshot:
        """Let time pass with the watchdog renewed, then poll; `homed` are the axes that must have kept their zero.

        Raises:
            DriverError: `heartbeat.lapsed`, the controller ended the motion; `controller.was_reset`;
                `owner.ousted`, the machine is no longer ours.
            StoppedError: somebody stopped the machine.
        """
        try:
            self._pause(JOG_POLL_S if watch is None else CUT_POLL_S)
            self._stop.check()
            snapshot = self._poller.look()
            self._refuse_reset(homed, snapshot)
            if snapshot.lost and self._heartbeat is not None and self._heartbeat.guarding:
                raise self._heartbeat.lapse()
        except DriverError as error:
            if error.problems[0].code == LAPSED:
                self._see_it_end(deadline, watch)
            raise
        if self._ownership is not None:
            self._ownership.refuse_ousted()
        return snapshot

    def _refuse_reset(self, homed: frozenset[AxisName], snapshot: Snapshot) -> None:
        """Stop when positions are lost: a controller that was reset has also forgotten its owner.

        Raises:
            DriverError: `controller.was_reset`, `controller.home_lost`.
        """
        problem = reset_problem(homed, snapshot)
        if problem is not None:
            self._stop.stop(problem.code)
            raise DriverError(problem)

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
            if self._ownership is not None and self._ownership.standing is Standing.OUSTED:
                return  # what moves now is another console's
            if watch is not None:
                watch(snapshot)
            self._clock.wait(CUT_POLL_S)


def refuse_beyond_travel(machine: MachineProfile, axis: AxisName, motor: int, counts: float) -> None:
    """Refuse a position outside the software limits of an axis, if it has any.

    Raises:
        RefusedError: `machine.beyond_travel`.
    """
    settings, lengths, limit = MotorSettings(machine, motor), Lengths(machine), ""
    high, low = settings.highest_counts, settings.lowest_counts
    if high is not None and counts > high:
        limit = f"<= {lengths.at(axis, high)}"
    if low is not None and counts < low:
        limit = f">= {lengths.at(axis, low)}"
    if limit:
        value = lengths.at(axis, counts)
        raise RefusedError(Problem(code="machine.beyond_travel", key=axis, value=value, limit=limit))
