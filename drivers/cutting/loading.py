"""The program of a cut on the controller: load, verify, read its end, restore."""

from __future__ import annotations

from collections.abc import Iterable

from drivers.clock import Clock
from drivers.controller import Controller
from drivers.cutting.guarding import ProgramEnd
from drivers.cutting.table_state import SWITCH, correction_counts, switch_off, table_problems
from drivers.errors import DriverError
from drivers.pmac import reserved
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.program_constants import ConstantsWatch
from drivers.pmac.program_load import LoadedProgram, load_program, verify_loaded
from drivers.pmac.program_text import ProgramText
from drivers.pmac.programs.setup import END_FLAG, FINISHED, TURNS_CUT
from profiles.machine import MachineProfile
from profiles.problem import Problem

TOLD_WITHIN_S = 0.4
"""A console that stops the machine reports it shortly after its stop."""

STOPPED_BY = f"P{reserved.STOPPED_BY}"


class Loading:
    """Loads one machine's program. `axis_definitions` are those of the controller once it is loaded."""

    def __init__(self, client: Controller, machine: MachineProfile, clock: Clock) -> None:
        self._client, self._machine, self._clock = client, machine, clock
        self._dialect = DIALECTS[machine.controller.family]
        self._loaded: LoadedProgram | None = None

    def load(self, program: ProgramText) -> None:
        """Send a program, read it back, and compare.

        Raises:
            DriverError: as for `load_program`.
        """
        self._loaded = None
        self._client.request(f"{STOPPED_BY}=0")
        self._loaded = load_program(self._client, program, self._dialect)

    def verify(self, program: ProgramText, *, ended: bool = False, tables: bool = True) -> None:
        """Make sure that the controller still holds a program, with everything loaded with it.

        Raises:
            DriverError: as for `verify_loaded`; `controller.program_differs`, another program was loaded last.
        """
        if self._loaded is None or self._loaded.program is not program:
            where, key = f"PROG {program.number}", "program"
            raise DriverError(Problem(code="controller.program_differs", where=where, key=key))
        verify_loaded(self._client, self._loaded, ended=ended, tables=tables)

    def watch(self) -> ConstantsWatch | None:
        """Return the reader of the loaded program's constants while it runs."""
        return None if self._loaded is None else self._loaded.watch()

    def end(self) -> ProgramEnd:
        """Query how the program ended and, if it was stopped, after a moment, by whom.

        Raises:
            DriverError: the link broke, or the controller refused to answer.
        """
        turns, finished, hold, by = self._client.numbers(TURNS_CUT, FINISHED, END_FLAG, STOPPED_BY, again=True)
        if not finished and not by:
            self._clock.wait(TOLD_WITHIN_S)
            (by,) = self._client.numbers(STOPPED_BY, again=True)
        return ProgramEnd(turns=turns, finished=finished == 1.0, end_asked=hold != 0.0, stopped_by=int(by))

    def tables_on(self) -> bool:
        """Query whether compensation tables are on: they then move with their source."""
        return self._client.numbers(SWITCH, again=True)[0] != 0.0

    def tables_left(self) -> tuple[Problem, ...]:
        """Return what compensation tables still add to the tool, or would add."""
        return table_problems(self._client, self._machine, self._dialect)

    def correction_counts(self) -> float:
        """Return what a table adds to the tool now."""
        return correction_counts(self._client, self._machine, self._dialect)

    def switch_tables_off(self) -> tuple[Problem, ...]:
        """Switch off compensation tables that add nothing to the tool; return what is left to fix."""
        return switch_off(self._client, self._machine, self._dialect)

    def restore(self, lines: Iterable[str]) -> None:
        """Send the lines that restore the controller to the machine profile.

        Raises:
            DriverError: a line was refused, or the link broke.
        """
        for line in lines:
            self._client.request(line)
