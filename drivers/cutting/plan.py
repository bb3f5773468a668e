"""Everything known of a cut before anything moves."""

from __future__ import annotations

from dataclasses import dataclass, field

from drivers.cutting.strategy import Strategy
from drivers.pmac.check import CheckedProgram
from drivers.pmac.compensation.table import CompensationTable
from drivers.pmac.program_text import ProgramText
from drivers.pmac.programs.setup import CutSetup
from profiles.compensations.path import LobedPath
from profiles.findings import Finding


@dataclass(frozen=True, slots=True, kw_only=True)
class CutPlan:
    """A planned cut, known before anything moves. `tool_start` is where the tool is then, counts.

    `checked` is the whole motion of the program, move by move, with what a compensation table adds to it and with
    a spindle that is not the program's own.

    `axis_definitions` are those of the controller once the program is loaded; `restore` are the lines that
    restore the machine profile's settings once the cut is over, however it ended, and everything is at rest.
    `table` is the compensation table that the program switches on. Before it is loaded, and once it has ended,
    `Loading.tables_left` finds nothing. After a stop the tool retracts, the carriage moves to
    `zero_row_z` (counts), and the table is switched off there. A `trimmed` cut is corrected by the host while
    it cuts; one `in_air` touches no part.
    """

    strategy: Strategy
    target: LobedPath
    setup: CutSetup
    text: str
    program: ProgramText
    tool_start: float
    spindle_speed_rpm: float
    segment_ms: float
    duration_s: float
    findings: tuple[Finding, ...]
    checked: CheckedProgram = field(repr=False, compare=False)
    axis_definitions: tuple[str, ...] = ()
    restore: tuple[str, ...] = ()
    table: CompensationTable | None = field(default=None, repr=False)
    correction_register: str = ""
    zero_row_z: float | None = None
    trimmed: bool = False
    in_air: bool = False

    @property
    def spindle_start(self) -> float:
        """The spindle position at the start, counts from its index."""
        return self.setup.spindle_start

    @property
    def carriage_start(self) -> float:
        """The carriage position at the start, clear of the part, counts."""
        return self.setup.carriage_start
