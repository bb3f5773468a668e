"""Explain an axis that lagged until its following-error limit opened its loops: by how much, and the likely cause.

Dry friction of the tool is the usual cause. While the tool sticks, its integrator pushes with the friction
force F. On reversal that force and F in the other direction must be overcome, and the loop yields by c F for
each: it lags by 2 c F, with c = 1 / (K Kp) its compliance without the integrator.
"""

from __future__ import annotations

from dataclasses import replace

from drivers.lathe.lengths import motor_of
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.pmac.analysis.units import shown_length
from drivers.pmac.motor_settings import MotorSettings
from profiles.axis.friction import ASSUMED_FRICTION_N
from profiles.axis.servo import tool_compliance_um_per_n
from profiles.machine import MachineProfile
from profiles.problem import Problem

BEHIND = "fatal_following_error"


def left_behind(machine: MachineProfile, before: Snapshot | None, seen: Snapshot) -> tuple[Problem, ...]:
    """Return the following error of each tripped axis; `before` is the poll before the one that saw the trip.

    A controller that opens a loop sets the command to the actual position, so the poll that shows the trip no
    longer shows the error.
    """
    return tuple(
        _of_axis(machine, axis, [each for each in (before, seen) if each is not None])
        for axis in AxisName
        if BEHIND in seen.axis(axis).flags
    )


def _tripping_friction_n(machine: MachineProfile) -> float:
    """Return the dry friction, N, at which the tool trips on reversal after a standstill."""
    steady = replace(machine, tool=replace(machine.tool, gain_ki_v_per_m_s=0.0))
    compliance_um_per_n = abs(complex(tool_compliance_um_per_n(steady, 0.0)))
    limit_um = MotorSettings(machine, machine.tool.motor).error_limit_counts * machine.tool.count_um
    return limit_um / (2.0 * compliance_um_per_n)


def _of_axis(machine: MachineProfile, axis: AxisName, polls: list[Snapshot]) -> Problem:
    motor = motor_of(machine, axis)
    behind = max(abs(poll.axis(axis).following_error) for poll in polls)
    limit = MotorSettings(machine, motor).error_limit_counts
    lengths = [shown_length(machine, motor, counts) for counts in (behind, limit)]
    value, allowed = (f"{length['length']:.3g} {length['unit']}" for length in lengths)
    allowed = f"{allowed} (I{motor}11)"
    if axis is not AxisName.TOOL:
        return Problem(code="machine.left_behind", key=axis, value=value, limit=allowed)
    friction, assumed = f"{_tripping_friction_n(machine):.1f} N", f"{ASSUMED_FRICTION_N:g} N"
    return Problem(code="machine.tool_left_behind", where=friction, key=assumed, value=value, limit=allowed)
