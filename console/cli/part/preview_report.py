"""Preview for people and for JSON: lengths in um, angles in degrees, in JSON not rounded."""

from __future__ import annotations

import cmath
import math
from dataclasses import asdict

from console.cli.judgement import finding_fields, finding_lines, span_fields, span_line
from console.cli.output import harmonics_of
from console.text.catalogue import Catalogue
from console.text.checks import MARKS
from console.text.columns import table
from console.text.job_words import band_reasons, no_force_remedy
from drivers.cutting.planning import CutPlan
from drivers.cutting.strategy import UNCOMPENSATED, Strategy
from drivers.preview.band import Band, predicted_band
from drivers.preview.outlook import grip_demand
from drivers.preview.preview import Preview, Response, surface_left, worst_section
from profiles.axis.envelope import envelope, highest_safe_speed
from profiles.axis.servo import eq9_summary
from profiles.chucking.advice import force_span
from profiles.findings import Severity
from profiles.forecast import LEAST_FORECAST_UM, forecast_um, is_below_forecast
from profiles.lobe.cut_error import middle_mm
from profiles.lobe.lobe_conditions import OTHER_CUT, lobe_source
from profiles.problem import ProblemError


def preview_fields(seen: Preview, text: Catalogue) -> dict[str, object]:
    """Return the whole preview; fields of one strategy are those of the chosen one."""
    made, eq9 = seen.predictions.get(seen.strategy), eq9_summary(seen.machine)
    columns = ("angle_deg", "command_um", "path_um", "residual_um")
    return {
        "job": seen.job.name,
        "machine": seen.machine.name,
        "strategy": seen.strategy.value,
        "lobe_frequency_hz": seen.job.lobe_frequency_hz,
        "predicted_RONt_um": seen.job.lobe_error_um_pp,
        "lobe_error_source": _source(seen),
        "predicted": _predict_roundness(seen, text),
        **_along_cut(seen),
        "response": _response(seen),
        "wanted_path": harmonics_of(seen.target),
        "command": harmonics_of(seen.command),
        "trajectory": None if made is None else {name: getattr(made, name).tolist() for name in columns},
        "eq9": {**asdict(seen.eq9), **asdict(eq9), "gain_margin": _finite(eq9.gain_margin)},
        "sampled_loop": {**asdict(seen.sampled), "bandwidth_hz": seen.bandwidth_hz},
        "drive": _drive(seen),
        "margins": _margins(seen),
        "envelope": _envelope(seen),
        "grip_margin_n": seen.grip_margin_n,
        "findings": [finding_fields(f, text) for f in seen.findings],
        "strategies": {name: _strategy(plan, text) for name, plan in seen.strategies.items()},
    }


def _source(seen: Preview) -> str:
    return lobe_source(seen.job, chuck=seen.machine.chuck.name, tool=seen.machine.tool.name)


def _predict_roundness(seen: Preview, text: Catalogue) -> dict[str, object] | None:
    """Return the roundness of the released part without and with the strategy; None where that is refused.

    `after` and `band` are calculated; `forecast` is what may be said of a part to come.
    """
    band = predicted_band(seen, seen.strategy)
    if band is None:
        return None
    reasons = band_reasons(band, seen.response, text)
    because = [{"code": code, "um": um, "text": words} for code, um, words in reasons]
    return {
        "section_z_mm": middle_mm(seen.job),
        "before": {"ront_um": seen.job.lobe_error_um_pp, **_worst(seen, UNCOMPENSATED)},
        "after": {"ront_um": band.after_um},
        "band": {"low_um": band.low_um, "high_um": band.high_um, "because": because},
        "forecast": {
            "ront_um": forecast_um(band.after_um),
            "low_um": forecast_um(band.low_um),
            "high_um": forecast_um(band.high_um),
        },
    }


