"""`cam`: the inverted sinusoid in a compensation table by the angle of the spindle."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.cutting.strategies.traits import AngleZero, Made, Planning, Traits

if TYPE_CHECKING:
    from profiles.machine import MachineProfile


def _made(planning: Planning) -> Made:
    from drivers.pmac.programs.cam import cam_program, correction_register
    from drivers.pmac.programs.cam_table import make_cam

    job, machine, setup = planning.job, planning.machine, planning.setup
    cam = make_cam(machine, setup, planning.command)
    return Made(
        text=cam_program(job, machine, setup, cam, planning.dialect, trimmed=planning.trimmed),
        tool_start=setup.retracted,
        definitions=machine.controller.axis_definitions,
        table=cam.table,
        correction_register=correction_register(machine),
        zero_row_z=cam.zero_z,
    )


def _late_cycles(machine: MachineProfile) -> int:
    """Return the delay: the controller serves its motors in numerical order."""
    return int(machine.spindle.motor > machine.tool.motor)


TRAITS = Traits(
    make=_made,
    inverts=True,
    late_cycles=_late_cycles,
    by_table=True,
    counts_from=AngleZero.SWITCH_ON,
    trims=True,
)
