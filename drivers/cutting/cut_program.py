"""The program of a cut on the machine: load, verify, start, end early, follow to its end, and restore."""

from __future__ import annotations

import math
from collections.abc import Callable

from drivers.cutting.bounds import REAL_TIME
from drivers.cutting.feed_hold import FeedHold
from drivers.cutting.guarding import ProgramEnd
from drivers.cutting.live_trim import LiveTrim, has_trim
from drivers.cutting.override import FeedOverride
from drivers.cutting.program_reports import ProgramReports
from drivers.cutting.sampling import BatchGather
from drivers.cutting.watch_table import CutWatch, begin_watch, watch_table
from drivers.errors import DriverError, LinkError, LinkTimeoutError, RefusedError
from drivers.lathe.commands import Wiring
from drivers.lathe.guards import Guard, accept_any_state
from drivers.lathe.jogs import band_counts
from drivers.lathe.motion import MotionWaits
from drivers.lathe.polling import POLL_TIMEOUT_S
from drivers.lathe.snapshot import AxisName, Snapshot, driven_axes
from drivers.lathe.standstill import REST_S, STILL_COUNTS, STILL_S, Settling
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.program_load import LoadedProgram, load_program, verify_loaded
from drivers.pmac.program_text import ProgramText
from drivers.pmac.programs.cam_trim import trim_line
from drivers.pmac.programs.setup import END_FLAG, FINISHED, TURNS_CUT
from drivers.pmac.reserved import STOPPED_BY
from profiles.problem import Problem

REPORTED_WITHIN_S = 0.4  # a console that stops the machine reports it shortly after its stop
STOPPED_BY_ITEM = f"P{STOPPED_BY}"


