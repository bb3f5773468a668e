"""Readings of the alignment: jaw 1 and the touch-off, each in two ways. Nothing moves.

Run in the link thread. A position is that of the controller at the moment of the command.
"""

from __future__ import annotations

import math
from dataclasses import replace

from console.session.cut.alignment import TouchOff, jaw_found, touched_off, without_reading
from console.session.cut.jaw_by_indicator import mean_deg, reading_problem, results_deg, spread_deg, spread_problem
from console.session.errors import SessionError, refuse, require
from console.session.station import commands, jogging
from console.session.station.context import StationContext
from drivers.lathe.snapshot import AxisName, Snapshot
from profiles.fingerprint.readings import readings_problem
from profiles.fingerprint.this_clamping import evaluate_readings
from profiles.machine import ToolAxis
from profiles.problem import Problem, ProfileError


def take_flank(context: StationContext, _: commands.TakeFlank) -> None:
    """Record a flank of jaw 1 at the present spindle position."""
    angle_deg, alignment = _angle_deg(context, _wait_for_standstill(context)), context.state.alignment
    problem = reading_problem(alignment.flanks, angle_deg, _jaws(context))
    refuse(() if problem is None else (problem,))
    context.tell(alignment=replace(alignment, flanks=(*alignment.flanks, angle_deg)))


def take_jaw(context: StationContext, command: commands.TakeJaw) -> None:
    """Record jaw 1: by the readings of its flanks with their spread, or at the present spindle position."""
    snapshot, alignment = _wait_for_standstill(context), context.state.alignment
    angle_deg, spread = _angle_deg(context, snapshot), None
    if alignment.flanks:
        problem = spread_problem(alignment.flanks, command.most_spread_deg)
        refuse(() if problem is None else (problem,))
        results = results_deg(alignment.flanks)
        angle_deg, spread = mean_deg(results), spread_deg(results)
    found = jaw_found(alignment, angle_deg, _jaws(context), context.local_time(), spread)
    context.tell(alignment=found)


def note_skim(context: StationContext, _: commands.NoteSkim) -> None:
    """Record where the tool made a skim cut; it may be moved away to measure the diameter."""
    snapshot = _wait_for_standstill(context)
    _refuse_beside_part(context, snapshot)
    context.tell(alignment=replace(context.state.alignment, skim_counts=snapshot.tool.position))


def take_touch_off(context: StationContext, command: commands.TakeTouchOff) -> None:
    """Record the touch-off: the tip is at this radius, at its present position or where it made the skim cut."""
    snapshot = _wait_for_standstill(context)
    nominal, alignment = context.loaded_machine.machine, context.state.alignment
    tool, clamping, at_counts = nominal.tool, alignment.clamping, snapshot.tool.position
    if command.skimmed:
        require(alignment.skim_counts is not None, "alignment.no_skim")
        at_counts = alignment.skim_counts or 0.0
    else:
        _refuse_beside_part(context, snapshot)
    if clamping is None:
        raise SessionError(Problem(code="alignment.beside_part", key="tool"))
    zero_mm = command.radius_mm + at_counts / tool.counts_per_mm
    refuse_far(zero_mm, tool)
    stamp = TouchOff(
        zero_radius_mm=zero_mm,
        diameter_mm=clamping.diameter_mm,
        at=context.local_time(),
        on=alignment.on,
        skimmed=command.skimmed,
    )
    context.tell(alignment=touched_off(alignment, stamp))


def refuse_far(zero_mm: float, tool: ToolAxis) -> None:
    """Refuse (`alignment.touch_off_far`) a tip that is not about where the profile has it."""
    if abs(zero_mm - tool.home_radius_mm) > jogging.TOUCH_OFF_BAND_MM:
        value = f"R {zero_mm:.3f} mm"
        limit = f"R {tool.home_radius_mm:.3f} ± {jogging.TOUCH_OFF_BAND_MM:g} mm"
        raise SessionError(Problem(code="alignment.touch_off_far", key="tool", value=value, limit=limit))


def indicate(context: StationContext, command: commands.Indicate) -> None:
    """Read the indicator on the clamped part of the simulated lathe; `session.not_simulated`."""
    require(context.state.alignment.clamping is not None, "alignment.no_clamping")
    if context.shop is None:
        raise SessionError(Problem(code="session.not_simulated"))
    context.tell(indicated=context.shop.indicate(command.places))


def take_fingerprint(context: StationContext, command: commands.TakeFingerprint) -> None:
    """Record the readings of an indicator on the clamped blank, if they show its lobe; or drop them."""
    alignment = context.state.alignment
    require(alignment.clamping is not None, "alignment.no_clamping")
    if command.readings is not None:
        few = readings_problem(command.readings)
        refuse(() if few is None else (few,))
        try:
            evaluate_readings(command.readings, command.job)
        except ProfileError as refused:
            raise SessionError(*refused.problems) from refused
    context.tell(alignment=replace(alignment, readings=command.readings))


def forget(context: StationContext, _: commands.Forget) -> None:
    """Forget one reading, the newest."""
    context.tell(alignment=without_reading(context.state.alignment))


def _wait_for_standstill(context: StationContext) -> Snapshot:
    context.refuse_unless_homed()
    snapshot = context.lathe.snapshot()
    require(snapshot.at_rest, "machine.moving")
    return snapshot


def _angle_deg(context: StationContext, snapshot: Snapshot) -> float:
    counts_per_deg = jogging.counts_per_unit(context.machine, AxisName.SPINDLE)
    return math.fmod(snapshot.spindle.position / counts_per_deg, 360.0) % 360.0


def _jaws(context: StationContext) -> int:
    clamping = context.state.alignment.clamping
    return context.machine.chuck.jaws if clamping is None else clamping.jaws


def _refuse_beside_part(context: StationContext, snapshot: Snapshot) -> None:
    clamping = context.state.alignment.clamping
    if clamping is None or not jogging.over_part(snapshot, context.loaded_machine.machine, clamping.overhang_mm):
        raise SessionError(Problem(code="alignment.beside_part", key="tool"))
