"""Input and output of a strategy when a cut is planned.

Kept apart from the descriptors, which are read at every start: this is needed only once a program is made.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from drivers.pmac.compensation.table import CompensationTable
    from drivers.pmac.dialect import Dialect
    from drivers.pmac.programs.setup import CutSetup
    from drivers.pmac.programs.timebase import SpindleClock
    from profiles.compensations.path import LobedPath
    from profiles.job import Job
    from profiles.machine import MachineProfile


@dataclass(frozen=True, slots=True, kw_only=True)
class Planning:
    """The input of planning: a job on a machine, the position of the cut, and the target path of the part.

    `command` is the tool command: the inverse of `target` where the strategy inverts the servo, else `target`
    itself. `ts_ms` is the requested TS, in whole ms. A `trimmed` cut accepts corrections from the host while it
    cuts.
    """

    job: Job
    machine: MachineProfile
    dialect: Dialect
    setup: CutSetup
    target: LobedPath
    command: LobedPath
    ts_ms: int | None = None
    trimmed: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedProgram:
    """The output of a strategy: the program, and where the tool is before it, counts.

    `axis_definitions` are those of the controller once the program is loaded; `restore` are the lines that
    restore the machine profile's settings once the cut is over, however it ended, and everything is at rest.
    `table` is the compensation table that the program switches on. Before it is loaded, and once it has ended,
    `Tables.left` finds nothing. After a stop the tool retracts, the carriage moves to `zero_row_z`
    (counts), and the table is switched off there. `clock` is the spindle where it is the program's time base.
    `hold_from` is where the carriage (counts) has room behind it to come back from a feed hold, None where the
    tool would not come in again at the same angle and place.
    """

    text: str
    tool_start: float
    axis_definitions: tuple[str, ...]
    restore: tuple[str, ...] = ()
    table: CompensationTable | None = field(default=None, repr=False)
    correction_register: str = ""
    zero_row_z: float | None = None
    clock: SpindleClock | None = None
    hold_from: float | None = None

    @property
    def holds(self) -> bool:
        """Whether a feed hold brings the tool back in at the same angle and place."""
        return self.hold_from is not None