class CutProgram:
    """The program of one machine. `held`: whether the last loaded program was asked to end early.

    `hold` is the feed hold of that program, `override` the override of its spindle and feed, `live_trim` what is
    added to gain and phase of its compensation.

    `definitions` are the axis definitions of the controller, which a loaded program may have changed. Every method
    that queries or sends raises `DriverError` when the link breaks or the controller refuses to answer.
    """

    def __init__(self, wiring: Wiring, motion: MotionWaits) -> None:
        self.held = False
        self.definitions = wiring.machine.controller.axis_definitions
        self._to_restore: tuple[str, ...] = ()
        self._loaded: LoadedProgram | None = None
        self._watch: CutWatch | None = None
        self._client, self._machine, self._clock = wiring.client, wiring.machine, wiring.clock
        self._stop, self._heartbeat, self._poller = wiring.stop, wiring.heartbeat, wiring.poller
        self._sending, self._motion, self._tables = wiring.sending, motion, wiring.tables
        self.hold = FeedHold(wiring.client, wiring.sending)
        self.override = FeedOverride(wiring.client, wiring.sending, wiring.stop)
        self.live_trim = LiveTrim(wiring.client, wiring.sending, wiring.stop)

    @property
    def watchdog(self) -> str:
        """The condition without which a cutting program ends by itself; empty without a watchdog."""
        return "" if self._heartbeat is None else self._heartbeat.condition

    def load(
        self, program: ProgramText, axis_definitions: tuple[str, ...] = (), restore: tuple[str, ...] = ()
    ) -> None:
        """Send a program, read it back with the constants and tables before it, and compare.

        A program that defines axes replaces the definitions until `put_back` sends the lines `restore`.

        Raises:
            ControllerError: a line was refused.
            DriverError: `controller.program_differs`, `controller.constant_differs`, `controller.table_differs`.
        """
        self._stop.check()
        self._sending.refuse_unless_owner()
        self.definitions = axis_definitions or self._machine.controller.axis_definitions
        self._to_restore, self._loaded, self._watch = restore, None, None
        self.hold = FeedHold(self._client, self._sending)
        self._client.request(f"{STOPPED_BY_ITEM}=0")
        self._loaded = load_program(self._client, program, DIALECTS[self._machine.controller.family])
        self.held = False

    def put_back(self) -> None:
        """Restore the controller to its profile where loading has changed it, at rest; otherwise do nothing.

        Raises DriverError: `machine.moving`, nothing was sent; a line was refused, or the link broke.
        """
        if self._to_restore or self.override.commanded != REAL_TIME:
            self._sending.refuse_unless_owner()
            self._sending.refuse_moving()
            self.override.restore()
            for line in self._to_restore:
                self._client.request(line)
        self._to_restore, self.definitions = (), self._machine.controller.axis_definitions

    def tables_left(self) -> tuple[Problem, ...]:
        """Return what tables still add to the tool, or would add; expected empty before and after a cut."""
        self._sending.refuse_unless_owner()  # needs to write a pointer of the console
        return self._tables.find_remaining_tables()

    def switch_tables_off(self) -> tuple[Problem, ...]:
        """Switch off compensation tables that add nothing to the tool, at rest; return the remaining problems.

        Raises DriverError: `machine.moving`, nothing was sent.
        """
        self._sending.refuse_unless_owner()
        self._sending.refuse_moving()
        self._poller.positions.forget()
        return self._tables.switch_off()

    def clear_tables(self) -> tuple[Problem, ...]:
        """Clear what tables add to the tool, whatever it is, on killed drives at rest; return what is left to fix.

        The way out where nobody knows where a table adds nothing: without a home. Nothing moves, and the axes have
        to be homed afterwards.

        Raises DriverError: `tables.drives_enabled`, `tables.homed`, `machine.moving`, nothing was sent; a line was
        refused, or the link broke.
        """
        self._sending.refuse_unless_owner()
        before = self._poller.look()
        if not before.loops_open:
            raise RefusedError(Problem(code="tables.drives_enabled"))
        if before.homed:
            raise RefusedError(Problem(code="tables.homed"))
        self._sending.refuse_moving()
        self._clock.wait(STILL_S)
        if not self._poller.look().still(before, STILL_COUNTS):  # killed axes, and a spindle that coasts
            raise RefusedError(Problem(code="machine.moving"))
        self._poller.positions.forget()
        return self._tables.clear()

    def holds(self, program: ProgramText, *, ended: bool = False, tables: bool = True) -> None:
        """Make sure that the controller still holds a program as it was loaded; nothing is written.

        Compares its lines, the constants before it and, with `tables`, every entry of its table. For a program
        that has `ended`, values that it changes itself are skipped.

        Raises:
            DriverError: `controller.program_differs`, `controller.constant_differs`, when it has `ended`
                `cut.constant_changed`; `controller.table_differs`; a program is missing.
        """
        if self._loaded is None or self._loaded.program is not program:
            where, key = f"PROG {program.number}", "program"
            raise DriverError(Problem(code="controller.program_differs", where=where, key=key))
        verify_loaded(self._client, self._loaded, ended=ended, tables=tables)

    def changes(self) -> tuple[Problem, ...]:
        """Return what the controller no longer holds as loaded, and a trim in the path that nobody asked for.

        Empty where no program is loaded. Nothing is written. A program that was ended anywhere is compared, too.

        Raises LinkError: the link broke.
        """
        if self._loaded is None:
            return ()
        try:
            verify_loaded(self._client, self._loaded, ended=True)
        except LinkError:
            raise
        except DriverError as changed:
            return tuple(changed.problems)
        return self.live_trim.astray() if has_trim(self._loaded.program) else ()

    def end(self) -> ProgramEnd:
        """Query how the last program ended and, if it was stopped, after a moment, by whom."""
        items = (TURNS_CUT, FINISHED, END_FLAG, STOPPED_BY_ITEM)
        turns, finished, hold, by = self._client.numbers(*items, again=True)
        if not finished and not by:
            self._clock.wait(REPORTED_WITHIN_S)
            (by,) = self._client.numbers(STOPPED_BY_ITEM, again=True)
        return ProgramEnd(turns=turns, finished=finished == 1.0, end_asked=hold != 0.0, stopped_by=int(by))

    def start(self, number: int, retracted_counts: float, lobes: int = 1) -> None:
        """Run a loaded program. This moves the machine; at `retracted_counts` the tool is clear of the part.

        `lobes` are those of its path, for a trim.
        """

        def guarded(line: str) -> str:
            # Address the system first: after a value, & would be an operator of the expression.
            guarded = line if self._heartbeat is None else self._heartbeat.cut(line, retracted_counts)
            return f"&1 {guarded}"

        if self._watch is None:
            self.note_settings()
        self._poller.positions.forget()
        self.hold = FeedHold(self._client, self._sending)
        self.live_trim = LiveTrim(self._client, self._sending, self._stop, lobes, running=True)
        self._sending.move(f"B{number}R", guarded)

    def end_after_turn(self) -> None:
        """Ask the program to end after the present turn and to retract; `follow` then sees its end.

        Call it between two polls, also from the `watch` of `follow`. It moves nothing by itself, so it may be
        sent after a stop, and retried. After a `LinkError` it is unknown whether the program received it.
        """
        self._sending.refuse_unless_owner()
        self.held = True
        self._set(f"{END_FLAG}=1")

    def trim(self, trim_um: complex, oval_um: complex | None = None) -> None:
        """Set the trim of a running cut, the harmonic Re(c exp(j lobe angle)), c in um; see `cam_trim`.

        `oval_um` is that of twice a turn, None where it is not changed.

        Raises:
            StoppedError: somebody stopped the machine; nothing was sent.
            DriverError: the link broke, and whether the cut received it is unknown.
        """
        self._stop.check()
        self._sending.refuse_unless_owner()
        self._set(trim_line(trim_um, self._machine.tool.count_um, oval_um))

    def _set(self, line: str) -> None:
        """Send a line that only sets a value, a second time when unanswered: that is harmless."""
        try:
            self._client.request(line, POLL_TIMEOUT_S)
        except LinkTimeoutError:
            self._client.request(line, POLL_TIMEOUT_S)

    def batches(self) -> BatchGather:
        """Return the gatherer of tool and spindle during a cut, see `drivers.cutting.sampling`; nothing moves."""
        return BatchGather(self._client, self._machine, self._clock, lambda: self._poller.round_trip_s)

    def reports(self) -> ProgramReports | None:
        """Return the reader of the reports of the loaded program, None without a program."""
        loaded = self._loaded
        return None if loaded is None else ProgramReports(self._client, self._poller, loaded.program)

    def note_settings(self) -> None:
        """Read what shapes a cut beside its path, and has to stay so; before plan and profile are compared."""
        if self._loaded is not None:
            table = watch_table(self._machine, self._loaded, tables_on=self._tables.are_on())
            self._watch = begin_watch(self._client, table)

    def follow(
        self,
        watch: Callable[[Snapshot], None],
        timeout_s: float,
        guard: Guard = accept_any_state,
        clear_counts: float = -math.inf,
    ) -> Snapshot:
        """Poll the machine until the program has ended and the axes have arrived.

        After `REST_S` it suffices that the tool is commanded to rest and lags by less than its warning limit.
        Meanwhile `guard` judges each poll, and what was noted of the settings is read in turn: all of it once more
        from the end of the feed, when the tool is commanded below `clear_counts`. A feed hold takes its own time:
        the program bounds it.

        Raises:
            DriverError: `machine.fault`, `machine.timeout`, `safety.not_good`, `cut.constant_differs`,
                those of the guard and of `MotionWaits.until`; the machine is stopped before it is raised.
                `heartbeat.plc_silent`: it was ended as the policy says.
            StoppedError: somebody stopped the machine.
        """
        settling = Settling(driven_axes(self._machine), band_counts(self._machine, AxisName.TOOL), REST_S)
        watched = self._poller.watched = self._watch
        self._poller.changed = None

        def over(seen: Snapshot) -> bool:
            if watched is not None:
                watched.see_feed(over=not seen.program_running or seen.tool.commanded_position < clear_counts)
            return not seen.program_running and settling.is_over(seen)

        try:
            last = self._motion.until(
                over, timeout_s, "program", watch, guard=guard, waits=lambda: self.hold.report.active
            )
            self._poller.finish_watch()
            return last
        finally:
            self._poller.watched, self._poller.changed, self._watch = None, None, None