def _along_cut(seen: Preview) -> dict[str, object]:
    """Return what the strategy leaves along the cut, calculated: each section, and the least round; None unknown.

    The names are those of a measured part.
    """
    surface = surface_left(seen, seen.strategy)
    sections = None
    if surface is not None:
        columns = zip(surface.z_mm.tolist(), surface.ront_um.tolist(), surface.mean_um.tolist(), strict=True)
        sections = [{"z_mm": z, "RONt_um": ront, "mean_um": mean} for z, ront, mean in columns]
    return {"sections": sections, **_worst(seen, seen.strategy)}


def _worst(seen: Preview, strategy: Strategy) -> dict[str, float | None]:
    z_mm, um = worst_section(seen, strategy) or (None, None)
    return {"worst_section_z_mm": z_mm, "worst_section_um_pp": um}


def _response(seen: Preview) -> dict[str, object]:
    """Return what the command inverts; a model has no band."""
    response, frequency_hz = seen.response, seen.job.lobe_frequency_hz
    here = response.response_at(frequency_hz)
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


def _drive(seen: Preview) -> dict[str, float]:
    demands = seen.demands.items()
    return {
        **asdict(seen.need),
        **{key: each.need for key, each in demands},
        **{f"{key}_limit": each.limit for key, each in demands},
        **{f"{key}_percent": each.percent for key, each in demands},
    }


def _margins(seen: Preview) -> dict[str, float | str | None]:
    """Return the needs in percent of the limits, including the program's stroke; None is not known.

    Included are the static forces between which the part is held without bending too far.
    """
    made = seen.predictions.get(seen.strategy)
    demands = {**(seen.demands if made is None else made.demands), "grip_n": grip_demand(seen.job, seen.machine)}
    percents = {f"{name}_percent": each.percent for name, each in demands.items()}
    return {"voltage_v_percent": None, **percents, **span_fields(seen.job, seen.machine)}


def _envelope(seen: Preview) -> dict[str, object]:
    """Return the axis's speed limits over lobe amplitude, and this job with every limit."""
    found, (limits, binding) = envelope(seen.job, seen.machine), _speed_limits(seen)
    return {
        "rows": [_row(row.amplitude_um, row.rpm, row.binding) for row in found.rows],
        "at_job": {
            **_row(found.at_job.amplitude_um, limits, binding),
            "percent": {name: 100.0 * seen.job.spindle_speed_rpm / rpm for name, rpm in limits.items() if rpm},
        },
        "highest_safe_rpm": limits[binding],
        "plain_sine_rpm": found.plain_sine_rpm,
    }


def _row(amplitude_um: float, max_rpm: dict[str, float], binding: str) -> dict[str, object]:
    return {"amplitude_um": amplitude_um, "max_rpm": max_rpm, "binding": binding}


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


def preview_lines(seen: Preview, text: Catalogue) -> list[str]:
    """Return the preview: the lobe, the servo at its frequency, the drive's needs, every check."""
    band = predicted_band(seen, seen.strategy)
    bandwidth = "–" if seen.bandwidth_hz is None else f"{seen.bandwidth_hz:.1f}"
    loops = [
        (text("preview.loop"), text("preview.gain"), text("preview.phase"), text("preview.residual")),
        _loop_row(text("preview.eq9", bandwidth=f"{eq9_summary(seen.machine).bandwidth_hz:.1f}"), seen.eq9),
        _loop_row(text("preview.sampled", bandwidth=bandwidth), seen.sampled),
    ]
    needs = [(text("preview.need"), "", "%")]
    needs += [
        (text(f"need.{key}"), f"{each.need:.3g} / {each.limit:.4g}", f"{each.percent:.1f}")
        for key, each in seen.demands.items()
    ]
    return [
        f"{seen.job.name} · {seen.machine.name}",
        "",
        *table(_facts(seen, band, text)),
        "",
        *_because(seen, band, text),
        *table(loops, numeric=(1, 2, 3)),
        "",
        *table(needs, numeric=(1, 2)),
        "",
        *finding_lines(seen.findings, text),
        *(
            f"{MARKS[severity]}  {name}: {words}"
            for name, plan in seen.strategies.items()
            for severity, words in _list_plan_findings(plan, text)
        ),
    ]


