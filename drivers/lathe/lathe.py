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
from drivers.cutting.guarding import ProgramEnd
from drivers.cutting.loading import STOPPED_BY, Loading
from drivers.cutting.sampling import BatchGather
from drivers.errors import ControllerError, DriverError, LinkTimeoutError, RefusedError
from drivers.lathe.commands import Sending
from drivers.lathe.guards import Guard, unguarded
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.jogs import Jogs, band_counts
from drivers.lathe.motion import Motion
from drivers.lathe.ownership import Ownership
from drivers.lathe.polling import LOOK_TIMEOUT_S, Looks
from drivers.lathe.snapshot import AxisName, Snapshot, SnapshotItems, driven_axes
from drivers.lathe.standing import NOBODY, Standing
from drivers.lathe.standstill import REST_S, Settling, prove_rest
from drivers.lathe.stop import StopPath
from drivers.pmac.dialect import DIALECTS, dialect_of
from drivers.pmac.program_text import ProgramText
from drivers.pmac.programs.cam_trim import trim_line
from drivers.pmac.programs.setup import HOLD_FLAG
from profiles.machine import MachineProfile
from profiles.problem import Problem

SPEED_S = 0.5
"""Over how long the speed of a spindle is seen that somebody else turns."""


class Lathe:
    """One machine at the end of one link. Methods that move check the stop first and wait for the end.

    `held` is whether the program that was loaded last was asked to end by itself.
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
        self.held = False
        self._client = client
        self._clock = clock
        self._heartbeat = heartbeat
        self._dialect = DIALECTS[machine.controller.family]
        self._controller = machine.controller
        self._to_restore: tuple[str, ...] = ()
        self._motors = {
            AxisName.TOOL: machine.tool.motor,
            AxisName.SPINDLE: machine.spindle.motor,
            AxisName.CARRIAGE: machine.carriage.motor,
        }
        self._driven = driven_axes(machine)
        items = SnapshotItems(machine, self._dialect)
        self._looks = Looks(client, clock, stop, items, seen=seen, heartbeat=heartbeat, ownership=ownership)
        forgo = heartbeat.forgo if heartbeat is not None else lambda: None
        self._sending = Sending(client, stop, self._looks, ownership, forgo)
        self._motion = Motion(machine, self._looks, stop, clock, heartbeat, ownership, self.hold)
        self._loading = Loading(client, machine, clock)
        self._jogs = Jogs(machine, self._looks, self._motion, stop, self._loading, self._jog)

    @property
    def has_moved(self) -> bool:
        """Whether anything that moves was ever sent."""
        return self._sending.has_moved

    @property
    def round_trip_s(self) -> float:
        """How long the last look took from its request to its reply."""
        return self._looks.round_trip_s

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

    def take_over(self) -> int:
        """Take the machine from whoever controls it, at rest; return the number of that console.

        Raises:
            RefusedError: `owner.moving`, nothing was written.
            LinkError: the link broke.
        """
        if self.ownership is None:
            return NOBODY
        self._jogs.forget()
        return self.ownership.take_over(at_rest=self.snapshot().at_rest)

    def release(self) -> None:
        """Give the machine back; a link that does not take it leaves it to the next one to take over."""
        if self.ownership is not None:
            with suppress(DriverError):
                self.ownership.release()

    def verify(self) -> tuple[Problem, ...]:
        """Compare the controller's settings and axis definitions with the machine profile; nothing is written."""
        problems = differences(self._client, self._controller, self._dialect, self._motors.values())
        self._looks.verified = not problems
        return tuple(problems)

    def snapshot(self) -> Snapshot:
        """Read the state of the machine in one request, and once more when its reply does not come.

        Raises:
            LinkError: the link broke or is out of step.
        """
        return self._looks.look()

    def hands_clear(self) -> None:
        """Take somebody's word that nobody has hands in the machine any more; nothing is sent."""
        self.stop.hands_in = False

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
        if self._heartbeat is not None and not self.stop.hands_in:
            self._heartbeat.prepare()
        self._jogs.forget()
        for axis in self._driven:
            self._sending.once(f"#{self._motors[axis]}J/")
        if not self.snapshot().loops_closed:
            raise DriverError(Problem(code="machine.not_enabled", where=self._client.link.address))

    def switch_off(self) -> None:
        """Open the loops of all axes at rest: drives off. No stop is in force afterwards.

        From now on there may be hands in the machine, and nothing closes a loop before `hands_clear`.

        Raises:
            DriverError: `machine.moving`, nothing was sent; `machine.not_switched_off`, an axis does not open.
        """
        self._sending.refuse_unless_owner()
        self._refuse_moving(self.snapshot())
        self.stop.hands_in = True
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
    def lease(self) -> str:
        """The condition without which a cutting program ends by itself, empty when nobody keeps a lease."""
        return "" if self._heartbeat is None else self._heartbeat.condition

    def load(
        self, program: ProgramText, axis_definitions: tuple[str, ...] = (), restore: tuple[str, ...] = ()
    ) -> None:
        """Send a program, read it back with the constants and tables in front of it, and compare.

        A program that defines axes says which are there from now on, until `put_back` sends the lines `restore`.

        Raises:
            ControllerError: a line was refused.
            DriverError: `controller.program_differs`, `controller.constant_differs`, `controller.table_differs`.
        """
        self.stop.check()
        self._sending.refuse_unless_owner()
        definitions = axis_definitions or self.machine.controller.axis_definitions
        self._controller = replace(self.machine.controller, axis_definitions=definitions)
        self._to_restore = restore
        self._loading.load(program)
        self.held = False

    def put_back(self) -> None:
        """Set the controller as its profile says where loading has changed that, once all rests; else do nothing.

        Raises:
            DriverError: `machine.moving`, nothing was sent; a line was refused, or the link broke.
        """
        if self._to_restore:
            self._sending.refuse_unless_owner()
            self._refuse_moving(self.snapshot())
            self._loading.restore(self._to_restore)
        self._to_restore, self._controller = (), self.machine.controller

    def tables_left(self) -> tuple[Problem, ...]:
        """Return what compensation tables still add to the tool, or would: nothing before a cut, nor behind it.

        Raises:
            DriverError: the link broke, or the controller refused to answer.
        """
        self._sending.refuse_unless_owner()  # a pointer of the console is written for it
        return self._loading.tables_left()

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

    def switch_tables_off(self) -> tuple[Problem, ...]:
        """Switch compensation tables off where they add nothing to the tool, at rest; return what is then left.

        Raises:
            DriverError: `machine.moving`, nothing was sent; the link broke.
        """
        self._sending.refuse_unless_owner()
        self._refuse_moving(self.snapshot())
        self._jogs.forget()
        return self._loading.switch_tables_off()

    def holds(self, program: ProgramText, *, ended: bool = False, tables: bool = True) -> None:
        """Make sure that the controller still holds a program as it was loaded; nothing is written.

        Its lines, the constants in front of it, and, unless without `tables`, every entry of its table. Of one
        that has `ended`, what it changes itself is left out.

        Raises:
            DriverError: `controller.program_differs`, `controller.constant_differs`, `controller.table_differs`;
                the link broke; a program is not there.
        """
        self._loading.verify(program, ended=ended, tables=tables)

    def program_end(self) -> ProgramEnd:
        """Ask how the program that ran last has ended.

        Raises:
            DriverError: the link broke, or the controller refused to answer.
        """
        return self._loading.end()

    def say_stopped(self) -> None:
        """Tell the console that controls the machine who has stopped it; the only word of one that looks on.

        Raises:
            LinkError: the link broke or is out of step.
        """
        if self.ownership is not None:
            self._client.request(f"{STOPPED_BY}={self.ownership.number}", LOOK_TIMEOUT_S)

    def start(self, number: int, retracted_counts: float) -> None:
        """Run a loaded program. This moves the machine; the tool is out of the part at `retracted_counts`."""

        def leased(line: str) -> str:
            # The system is addressed first: behind a value the & would be an operator of it.
            guarded = line if self._heartbeat is None else self._heartbeat.cut(line, retracted_counts)
            return f"&1 {guarded}"

        self._jogs.forget()
        self._leased(f"B{number}R", leased)

    def hold(self) -> None:
        """Ask the program to end at the end of the present turn and to retract; `follow` then sees its end.

        Between two looks, also from the `watch` of `follow`. It moves nothing by itself, so that it may be sent
        after a stop, and twice.

        Raises:
            LinkError: the link broke or is out of step; whether the program was told is unknown.
        """
        self._sending.refuse_unless_owner()
        self.held = True
        line = f"{HOLD_FLAG}=1"
        try:
            self._client.request(line, LOOK_TIMEOUT_S)
        except LinkTimeoutError:
            self._client.request(line, LOOK_TIMEOUT_S)

    def trim(self, trim_um: complex) -> None:
        """Ask a cut that listens for the wave Re(c exp(j lobe angle)) beside its table, c in um; see `cam_trim`.

        Raises:
            StoppedError: somebody stopped the machine; nothing was sent.
            DriverError: the link broke, and whether the cut was told is unknown.
        """
        self.stop.check()
        self._sending.refuse_unless_owner()
        line = trim_line(trim_um, self.machine.tool.count_um)
        try:
            self._client.request(line, LOOK_TIMEOUT_S)
        except LinkTimeoutError:  # twice the same wave is the same wave
            self._client.request(line, LOOK_TIMEOUT_S)

    def batches(self) -> BatchGather:
        """Return the gathering of tool and spindle during a cut, see `drivers.cutting.sampling`; nothing moves."""
        return BatchGather(self._client, self.machine, self._clock, lambda: self.round_trip_s)

    def follow(self, watch: Callable[[Snapshot], None], timeout_s: float, guard: Guard = unguarded) -> Snapshot:
        """Look at the machine until the program has ended and the axes have arrived.

        After `REST_S` it is enough that the tool is commanded to rest and lags by less than its warning limit.
        Meanwhile `guard` judges each look, and the constants of the program are read in turn.

        Raises:
            DriverError: `machine.fault`, `machine.timeout`, `safety.not_good`, `controller.constant_differs`,
                those of the guard and of `Motion.until`; the machine is stopped before it is raised.
                `heartbeat.plc_silent`: it was ended as the policy says.
            StoppedError: somebody stopped the machine.
        """
        settling = Settling(self._driven, band_counts(self.machine, AxisName.TOOL), REST_S)
        self._looks.watched, self._looks.changed = self._loading.watch(), None
        try:
            return self._motion.until(
                lambda seen: not seen.program_running and settling.is_over(seen),
                timeout_s,
                "program",
                watch,
                guard=guard,
            )
        finally:
            self._looks.watched, self._looks.changed = None, None

    def wait_for_rest(self) -> Snapshot:
        """After a stop: repeat it until the controller proves that nothing moves, see `drivers.lathe.standstill`.

        Raises:
            DriverError: `machine.not_at_rest`.
            LinkError: `link.lost`, there is nobody to ask any more.
        """
        return prove_rest(self._looks, self.stop, self._clock, self._end_guard)

    def _refuse_moving(self, snapshot: Snapshot) -> None:
        if snapshot.moving:
            raise RefusedError(Problem(code="machine.moving", where=self._client.link.address))

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
        self._looks.in_doubt()

    def _end_guard(self) -> None:
        """Nothing is to be guarded behind a stop: the card must not take the tool out by itself then.

        A link that does not take it is no reason not to look for rest; the card then does what it was told to do
        without a host.
        """
        if self._heartbeat is not None:
            with suppress(DriverError):
                self._heartbeat.ended(self._looks.patience_s)

    def _jog(self, line: str) -> None:
        self._leased(line, None if self._heartbeat is None else self._heartbeat.jog)

    def _leased(self, line: str, leased: Callable[[str], str] | None) -> None:
        """Send a line that moves; one that was refused, or not sent, leaves no lease behind."""
        try:
            self._sending.move(line, leased)
        except RefusedError:
            if self._heartbeat is not None:
                self._heartbeat.forgo()
            raise
        except ControllerError:
            self._end_guard()  # what stands in front of the order on its line was carried out
            with suppress(DriverError):
                self._looks.look()  # perhaps a loop has opened meanwhile: control-A would close it
            raise

    @property
    def anothers(self) -> bool:
        """Whether this console does not control the machine, and nothing of it moves any more."""
        apart = self.ownership is not None and self.ownership.standing is not Standing.OWNER
        return apart and not (self._heartbeat is not None and self._heartbeat.guarding)
