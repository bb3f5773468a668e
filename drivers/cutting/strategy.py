"""The strategies, in the order in which they are offered: each by its name, with its descriptor.

What makes a program is imported when it is made: the command line reads the descriptors.
"""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from typing import TYPE_CHECKING, Self

from drivers.cutting.traits import AngleZero, Traits

if TYPE_CHECKING:
    from drivers.cutting.planned_program import PlannedProgram, Planning
    from profiles.compensations.path import LobedPath
    from profiles.job import Job
    from profiles.machine import MachineProfile


def _hold_from(planning: Planning) -> float:
    """Return from where on a cut may be held: it comes in again some turns before, with the carriage in motion."""
    from drivers.pmac.programs.hold import back_mm
    from drivers.pmac.programs.pvt import out_ms

    job, machine, setup = planning.job, planning.machine, planning.setup
    way_mm = back_mm(job.feed_mm_per_rev, 60_000.0 / job.spindle_speed_rpm, out_ms(setup))
    return setup.carriage_start + way_mm * machine.carriage.counts_per_mm


def _by_pvt(planning: Planning, command: LobedPath) -> PlannedProgram:
    """Make segments of PVT, with the spindle turned by the program."""
    from drivers.cutting.planned_program import PlannedProgram
    from drivers.pmac.programs.pvt import pvt_program

    return PlannedProgram(
        text=pvt_program(planning.job, planning.setup, command),
        tool_start=planning.setup.retracted,
        axis_definitions=planning.machine.controller.axis_definitions,
        hold_from=_hold_from(planning),
    )


def _cam(planning: Planning) -> PlannedProgram:
    """Make a compensation table by the angle of the spindle."""
    from drivers.cutting.planned_program import PlannedProgram
    from drivers.pmac.programs.cam import cam_program, correction_register
    from drivers.pmac.programs.cam_table import make_cam
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


def _timebase(planning: Planning) -> PlannedProgram:
    """Make the segments of `pvt`; in each servo cycle time advances by the spindle's turn in the cycle before."""
    from drivers.cutting.planned_program import PlannedProgram
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


def _paper(planning: Planning) -> PlannedProgram:
    """Make Prog. 1 of Lee and Lee (2001), as printed."""
    from drivers.cutting.planned_program import PlannedProgram
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
