"""What is known of a cut before anything moves."""

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
    """Everything that is known before anything moves. `tool_start` is where the tool stands then, counts.

    `checked` is the whole motion of the program, move by move, with what a compensation table adds to it and with
    a spindle that is not the program's own.

    `axis_definitions` are those of the card from the loading of the program on; `restore` are the lines that make
    the card what the machine profile says, once the cut is over and everything is at rest, however it ended.
    `table` is the compensation table that the program switches on. Before it is loaded, and once it has ended,
    `drivers.cutting.table_state` has nothing to say. After a stop the tool goes out, the carriage to `zero_row_z`
    (counts), and there the table is switched off. A cut that is `trimmed` is moved by the host while it cuts,
    one `in_air` meets no part.
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
        """Where the spindle stands at the start, counts from its index."""
        return self.setup.spindle_start

    @property
    def carriage_start(self) -> float:
        """Where the carriage stands at the start, clear of the part, counts."""
        return self.setup.carriage_start
