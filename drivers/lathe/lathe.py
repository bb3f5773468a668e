"""The lathe as the console sees it: axes by name, states read back, every wait with a timeout.

The controller is the source of truth: a command counts as done only after it is read back, and nothing
that moves is sent twice.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

from drivers.clock import Clock
from drivers.commissioning.settings_check import differences
from drivers.controller import Controller
from drivers.cutting.loading import STOPPED_BY
from drivers.errors import DriverError, RefusedError
from drivers.lathe.control_state import NOBODY, Standing
from drivers.lathe.cut_program import CutProgram
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.jogs import Jogs
from drivers.lathe.ownership import Ownership
from drivers.lathe.polling import POLL_TIMEOUT_S
from drivers.lathe.snapshot import AxisName, Snapshot, driven_axes
from drivers.lathe.standstill import prove_rest
from drivers.lathe.stop import StopPath
from drivers.lathe.wiring import wired
from drivers.pmac.dialect import DIALECTS, dialect_of
from profiles.machine import MachineProfile
from profiles.problem import Problem

SPEED_S = 0.5
"""Time over which the speed of an external spindle is measured."""


class Lathe:
    """One machine at the end of one link. Methods that move check for a stop first and wait for the end.

    `program` is the program of a cut.
    """

    def __init__(
        self,
        client: Controller,
        machine: MachineProfile,
        clock: Clock,
        stop: StopPath,
        seen: Callable[[Snapshot], None] | None = None,
        heartbeat: Heartbeat | None = None,
        ownership: Ownership | None = None,
    ) -> None:
        """`seen` is called with each poll, in every wait; it must return at once and not raise.

        With a `heartbeat` nothing moves unless the controller would end it without this host. With an
        `ownership` only polls and stops are sent before `claim`.

        Raises:
            DriverError: `safety.bad_input`, in the profile.
        """
        self.machine = machine
        self.stop = stop
        self.ownership = ownership
        self._client = client
        self._clock = clock
        self._heartbeat = heartbeat
        self._dialect = DIALECTS[machine.controller.family]
        self._motors = {
            AxisName.TOOL: machine.tool.motor,
            AxisName.SPINDLE: machine.spindle.motor,
            AxisName.CARRIAGE: machine.carriage.motor,
        }
        self._driven = driven_axes(machine)
        wiring = wired(
            client, machine, clock, stop, seen, heartbeat, ownership, lambda: self.program.end_after_turn()
        )
        self._poller, self._sending, self._moves = wiring.looks, wiring.sending, wiring.moves
        self._jogs = Jogs(machine, wiring.looks, wiring.motion, stop, wiring.loading, wiring.moves.jog)
        self.program = CutProgram(wiring, self._jogs.forget)

    def _end_cut(self) -> None:
        self.program.end_after_turn()

    @property
    def has_moved(self) -> bool:
        """Whether a motion command was ever sent."""
        return self._sending.has_moved

    @property
    def round_trip_s(self) -> float:
        """Round-trip time of the last poll."""
        return self._poller.round_trip_s

    def connect(self) -> tuple[str, str]:
        """Set up the link; return version and type of the controller.

        Raises:
            LinkError: no answer, or not that of a PMAC.
            RefusedError: `controller.family_differs`, the controller is of another family than in the profile.
        """
        version, kind = self._client.connect()
        if dialect_of(kind) is not self._dialect:
            where, limit = self._client.link.address, self.machine.controller.family
            raise RefusedError(Problem(code="controller.family_differs", where=where, value=kind, limit=limit))
        return version, kind

    def claim(self) -> None:
        """Claim control of the machine for this console; without ownership there is nothing to claim.

        Raises:
            RefusedError: `owner.held`, another console has control.
            LinkError: the link broke.
        """
        self._jogs.forget()
        if self.ownership is not None:
            self.ownership.claim()

    def take_control(self) -> int:
        """Take control of the machine at rest, whoever has it; return the number of the previous owner.

        Raises:
            RefusedError: `owner.moving`, nothing was written.
            LinkError: the link broke.
        """
        if self.ownership is None:
            return NOBODY
        self._jogs.forget()
        return self.ownership.take_control(at_rest=self.snapshot().at_rest)

    def release(self) -> None:
        """Release control; if the link fails, the next console has to take control."""
        if self.ownership is not None:
            with suppress(DriverError):
                self.ownership.release()

    def verify(self) -> tuple[Problem, ...]:
        """Compare the controller's settings and axis definitions with the machine profile; nothing is written."""
        as_defined = replace(self.machine.controller, axis_definitions=self.program.definitions)
        problems = differences(self._client, as_defined, self._dialect, self._motors.values())
        self._poller.verified = not problems
        return tuple(problems)

    def snapshot(self) -> Snapshot:
        """Read the state of the machine in one request; retry once without a reply.

        Raises:
            LinkError: the link broke or is out of step.
        """
        return self._poller.look()

    def confirm_nobody_inside(self) -> None:
        """Record the operator's confirmation that nobody is inside the guard; nothing is sent."""
        self.stop.inside_guard = False

    def enable(self) -> None:
        """Enable the drives: close the loops of all axes where they stand, except a spindle on an inverter.

        Raises:
            RefusedError: `machine.hands_in`, the drives were disabled and the guard is not confirmed clear;
                `heartbeat.*`, nothing would end a motion without this host; `safety.not_good`.
            DriverError: `machine.not_enabled`, an axis does not close.
        """
        self.stop.check()
        self._sending.refuse_unless_owner()
        self._sending.refuse_unsafe()
        if self._heartbeat is not None and not self.stop.inside_guard:
            self._heartbeat.prepare()
        self._jogs.forget()
        for axis in self._driven:
            self._sending.once(f"#{self._motors[axis]}J/")
        if not self.snapshot().loops_closed:
            raise DriverError(Problem(code="machine.not_enabled", where=self._client.link.address))

    def switch_off(self) -> None:
        """Disable the drives: open the loops of all axes at rest. No stop is in force afterwards.

        From then on somebody may be inside the guard, and no loop is closed before `confirm_nobody_inside`.

        Raises:
            DriverError: `machine.moving`, nothing was sent; `machine.not_switched_off`, an axis does not open.
        """
        self._sending.refuse_unless_owner()
        self._sending.refuse_moving()
        self.stop.inside_guard = True
        self.stop.switch_off()
        if not self.snapshot().loops_open:
            raise DriverError(Problem(code="machine.not_switched_off", where=self._client.link.address))

    def home(self, timeout_s: float = 60.0) -> None:
        """Home each axis, see `Jogs.home`."""
        self._jogs.home(timeout_s)

    def jog_to(
        self,
        axis: AxisName,
        counts: float,
        timeout_s: float = 120.0,
        *,
        settle: bool = True,
        held_counts: float = 0.0,
    ) -> None:
        """Jog one axis to a position in counts of its motor, see `Jogs.to`."""
        self._jogs.to(axis, counts, timeout_s, settle=settle, held_counts=held_counts)

    def jog_by(self, axis: AxisName, counts: float, timeout_s: float = 120.0) -> None:
        """Jog one axis by an increment in counts, see `Jogs.by`."""
        self._jogs.by(axis, counts, timeout_s)

    def retract(self, to_counts: float, timeout_s: float = 60.0) -> None:
        """Retract the tool to a position in counts, see `Jogs.retract`."""
        self._jogs.retract(to_counts, timeout_s)

    @property
    def driven(self) -> tuple[AxisName, ...]:
        """The axes that the controller moves."""
        return self._driven

    def spindle_rpm(self) -> float:
        """Measure the spindle speed over `SPEED_S`; only polls are sent.

        Raises:
            LinkError: the link broke or is out of step.
        """
        first = self.snapshot()
        self._clock.wait(SPEED_S)
        last = self.snapshot()
        turns = (last.spindle.position - first.spindle.position) / self.machine.spindle.counts_per_rev
        return 60.0 * turns / (0.5 * (last.asked_s + last.at_s) - 0.5 * (first.asked_s + first.at_s))

    def say_stopped(self) -> None:
        """Tell the controlling console who stopped the machine; the only write that an observer may send.

        Raises:
            LinkError: the link broke or is out of step.
        """
        if self.ownership is not None:
            self._client.request(f"{STOPPED_BY}={self.ownership.number}", POLL_TIMEOUT_S)

    def wait_for_rest(self) -> Snapshot:
        """Repeat a stop until the controller proves that nothing moves, see `drivers.lathe.standstill`.

        Raises:
            DriverError: `machine.not_at_rest`.
            LinkError: `link.lost`, the link is gone.
        """
        return prove_rest(self._poller, self.stop, self._clock, self._moves.end)

    def acknowledge_loss(self) -> None:
        """Record that the operator has acknowledged what the controller ended without a host.

        Raises:
            LinkError: the link broke or is out of step.
        """
        if self._heartbeat is not None:
            self._heartbeat.loss_seen()

    @property
    def unguarded(self) -> Problem | None:
        """Return what is wrong with the guard of the present motion: `heartbeat.plc_silent`, or None."""
        return None if self._heartbeat is None else self._heartbeat.silent

    def in_doubt(self) -> None:
        """Mark the last known drive state as unreliable: the next stop is a control-K."""
        self._poller.in_doubt()

    @property
    def anothers(self) -> bool:
        """Whether another console controls the machine and nothing moves on behalf of this one."""
        apart = self.ownership is not None and self.ownership.standing is not Standing.OWNER
        return apart and not (self._heartbeat is not None and self._heartbeat.guarding)
