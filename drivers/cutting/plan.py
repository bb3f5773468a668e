"""Everything known of a cut before anything moves."""

from __future__ import annotations

from dataclasses import dataclass, field

from drivers.cutting.strategy import Made, Strategy
from drivers.pmac.check import CheckedProgram
from drivers.pmac.program_text import ProgramText
from drivers.pmac.programs.setup import CutSetup
from profiles.compensations.path import LobedPath
from profiles.findings import Finding


@dataclass(frozen=True, slots=True, kw_only=True)
class CutPlan(Made):
    """A planned cut, known before anything moves: `command` is what it commands the tool to cut `target`.

    `checked` is the whole motion of the program, move by move, with what a compensation table adds to it and with
    a spindle that is not the program's own. A `trimmed` cut is corrected by the host while it cuts; one `in_air`
    touches no part.
    """

    strategy: Strategy
    target: LobedPath
    command: LobedPath
    setup: CutSetup
    program: ProgramText
    spindle_speed_rpm: float
    segment_ms: float
    duration_s: float
    findings: tuple[Finding, ...]
    checked: CheckedProgram = field(repr=False, compare=False)
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
