"""The strategies in the order in which they are offered: the descriptor of each, and what it makes of a plan.

A descriptor has everything that other modules need to know of a strategy. The command line reads all descriptors
at every start, so whatever makes a program (and the numeric libraries) is imported when the program is made.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum, StrEnum, auto
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from drivers.pmac.compensation.table import CompensationTable
    from drivers.pmac.dialect import Dialect
    from drivers.pmac.programs.setup import CutSetup
    from drivers.pmac.programs.timebase import SpindleClock
    from profiles.compensations.path import LobedPath
    from profiles.job import Job
    from profiles.machine import MachineProfile


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanningInput:
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


def _hold_from(planning: PlanningInput) -> float:
    """Return from where on a cut may be held: it comes in again some turns before, with the carriage in motion."""
    from drivers.pmac.programs.hold import back_mm
    from drivers.pmac.programs.pvt import out_ms

    job, machine, setup = planning.job, planning.machine, planning.setup
    way_mm = back_mm(job.feed_mm_per_rev, 60_000.0 / job.spindle_speed_rpm, out_ms(setup))
    return setup.carriage_start + way_mm * machine.carriage.counts_per_mm


def _by_pvt(planning: PlanningInput, command: LobedPath) -> PlannedProgram:
    """Make segments of PVT, with the spindle turned by the program."""
    from drivers.pmac.programs.pvt import pvt_program

    return PlannedProgram(
        text=pvt_program(planning.job, planning.setup, command),
        tool_start=planning.setup.retracted,
        axis_definitions=planning.machine.controller.axis_definitions,
        hold_from=_hold_from(planning),
    )


def _cam(planning: PlanningInput) -> PlannedProgram:
    """Make a compensation table by the angle of the spindle."""
    from drivers.pmac.programs.cam import cam_program, correction_register, make_cam
    from drivers.pmac.programs.setup import SERVO

    job, machine, setup = planning.job, planning.machine, planning.setup
    cam = make_cam(machine, setup, planning.command)
    return PlannedProgram(
        text=cam_program(job, machine, setup, cam, planning.dialect, trimmed=planning.trimmed),
        tool_start=setup.retracted,
        axis_definitions=machine.controller.axis_definitions,
        table=cam.table,
        correction_register=correction_register(machine),
        zero_row_z=cam.zero_z,
        # Without the spindle among its axes the program does not know at which angle the tool comes in again.
        hold_from=_hold_from(planning) if machine.spindle.drive == SERVO and not planning.trimmed else None,
    )


def _timebase(planning: PlanningInput) -> PlannedProgram:
    """Make the segments of `pvt`; in each servo cycle time advances by the spindle's turn in the cycle before."""
    from drivers.pmac.programs import timebase

    job, machine, setup, dialect = planning.job, planning.machine, planning.setup, planning.dialect
    definitions, _ = timebase.released_definitions(machine)
    return PlannedProgram(
        text=timebase.timebase_program(job, machine, setup, planning.command, dialect),
        tool_start=setup.retracted,
        axis_definitions=definitions,
        restore=timebase.restoring_lines(machine, dialect),
        clock=timebase.spindle_clock(job, machine, dialect),
        hold_from=_hold_from(planning),
    )


def _paper(planning: PlanningInput) -> PlannedProgram:
    """Make Prog. 1 of Lee and Lee (2001), as printed."""
    from drivers.pmac.programs.paper import DEFAULT_TS_MS, paper_program
    from drivers.pmac.programs.setup import refuse_endless

    job, machine, setup = planning.job, planning.machine, planning.setup
    refuse_endless(2 * job.jaws * setup.turns)
    text = paper_program(job, machine, setup, DEFAULT_TS_MS if planning.ts_ms is None else planning.ts_ms)
    return PlannedProgram(
        text=text, tool_start=setup.surface, axis_definitions=machine.controller.axis_definitions
    )


def _paper_begins_at(job: Job, machine: MachineProfile) -> float:
    from drivers.pmac.programs.paper import spindle_start_counts

    return spindle_start_counts(job, machine)


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

    make: Callable[[PlanningInput], PlannedProgram]
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


class Strategy(StrEnum):
    """How the tool is synchronised with the spindle: its name, with its descriptor as `traits`.

    Names are never compared: whatever depends on the strategy is a field of the descriptor.
    """

    traits: Traits

    # Strategies are looked up by value alone.
    def __new__(cls, name: str, traits: Traits | None = None) -> Self:
        """Make a member from its name and its descriptor."""
        assert traits is not None
        member = str.__new__(cls, name)
        member._value_ = name
        member.traits = traits
        return member

    PVT = "pvt", Traits(make=lambda planning: _by_pvt(planning, planning.command), inverts=True, live_trim=True)
    """The inverted sinusoid in PVT segments."""

    CAM = (
        "cam",
        Traits(
            make=_cam,
            inverts=True,
            # The controller serves its motors in numerical order.
            late_cycles=lambda machine: int(machine.spindle.motor > machine.tool.motor),
            by_table=True,
            counts_from=AngleZero.SWITCH_ON,
            trims=True,
        ),
    )
    """The inverted sinusoid in a compensation table."""

    TIMEBASE = (
        "timebase",
        Traits(
            make=_timebase,
            inverts=True,
            late_cycles=lambda _: 1,  # a time base counts the last completed servo cycle
            spindle_time=True,
            counts_from=AngleZero.INDEX,
            live_trim=True,
        ),
    )
    """The segments of `pvt` in a program whose time base is the spindle."""

    PAPER = "paper", Traits(make=_paper, takes_ts=True, begins_at=_paper_begins_at)
    """The printed program."""

    NONE = (
        "none",
        Traits(
            make=lambda planning: _by_pvt(planning, replace(planning.target, amplitude_um=0.0)), follows_lobe=False
        ),
    )
    """The tool keeps its depth, so the lobe stays on the part."""


DEFAULT_STRATEGY = Strategy.PVT
UNCOMPENSATED = Strategy.NONE  # the reference cut, to show the benefit of a compensation

INVERTING = tuple(each for each in Strategy if each.traits.inverts)  # follow the path that they are given
BY_TABLE = tuple(each for each in Strategy if each.traits.by_table)
TURNED_BY_OTHERS = tuple(each for each in Strategy if each.traits.counts_from is not None)  # the spindle
TAKING_TS = tuple(each for each in Strategy if each.traits.takes_ts)
TRIMMED = tuple(each for each in Strategy if each.traits.trims)  # may be corrected by the host within the cut
