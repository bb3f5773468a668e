"""The lathe as the console sees it: axes by name, states read back, every wait bounded.

The controller is the source of truth: what is commanded is read back before it counts as done, and nothing
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
"""Over how long the speed of a spindle is seen that somebody else turns."""


class Lathe:
    """One machine at the end of one link. Methods that move check the stop first and wait for the end.

    `program` is that of a cut.
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
        """`seen` is given every look that was read, in whatever wait; it must return at once and not raise.

        With a `heartbeat` nothing moves unless the card would end it without this host. With an `ownership`
        nothing but looks and stops goes out before `claim`.

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
        """Whether anything that moves was ever sent."""
        return self._sending.has_moved

    @property
    def round_trip_s(self) -> float:
        """How long the last look took from its request to its reply."""
        return self._poller.round_trip_s

    def connect(self) -> tuple[str, str]:
        """Set the link up; return version and type of the controller.

        Raises:
            LinkError: nothing answers, or not like a PMAC.
            RefusedError: `controller.family_differs`, it is a card of another family than the profile says.
        """
        version, kind = self._client.connect()
        if dialect_of(kind) is not self._dialect:
            where, limit = self._client.link.address, self.machine.controller.family
            raise RefusedError(Problem(code="controller.family_differs", where=where, value=kind, limit=limit))
        return version, kind

    def claim(self) -> None:
        """Become the one console that controls the machine; without ownership there is nothing to claim.

        Raises:
            RefusedError: `owner.held`, another one does.
            LinkError: the link broke.
        """
        self._jogs.forget()
        if self.ownership is not None:
            self.ownership.claim()

    def take_control(self) -> int:
        """Take the machine from whoever controls it, at rest; return the number of that console.

        Raises:
            RefusedError: `owner.moving`, nothing was written.
            LinkError: the link broke.
        """
        if self.ownership is None:
            return NOBODY
        self._jogs.forget()
        return self.ownership.take_control(at_rest=self.snapshot().at_rest)

    def release(self) -> None:
        """Give the machine back; a link that does not take it leaves it to the next one to take over."""
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
        """Read the state of the machine in one request, and once more when its reply does not come.

        Raises:
            LinkError: the link broke or is out of step.
        """
        return self._poller.look()

    def confirm_nobody_inside(self) -> None:
        """Take somebody's word that nobody has hands in the machine any more; nothing is sent."""
        self.stop.inside_guard = False

    def enable(self) -> None:
        """Close the loops of all axes where they stand; a spindle on an inverter is none of them.

        Raises:
            RefusedError: `machine.hands_in`, the drives were switched off and nobody has said that it is clear;
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
        """Open the loops of all axes at rest: drives off. No stop is in force afterwards.

        From now on there may be hands in the machine, and nothing closes a loop before `confirm_nobody_inside`.

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
        """Search the zero of each axis, see `Jogs.home`."""
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
        """Jog the tool out to a position in counts, see `Jogs.retract`."""
        self._jogs.retract(to_counts, timeout_s)

    @property
    def driven(self) -> tuple[AxisName, ...]:
        """The axes that the controller moves."""
        return self._driven

    def spindle_rpm(self) -> float:
        """Return how fast the spindle turns, seen over `SPEED_S`; nothing is sent but looks.

        Raises:
            LinkError: the link broke or is out of step.
        """
        first = self.snapshot()
        self._clock.wait(SPEED_S)
        last = self.snapshot()
        turns = (last.spindle.position - first.spindle.position) / self.machine.spindle.counts_per_rev
        return 60.0 * turns / (0.5 * (last.asked_s + last.at_s) - 0.5 * (first.asked_s + first.at_s))

    def say_stopped(self) -> None:
        """Tell the console that controls the machine who has stopped it; the only word of one that looks on.

        Raises:
            LinkError: the link broke or is out of step.
        """
        if self.ownership is not None:
            self._client.request(f"{STOPPED_BY}={self.ownership.number}", POLL_TIMEOUT_S)

    def wait_for_rest(self) -> Snapshot:
        """After a stop: repeat it until the controller proves that nothing moves, see `drivers.lathe.standstill`.

        Raises:
            DriverError: `machine.not_at_rest`.
            LinkError: `link.lost`, there is nobody to ask any more.
        """
        return prove_rest(self._poller, self.stop, self._clock, self._moves.end)

    def acknowledge_loss(self) -> None:
        """Take the operator's word that what the card has ended without a host was seen.

        Raises:
            LinkError: the link broke or is out of step.
        """
        if self._heartbeat is not None:
            self._heartbeat.loss_seen()

    @property
    def unguarded(self) -> Problem | None:
        """What is wrong with the guard of what moves now: `heartbeat.plc_silent`, None where nothing is."""
        return None if self._heartbeat is None else self._heartbeat.silent

    def in_doubt(self) -> None:
        """Whatever was seen of the drives is not to be relied on any more: the next stop is a control-K."""
        self._poller.in_doubt()

    @property
    def anothers(self) -> bool:
        """Whether this console does not control the machine, and nothing of it moves any more."""
        apart = self.ownership is not None and self.ownership.standing is not Standing.OWNER
        return apart and not (self._heartbeat is not None and self._heartbeat.guarding)
