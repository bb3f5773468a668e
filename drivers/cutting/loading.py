"""The program of a cut on the controller, and what compensation tables add to the tool.

I51 = 0 leaves the last correction in the register, and it stays added. So tables are switched off only where
they add nothing, after a check of the register.
"""

from __future__ import annotations

from collections.abc import Iterable

from drivers.clock import Clock
from drivers.controller import Controller
from drivers.cutting.guarding import ProgramEnd
from drivers.errors import DriverError
from drivers.pmac import reserved
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.language.text import format_number
from drivers.pmac.program_constants import ConstantsWatch
from drivers.pmac.program_load import LoadedProgram, load_program, verify_loaded
from drivers.pmac.program_text import ProgramText
from drivers.pmac.programs.cam import correction_register, register_definition
from drivers.pmac.programs.setup import END_FLAG, FINISHED, TURNS_CUT
from profiles.machine import MachineProfile
from profiles.problem import Problem

REPORTED_WITHIN_S = 0.4  # a console that stops the machine reports it shortly after its stop
STOPPED_BY = f"P{reserved.STOPPED_BY}"
TABLES_SWITCH = "I51"
REGISTER_PARTS = 32  # the register holds 1/(Ix08 x 32) count


class Loading:
    """Loads one machine's program.

    Every method raises `DriverError` when the link breaks or the controller refuses a line.
    """

    def __init__(self, client: Controller, machine: MachineProfile, clock: Clock) -> None:
        self._client, self._machine, self._clock = client, machine, clock
        self._dialect = DIALECTS[machine.controller.family]
        self._register = correction_register(machine)
        self._loaded: LoadedProgram | None = None

    def load(self, program: ProgramText) -> None:
        """Send a program, read it back, and compare; errors as for `load_program`."""
        self._loaded = None
        self._client.request(f"{STOPPED_BY}=0")
        self._loaded = load_program(self._client, program, self._dialect)

    def verify(self, program: ProgramText, *, ended: bool = False, tables: bool = True) -> None:
        """Make sure that the controller still holds a program, with everything loaded with it.

        Raises DriverError: as for `verify_loaded`; `controller.program_differs`, another program was loaded last.
        """
        if self._loaded is None or self._loaded.program is not program:
            where, key = f"PROG {program.number}", "program"
            raise DriverError(Problem(code="controller.program_differs", where=where, key=key))
        verify_loaded(self._client, self._loaded, ended=ended, tables=tables)

    def watch(self) -> ConstantsWatch | None:
        """Return the reader of the loaded program's constants while it runs."""
        return None if self._loaded is None else self._loaded.watch()

    def end(self) -> ProgramEnd:
        """Query how the program ended and, if it was stopped, after a moment, by whom."""
        turns, finished, hold, by = self._client.numbers(TURNS_CUT, FINISHED, END_FLAG, STOPPED_BY, again=True)
        if not finished and not by:
            self._clock.wait(REPORTED_WITHIN_S)
            (by,) = self._client.numbers(STOPPED_BY, again=True)
        return ProgramEnd(turns=turns, finished=finished == 1.0, end_asked=hold != 0.0, stopped_by=int(by))

    def restore(self, lines: Iterable[str]) -> None:
        """Send the lines that restore the controller to the machine profile."""
        for line in lines:
            self._client.request(line)

    def tables_on(self) -> bool:
        """Query whether compensation tables are on: they then move with their source."""
        return self._client.numbers(TABLES_SWITCH, again=True)[0] != 0.0

    def tables_left(self) -> tuple[Problem, ...]:
        """Return what prevents a cut from being loaded: tables that are on, or a correction that was left."""
        self._client.request(register_definition(self._machine, self._dialect))
        on, held = self._client.numbers(TABLES_SWITCH, self._register)
        return tuple(
            Problem(code=code, key=key, value=format_number(value), limit="0")
            for code, key, value in (
                ("cut.table_on", TABLES_SWITCH, on),
                ("cut.table_holds", self._register, held),
            )
            if value
        )

    def correction_counts(self) -> float:
        """Return what a table adds to the tool now, counts: its reported position includes that."""
        self._client.request(register_definition(self._machine, self._dialect))
        scale_index = self._dialect.motor_index(self._machine.tool.motor, 8)
        scale, held = self._client.numbers(f"I{scale_index}", self._register)
        return held / (REGISTER_PARTS * scale)

    def switch_tables_off(self) -> tuple[Problem, ...]:
        """Switch tables off if the register reads 0, everything at rest; return what is left to fix."""
        problems = self.tables_left()
        if [problem.code for problem in problems] != ["cut.table_on"]:
            return problems
        self._client.request(f"{TABLES_SWITCH}=0")
        return self.tables_left()
