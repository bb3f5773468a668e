"""Preview as fields for JSON: lengths in um, angles in degrees, nothing rounded."""

from __future__ import annotations

import cmath
import math
from dataclasses import asdict

from console.cli.clamping_fields import span_fields
from console.cli.finding_fields import finding_fields
from console.cli.part.band_reasons import band_reasons
from console.text.catalogue import Catalogue
from drivers.cutting.planning import CutPlan
from drivers.preview.band import predicted_band
from drivers.preview.outlook import grip_share
from drivers.preview.preview import Preview
from profiles.axis.envelope import EnvelopeRow, envelope, speed_limits_rpm
from profiles.lobe.lobe_conditions import lobe_source
from profiles.problem import ProblemError


def preview_fields(seen: Preview, text: Catalogue) -> dict[str, object]:
    """Return the whole preview; fields of one strategy are those of the chosen one."""
    return {
        "job": seen.job.name,
        "machine": seen.machine.name,
        "strategy": seen.strategy.value,
        "lobe_frequency_hz": seen.job.lobe_frequency_hz,
        "predicted_RONt_um": seen.job.lobe_error_um_pp,
        "lobe_error_source": lobe_source(seen.job, chuck=seen.machine.chuck.name, tool=seen.machine.tool.name),
        "predicted": _predicted(seen, text),
        "response": _response(seen),
        "wanted_path": asdict(seen.target),
        "command": asdict(seen.command),
        "trajectory": _trajectory(seen),
        "eq9": {**asdict(seen.eq9), **asdict(seen.eq9_loop), "gain_margin": _finite(seen.eq9_loop.gain_margin)},
        "sampled_loop": asdict(seen.sampled),
        "drive": _drive(seen),
        "margins": _margins(seen),
        "envelope": _envelope(seen),
        "grip_margin_n": seen.grip_margin_n,
        "findings": [finding_fields(f, text) for f in seen.findings],
        "strategies": {name: _strategy(plan, text) for name, plan in seen.strategies.items()},
    }


def _predicted(seen: Preview, text: Catalogue) -> dict[str, object] | None:
    """Return the roundness of the released part without and with the strategy; None where that is refused."""
    band = predicted_band(seen, seen.strategy)
    if band is None:
        return None
    reasons = band_reasons(band, seen.response.source, text)
    because = [{"code": code, "um": um, "text": words} for code, um, words in reasons]
    return {
        "before": {"ront_um": seen.job.lobe_error_um_pp},
        "after": {"ront_um": band.after_um},
        "band": {"low_um": band.low_um, "high_um": band.high_um, "because": because},
    }


def _response(seen: Preview) -> dict[str, object]:
    """Return what the command inverts; a model has no band."""
    response, frequency_hz = seen.response, seen.job.lobe_frequency_hz
    here = response.at(frequency_hz)
    return {
        "source": response.source.value,
        "name": response.name,
        "lowest_hz": response.lowest_hz,
        "highest_hz": _finite(response.highest_hz),
        "gain": abs(here),
        "phase_deg": math.degrees(cmath.phase(here)),
        "relative_95": response.relative_95(frequency_hz),
        "amplitude_um": response.amplitude_um,
    }


def _trajectory(seen: Preview) -> dict[str, list[float]] | None:
    """Return one turn of the steady cut, None where the strategy is refused."""
    made = seen.predictions.get(seen.strategy)
    if made is None:
        return None
    columns = ("angle_deg", "command_um", "path_um", "residual_um")
    return {name: getattr(made, name).tolist() for name in columns}


def _drive(seen: Preview) -> dict[str, float]:
    needs = {**asdict(seen.need), **{key: share.need for key, share in seen.shares.items()}}
    limits = {f"{key}_limit": share.limit for key, share in seen.shares.items()}
    return {**needs, **limits, **{f"{key}_percent": share.percent for key, share in seen.shares.items()}}


def _margins(seen: Preview) -> dict[str, float | str | None]:
    """Return the needs in percent of the limits, including the program's stroke; None is not known.

    Included are the static forces between which the part is held without bending too far.
    """
    made = seen.predictions.get(seen.strategy)
    shares = {**(seen.shares if made is None else made.shares), "grip_n": grip_share(seen.job, seen.machine)}
    percents = {f"{name}_percent": share.percent for name, share in shares.items()}
    return {"voltage_v_percent": None, **percents, **span_fields(seen.job, seen.machine)}


def _envelope(seen: Preview) -> dict[str, object]:
    """Return the axis's speed limits over lobe amplitude, and this job with every limit."""
    found = envelope(seen.job, seen.machine)
    limits = speed_limits_rpm(seen.job, seen.machine, seen.response, found.at_job)
    binding = min(limits, key=limits.__getitem__)
    return {
        "rows": [_row(row) for row in found.rows],
        "at_job": {
            "amplitude_um": found.at_job.amplitude_um,
            "max_rpm": limits,
            "binding": binding,
            "percent": {name: 100.0 * seen.job.spindle_speed_rpm / rpm for name, rpm in limits.items() if rpm},
        },
        "highest_safe_rpm": limits[binding],
        "plain_sine_rpm": found.plain_sine_rpm,
    }


def _row(row: EnvelopeRow) -> dict[str, object]:
    return {"amplitude_um": row.amplitude_um, "max_rpm": row.rpm, "binding": row.binding}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _strategy(plan: CutPlan | ProblemError, text: Catalogue) -> dict[str, object]:
    if isinstance(plan, ProblemError):
        return {"refused": [text.problem(problem) for problem in plan.problems]}
    return {
        "spindle_rpm": plan.spindle_speed_rpm,
        "duration_s": plan.duration_s,
        "findings": [finding_fields(f, text) for f in plan.findings],
    }
