"""The program of a cut on the machine: loaded, compared, started, held, followed to its end, and put back."""

from __future__ import annotations

from collections.abc import Callable

from drivers.cutting.guarding import ProgramEnd
from drivers.cutting.sampling import BatchGather
from drivers.errors import LinkTimeoutError
from drivers.lathe.guards import Guard, unguarded
from drivers.lathe.jogs import band_counts
from drivers.lathe.polling import POLL_TIMEOUT_S
from drivers.lathe.snapshot import AxisName, Snapshot, driven_axes
from drivers.lathe.standstill import REST_S, Settling
from drivers.lathe.wiring import Wiring
from drivers.pmac.program_text import ProgramText
from drivers.pmac.programs.cam_trim import trim_line
from drivers.pmac.programs.setup import END_FLAG
from profiles.problem import Problem


class CutProgram:
    """One machine's program. `held` is whether the one that was loaded last was asked to end by itself.

    `definitions` are the axis definitions of the controller, which a loaded program may have changed.
    """

    def __init__(self, wiring: Wiring, forget_jogs: Callable[[], None]) -> None:
        """`forget_jogs`: something else than a jog is about to move the axes, or to give them another zero."""
        self.held = False
        self.definitions = wiring.machine.controller.axis_definitions
        self._to_restore: tuple[str, ...] = ()
        self._client, self._machine, self._clock, self._stop = (
            wiring.client,
            wiring.machine,
            wiring.clock,
            wiring.stop,
        )
        self._heartbeat, self._poller, self._sending = wiring.heartbeat, wiring.looks, wiring.sending
        self._moves, self._motion, self._loading = wiring.moves, wiring.motion, wiring.loading
        self._forget_jogs = forget_jogs

    @property
    def watchdog(self) -> str:
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
        self._stop.check()
        self._sending.refuse_unless_owner()
        self.definitions = axis_definitions or self._machine.controller.axis_definitions
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
            self._sending.refuse_moving()
            self._loading.restore(self._to_restore)
        self._to_restore, self.definitions = (), self._machine.controller.axis_definitions

    def tables_left(self) -> tuple[Problem, ...]:
        """Return what compensation tables still add to the tool, or would: nothing before a cut, nor behind it.

        Raises:
            DriverError: the link broke, or the controller refused to answer.
        """
        self._sending.refuse_unless_owner()  # a pointer of the console is written for it
        return self._loading.tables_left()

    def switch_tables_off(self) -> tuple[Problem, ...]:
        """Switch compensation tables off where they add nothing to the tool, at rest; return what is then left.

        Raises:
            DriverError: `machine.moving`, nothing was sent; the link broke.
        """
        self._sending.refuse_unless_owner()
        self._sending.refuse_moving()
        self._forget_jogs()
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

    def end(self) -> ProgramEnd:
        """Ask how the program that ran last has ended.

        Raises:
            DriverError: the link broke, or the controller refused to answer.
        """
        return self._loading.end()

    def start(self, number: int, retracted_counts: float) -> None:
        """Run a loaded program. This moves the machine; the tool is out of the part at `retracted_counts`."""

        def guarded(line: str) -> str:
            # The system is addressed first: behind a value the & would be an operator of it.
            guarded = line if self._heartbeat is None else self._heartbeat.cut(line, retracted_counts)
            return f"&1 {guarded}"

        self._forget_jogs()
        self._moves.send(f"B{number}R", guarded)

    def end_after_turn(self) -> None:
        """Ask the program to end at the end of the present turn and to retract; `follow` then sees its end.

        Between two looks, also from the `watch` of `follow`. It moves nothing by itself, so that it may be sent
        after a stop, and twice.

        Raises:
            LinkError: the link broke or is out of step; whether the program was told is unknown.
        """
        self._sending.refuse_unless_owner()
        self.held = True
        line = f"{END_FLAG}=1"
        try:
            self._client.request(line, POLL_TIMEOUT_S)
        except LinkTimeoutError:
            self._client.request(line, POLL_TIMEOUT_S)

    def trim(self, trim_um: complex) -> None:
        """Ask a cut that listens for the wave Re(c exp(j lobe angle)) beside its table, c in um; see `cam_trim`.

        Raises:
            StoppedError: somebody stopped the machine; nothing was sent.
            DriverError: the link broke, and whether the cut was told is unknown.
        """
        self._stop.check()
        self._sending.refuse_unless_owner()
        line = trim_line(trim_um, self._machine.tool.count_um)
        try:
            self._client.request(line, POLL_TIMEOUT_S)
        except LinkTimeoutError:  # twice the same wave is the same wave
            self._client.request(line, POLL_TIMEOUT_S)

    def batches(self) -> BatchGather:
        """Return the gathering of tool and spindle during a cut, see `drivers.cutting.sampling`; nothing moves."""
        return BatchGather(self._client, self._machine, self._clock, lambda: self._poller.round_trip_s)

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
        settling = Settling(driven_axes(self._machine), band_counts(self._machine, AxisName.TOOL), REST_S)
        self._poller.watched, self._poller.changed = self._loading.watch(), None
        try:
            return self._motion.until(
                lambda seen: not seen.program_running and settling.is_over(seen),
                timeout_s,
                "program",
                watch,
                guard=guard,
            )
        finally:
            self._poller.watched, self._poller.changed = None, None
