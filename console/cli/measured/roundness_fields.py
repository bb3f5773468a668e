"""Roundness of a trace for JSON; lengths in um, angles in degrees from the spindle index."""

from __future__ import annotations

from console.cli.measured.measured_trace import MeasuredTrace
from profiles.metrology.circles import ReferenceCircle
from profiles.metrology.harmonics import Harmonic
from profiles.metrology.turns import Turns
from profiles.roundness import RoundnessResult


def trace_fields(measured: MeasuredTrace) -> dict[str, object]:
    """Return all results of a trace."""
    result, header = measured.result, measured.header
    return {
        **roundness_fields(result),
        "harmonics": [_harmonic(h, measured) for h in result.harmonics],
        "circles": [_circle(circle) for circle in result.circles],
        "above_upr": result.above_upr,
        "filter_applied_upr": header.filter_upr,
        "recentred": result.recentred,
        "left_out": result.left_out,
        "phase_known": header.phase_known,
        "jaw_1_deg": measured.jaw_1_deg,
        "mean_diameter_mm": measured.mean_diameter_mm,
        "tool_offset_um": measured.tool_offset_um,
        "turns": None if measured.turns is None else _turns(measured.turns, result),
    }


def roundness_fields(result: RoundnessResult) -> dict[str, object]:
    """Return the roundness fields that all commands share."""
    return {
        "RONt_um": result.ront_um,
        "RONp_um": result.ronp_um,
        "RONv_um": result.ronv_um,
        "RONq_um": result.ronq_um,
        "reference_circle": result.reference_circle,
        "filter_upr": result.filter_upr,
        "state": result.state,
        "eccentricity_um": result.eccentricity_um,
        "points": result.points,
        "harmonics": [
            {"n": h.n, "amplitude_um": h.amplitude_um, "phase_deg": h.phase_deg} for h in result.harmonics
        ],
    }


def _harmonic(wave: Harmonic, measured: MeasuredTrace) -> dict[str, object]:
    fields = {"n": wave.n, "amplitude_um": wave.amplitude_um, "phase_deg": wave.phase_deg}
    return {**fields, "past_jaw_1_deg": measured.past_jaw_1_deg(wave)}


def _circle(circle: ReferenceCircle) -> dict[str, object]:
    return {
        "circle": circle.kind,
        "RONt_um": circle.ront_um,
        "RONp_um": circle.ronp_um,
        "RONv_um": circle.ronv_um,
        "RONq_um": circle.ronq_um,
        "centre_x_um": circle.centre_x_um,
        "centre_y_um": circle.centre_y_um,
        "deviation_um": circle.deviation_um,
        "contacts": [{"angle_deg": contact.angle_deg, "outer": contact.outer} for contact in circle.contacts],
    }


def _turns(turns: Turns, result: RoundnessResult) -> dict[str, object]:
    spread = [{"n": h.n, "sd_um": turns.amplitude_sd_um(h.n)} for h in result.harmonics]
    return {"count": len(turns.each_um), "random_um": turns.random_um, "amplitudes": spread}
