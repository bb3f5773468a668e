"""The descriptor of a strategy: everything that other modules need to know of one.

No numeric library is imported by the descriptors before a program is made: the command line reads them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from drivers.cutting.planned_program import PlannedProgram, Planning
    from profiles.job import Job
    from profiles.machine import MachineProfile


class AngleZero(Enum):
    """From where a strategy counts the angle of an external spindle that was never homed."""

    SWITCH_ON = auto()
    INDEX = auto()


@dataclass(frozen=True, slots=True, kw_only=True)
class Traits:
    """One strategy: how its program is made, what it requires, and its options.

    `make` returns the program. Without `follows_lobe` the tool keeps its depth. `inverts`: its command is the
    inverse of a response, so it follows any single-lobe path, and can be learned; `late_cycles` are the servo
    cycles by which that path reads the spindle late.

    `by_table`: the command is a compensation table, so it may have any harmonics, and grow along the cut.
    `spindle_time`: the spindle is the time base of its program. `counts_from` is where the angle of an external
    spindle begins; None if the program must turn the spindle itself. `trims`: the host may correct it within
    the cut; `live_trim`: an operator may change gain and phase of its compensation. `takes_ts`: the segment time
    may differ from the printed one.

    `begins_at` is where the spindle begins, in counts from its index; None means at the index.
    """

    make: Callable[[Planning], PlannedProgram]
    follows_lobe: bool = True
    inverts: bool = False
    late_cycles: Callable[[MachineProfile], int] = lambda _: 0
    by_table: bool = False
    spindle_time: bool = False
    counts_from: AngleZero | None = None
    trims: bool = False
    live_trim: bool = False
    takes_ts: bool = False
    begins_at: Callable[[Job, MachineProfile], float] | None = None