def _facts(seen: Preview, band: Band | None, text: Catalogue) -> list[tuple[str, str]]:
    job, command, source = seen.job, seen.command, text(f"source.{seen.job.lobe_error_source}")
    if _source(seen) == OTHER_CUT:  # one found on another cut is not called measured on this one
        source = text("preview.other_cut", source=source)
    percent = 100.0 * seen.response.relative_95(job.lobe_frequency_hz)
    inverted = f"{text(f'response.{seen.response.source}')} {seen.response.name}, ± {percent:.2f} %"
    lobe = f"{job.lobe_error_um_pp:.1f} um p-p, {job.jaws}/rev, {job.lobe_frequency_hz:.2f} Hz"
    limits, binding = _speed_limits(seen)
    rows = [
        (text("preview.lobe"), lobe),
        (text("preview.source"), source),
        (text("preview.wanted"), f"{seen.target.mean_um:.1f} ± {seen.target.amplitude_um:.2f} um"),
        (
            text("preview.command"),
            f"± {command.amplitude_um:.2f} um, {job.lobe_phase_deg - command.phase_deg:+z.2f} deg",
        ),
        (text("preview.inverts"), inverted),
    ]
    if band is not None:
        after, low, high = map(forecast_um, (band.after_um, band.low_um, band.high_um))
        left = text("preview.left", strategy=seen.strategy, z=f"{middle_mm(job):.1f}")
        rows.append((left, f"{after:.1f} um ({low:.1f} … {high:.1f} um)"))
        if is_below_forecast(band.after_um):
            calculated, least = f"{band.after_um:.2f}", f"{LEAST_FORECAST_UM:g}"
            rows.append(("", text("forecast.least", calculated=calculated, least=least)))
    for strategy in dict.fromkeys((seen.strategy, UNCOMPENSATED)):
        if worst := worst_section(seen, strategy):
            place = f"Z {worst[0]:.1f} mm: {forecast_um(worst[1]):.1f} um"
            rows.append((text("preview.worst", strategy=strategy), place))
    return [
        *rows,
        (text("preview.grip"), f"{seen.grip_margin_n:.0f} N"),
        (text("predict.force_span"), span_line(job, seen.machine, text)),
        *(("", remedy) for remedy in (no_force_remedy(force_span(job, seen.machine), text),) if remedy),
        (text("preview.fastest"), f"{math.floor(limits[binding])} rpm ({text(f'speed_limit.{binding}')})"),
    ]


def _because(seen: Preview, band: Band | None, text: Catalogue) -> list[str]:
    """Return the contributions to the band, with a line below; nothing without one."""
    if band is None:
        return []
    rows = [(text("preview.because"), "um p-p")]
    reasons = band_reasons(band, seen.response, text)
    rows += [(words, "-" if um is None else f"{um:.2f}") for _, um, words in reasons]
    return [*table(rows, numeric=(1,)), ""]


def _speed_limits(seen: Preview) -> tuple[dict[str, float], str]:
    """Return each limit of the spindle speed for this job, rpm, and the name of the lowest."""
    return highest_safe_speed(seen.job, seen.machine, seen.response)


def _loop_row(name: str, loop: Response) -> tuple[str, ...]:
    return name, f"{loop.gain:.4f}", f"{loop.phase_rad:+z.4f} rad", f"{loop.residual_um_pp:.1f} um p-p"


def _list_plan_findings(plan: CutPlan | ProblemError, text: Catalogue) -> list[tuple[Severity, str]]:
    if isinstance(plan, ProblemError):
        return [(Severity.REFUSAL, text.problem(problem)) for problem in plan.problems]
    found = [(f.severity, text.problem(f.problem)) for f in plan.findings]
    return found or [(Severity.OK, text("preview.clean", duration=f"{plan.duration_s:.1f}"))]
