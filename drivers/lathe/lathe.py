"""The lathe as the console sees it: axes by name, states read back, every wait with a timeout.

The controller is the source of truth: a command counts as done only after it is read back, and nothing
that moves is sent twice.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace

from drivers.clock import Clock
from drivers.commissioning.checked_configuration import stated_settings_of
from drivers.commissioning.comparison import profile_problems, setting_problems
from drivers.controller import Controller
from drivers.cutting.cut_program import STOPPED_BY_ITEM, CutProgram
from drivers.cutting.tables import Tables
from drivers.errors import DriverError, RefusedError
from drivers.lathe.commands import CommandPath, Wiring
from drivers.lathe.console_role import NOBODY, ConsoleRole, Signature
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.held_positions import HeldPositions
from drivers.lathe.jogs import Jogs
from drivers.lathe.lengths import motor_of
from drivers.lathe.motion import MotionWaits
from drivers.lathe.ownership import Ownership, read_signature, sign
from drivers.lathe.polling import POLL_TIMEOUT_S, Poller, SnapshotItems
from drivers.lathe.snapshot import AxisName, Snapshot, driven_axes
from drivers.lathe.standstill import prove_rest, rest_limits
from drivers.lathe.stop import StopPath
from drivers.pmac.dialect import DIALECTS, dialect_of
from drivers.pmac.witness import Witness
from profiles.machine import MachineProfile
from profiles.problem import Problem

JOG_SETTINGS = (13, 14, 15, 19, 20, 21, 22, 23)  # Ix numbers: travel, stop, ramps, speeds of jog and home search
SPEED_S = 0.5  # time over which the speed of an external spindle is measured


class Lathe:
    """One machine at the end of one link. Methods that move check for a stop first and wait for the end.

    `program` is the program of a cut, `witness` what the controller itself sees of it, None without a heartbeat;
    `driven` are the axes that the controller moves. `home`, `jog_to`, `jog_by` and `retract` are those of `Jogs`.
    Every method that queries or sends raises `LinkError` when the link breaks or is out of step.
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
        Raises DriverError: `safety.bad_input`, in the profile.
        """
        self.machine, self.stop, self.ownership, self.driven = machine, stop, ownership, driven_axes(machine)
        self.on_trial: Mapping[str, float] = {}
        self.friction: Callable[[], str] = str  # dry friction identified in the tool, as text; "" if none was
        self._client, self._clock, self._heartbeat = client, clock, heartbeat
        self.witness = None if heartbeat is None else Witness(client, machine)
        self._dialect = DIALECTS[machine.controller.family]
        items, held = SnapshotItems(machine, self._dialect), HeldPositions(machine)
        self._poller = Poller(
            client, clock, stop, items, held, seen=seen, heartbeat=heartbeat, ownership=ownership
        )
        self._sending = CommandPath(client, stop, self._poller, heartbeat, ownership)
        wiring = Wiring(
            client=client,
            machine=machine,
            clock=clock,
            stop=stop,
            heartbeat=heartbeat,
            ownership=ownership,
            poller=self._poller,
            sending=self._sending,
            tables=Tables(client, machine),
        )
        motion = MotionWaits(wiring, lambda: self.program.end_after_turn())
        jogs = Jogs(wiring, motion)
        self.home, self.jog_to, self.jog_by, self.retract = jogs.home, jogs.to, jogs.jog_by, jogs.retract
        self.program = CutProgram(wiring, motion)

    @property
    def has_moved(self) -> bool:
        """Whether a motion command was ever sent."""
        return self._sending.has_moved

    @property
    def poll_line(self) -> str:
        """The line of a status poll."""
        return self._poller.line

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

    def reconnect(self) -> Snapshot:
        """Set up a link that was opened anew, and read the machine and who controls it; return what it does.

        Nothing is claimed, stopped or renewed: what this console had guarded is left to the controller.
        Raises RefusedError: `controller.family_differs`.
        """
        if self._heartbeat is not None:
            self._heartbeat.forgo()
        self._poller.positions.forget()  # the controller may have taken the tool out by itself
        self.connect()
        return self.snapshot()

    @property
    def ends_within_s(self) -> float:
        """How long the controller may take to end a motion that its host no longer guards; 0 if it ends none."""
        return 0.0 if self._heartbeat is None else self._heartbeat.ends_within_s

    def is_ending(self) -> bool:
        """Query whether the controller is ending something that lost its host."""
        return self._heartbeat is not None and self._heartbeat.is_ending()

    def took_out(self) -> bool:
        """Query whether the controller had to retract a tool from the part, against its path."""
        return self._heartbeat is None or self._heartbeat.took_out()

    def claim(self) -> None:
        """Claim control of the machine for this console; without ownership there is nothing to claim.

        Raises RefusedError: `owner.held`, another console has control.
        """
        if self.ownership is not None:
            self.ownership.claim()

    def take_control(self) -> int:
        """Take control of the machine at rest, whoever has it; return the number of the previous owner.

        Raises RefusedError: `owner.moving`, nothing was written.
        """
        if self.ownership is None:
            return NOBODY
        return self.ownership.take_control(at_rest=self.snapshot().at_rest)

    def sign(self, name: str, host: str, minute: int) -> None:
        """Write into the controller who has claimed it; a failure affects nothing, the next poll reports it."""
        if self.ownership is not None and self.ownership.standing is ConsoleRole.OWNER:
            with suppress(DriverError):
                mark = Signature(number=self.ownership.number, name=name, host=host, minute=minute)
                sign(self._client, mark)

    def signed_by(self, holder: int) -> Signature | None:
        """Return who works at the console of this number; None if it has not signed."""
        return read_signature(self._client, holder)

    def release(self) -> None:
        """Release control; if the link fails, the next console has to take control."""
        if self.ownership is not None:
            with suppress(DriverError):
                self.ownership.release()

    @property
    def as_set(self) -> MachineProfile:
        """The machine with the gains on trial, `on_trial` by their names, instead of those of its profile."""
        if not self.on_trial:
            return self.machine
        controller = self.machine.controller
        variables = {**controller.variables, **self.on_trial}
        return replace(self.machine, controller=replace(controller, variables=variables))

    def verify(self) -> tuple[Problem, ...]:
        """Compare the controller's settings and axis definitions with the machine profile; nothing is written.

        Gains on trial are compared with what was applied; nothing is cut with them.
        """
        machine = self.as_set
        controller = replace(machine.controller, axis_definitions=self.program.definitions)
        motors = frozenset(motor_of(machine, axis) for axis in AxisName)
        as_defined = replace(machine, controller=controller)
        problems = profile_problems(self._client, as_defined, self._dialect, motors)
        self._poller.verified = not problems
        return problems

    def refuse_other_jog(self, *axes: AxisName) -> None:
        """Make sure that jogs of these axes are those of the profile: their travel, speeds and ramps are read.

        Raises RefusedError: `controller.setting`.
        """
        motors = [motor_of(self.machine, axis) for axis in axes]
        numbers = {self._dialect.motor_index(motor, number) for motor in motors for number in JOG_SETTINGS}
        stated = stated_settings_of(self.machine, self._dialect)
        problems = setting_problems(self._client, {n: stated[n] for n in stated if n in numbers})
        if problems:
            raise RefusedError(*problems)

    def snapshot(self) -> Snapshot:
        """Read the state of the machine in one request; retry once without a reply."""
        return self._poller.look()

    def begin_witness(self, feed: tuple[float, float]) -> None:
        """Let the witness begin anew, at rest; in its `feed` the carriage is between two places, counts."""
        if self.witness is not None:
            at_counts = self.snapshot().carriage.commanded_position
            self._sending.refuse_unless_owner()
            self.witness.begin(at_counts, *feed)

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
            if self.witness is not None:
                self.witness.prepare()
        for axis in self.driven:
            self._sending.send_once(f"#{motor_of(self.machine, axis)}J/")
        if not self.snapshot().loops_closed:
            raise DriverError(Problem(code="machine.not_enabled", where=self._client.link.address))

    def switch_off(self) -> None:
        """Disable the drives: open the loops of all axes at rest. No stop is in force afterwards.

        From then on somebody may be inside the guard, and no loop is closed before `confirm_nobody_inside`.
        Raises DriverError: `machine.moving`, nothing was sent; `machine.not_switched_off`, an axis does not open.
        """
        self._sending.refuse_unless_owner()
        self._sending.refuse_moving()
        self.stop.inside_guard = True
        self.stop.switch_off()
        if not self.snapshot().loops_open:
            raise DriverError(Problem(code="machine.not_switched_off", where=self._client.link.address))

    def spindle_rpm(self) -> float:
        """Measure the spindle speed over `SPEED_S`; only polls are sent."""
        first = self.snapshot()
        self._clock.wait(SPEED_S)
        last = self.snapshot()
        turns = (last.spindle.position - first.spindle.position) / self.machine.spindle.counts_per_rev
        return 60.0 * turns / (0.5 * (last.asked_s + last.at_s) - 0.5 * (first.asked_s + first.at_s))

    def say_stopped(self) -> None:
        """Tell the controlling console who stopped the machine; the only write that an observer may send."""
        if self.ownership is not None:
            self._client.request(f"{STOPPED_BY_ITEM}={self.ownership.number}", POLL_TIMEOUT_S)

    def wait_for_rest(self) -> Snapshot:
        """Repeat a stop until nothing moves, see `prove_rest`. Raises DriverError: `machine.not_at_rest`."""
        limits = rest_limits(self.machine)
        return prove_rest(self._poller, self.stop, self._clock, limits, self._sending.end_watchdog)

    def acknowledge_loss(self) -> None:
        """Record that the operator has acknowledged what the controller ended without a host."""
        if self._heartbeat is not None:
            self._heartbeat.loss_seen()

    @property
    def find_guard_problem(self) -> Problem | None:
        """Return the fault of the guard of the present motion: `heartbeat.plc_silent`, or None."""
        return None if self._heartbeat is None else self._heartbeat.silent

    def in_doubt(self) -> None:
        """Mark the last known drive state as unreliable: the next stop is a control-K."""
        self._poller.in_doubt()

    @property
    def anothers(self) -> bool:
        """Whether another console controls the machine and nothing moves on behalf of this one."""
        apart = self.ownership is not None and self.ownership.standing is not ConsoleRole.OWNER
        return apart and not (self._heartbeat is not None and self._heartbeat.guarding)
