"""Prediction of a plain cut as lines for people."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from console.cli.finding_lines import finding_lines
from console.cli.lobe_lines import lobe_place_line
from console.cli.part.predict_fields import beyond_spindle, high_at_jaws, limits_n
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.axis.envelope import Envelope, EnvelopeRow
from profiles.chucking.advice import ClampingAdvice
from profiles.job import Job
from profiles.lobe.cut_error import CutError
from profiles.lobe.prediction import Prediction
from profiles.machine import MachineProfile


def prediction_lines(job: Job, machine: MachineProfile, seen: Prediction, text: Catalogue) -> list[str]:
    """Return the error, the clamping, the process and the speeds, then every rule."""
    return [
        *table(_error(job, seen, text)),
        "",
        *table(_places(job, seen, text), numeric=(0, 1, 2, 3, 4, 5)),
        "",
        *table(_clamping(seen.advice, machine, text)),
        "",
        *table(_process(seen, text)),
        "",
        *table(_envelope(job, seen.envelope, machine, text), numeric=(1, 2)),
        "",
        *table(_amplitudes(seen.envelope, machine, text), numeric=(0, 1)),
        "",
        *finding_lines(seen.findings, text),
        *([text("predict.assumed", keys=", ".join(seen.assumed))] if seen.assumed else []),
    ]


def source_lines(sources: Mapping[str, str], text: Catalogue) -> list[str]:
    """Return the source of each fact about the chuck: the profile, or a calibration with its date."""
    keys: dict[str, list[str]] = {}
    for key, date in sorted(sources.items(), key=lambda each: each[1]):
        keys.setdefault(date, []).append(f"chuck.{key}")
    return [
        text("predict.calibrated", keys=", ".join(of_date), date=date)
        if date
        else text("predict.from_profile", keys=", ".join(of_date))
        for date, of_date in keys.items()
    ]


def _error(job: Job, seen: Prediction, text: Catalogue) -> list[tuple[str, str]]:
    cut, model, scale = seen.cut, seen.model, seen.scaled_to
    rows = [
        (text("predict.mechanism"), text(f"mechanism.{cut.mechanism}")),
        (text("predict.at_cut", z=f"{cut.z_mm:.1f}"), _height(job, cut, text)),
        (text("predict.spread"), f"± {cut.sd_um_pp:.2f} um p-p"),
    ]
    if scale is not None:
        found = f"{text(f'source.{scale.source}')} {scale.found_um_pp:.1f} um p-p, Z {scale.z_mm:.1f} mm"
        rows.append((text("predict.scaled"), f"{found}, × {scale.factor:.3g}{_place(cut, text)}"))
        rows.append((text("predict.model"), _height(job, model, text)))
    elif model.measured_um_pp is not None:
        rows.append((text("predict.measured"), f"{model.measured_um_pp:.1f} um p-p{_place(model, text)}"))
        rows.append(("", text("predict.not_scaled")))
    if model.matching_force_n is not None:
        rows.append((text("predict.matching"), f"{model.matching_force_n:.0f} N"))
    turned = ", ".join(f"{um:.1f}" for um in seen.stock_um_pp)
    return [*rows, (text("predict.stock", depth=f"{seen.stock_mm[-1]:g}"), f"{turned} um p-p")]


def _height(job: Job, cut: CutError, text: Catalogue) -> str:
    high = high_at_jaws(job, cut)
    at_jaws = "predict.no_lobe" if high is None else "predict.high" if high else "predict.low"
    return f"{cut.um_pp:.2f} um p-p, {text(at_jaws)}"


def _place(cut: CutError, text: Catalogue) -> str:
    """Return what the lobe's position suggests, where its angle from the jaws is known."""
    return "" if cut.diagnosis is None else f", {lobe_place_line(cut.diagnosis, text)}"


def _places(job: Job, seen: Prediction, text: Catalogue) -> list[tuple[str, ...]]:
    """Return the error at each Z: at a jaw, between two, peak to peak; and the oversize of the part."""
    lobe_deg = np.array([0.0, 180.0 / job.jaws]) + job.jaw_1_deg
    at_jaw, between = (int(np.argmin(np.abs((seen.angle_deg - deg + 180) % 360 - 180))) for deg in lobe_deg)
    columns = ("z", "jaw", "between", "pp", *(() if seen.scaled_to is None else ("model_pp",)), "size")
    pp_um = seen.error_um_pp
    rows = [
        {
            "z": f"{z:.1f}",
            "jaw": f"{seen.error_um[i, at_jaw]:+z.3f}",
            "between": f"{seen.error_um[i, between]:+z.3f}",
            "pp": f"{pp_um[i]:.3f}",
            "model_pp": f"{seen.model_um_pp[i]:.3f}",
            "size": f"{seen.size_um[i]:.3f}",
        }
        for i, z in enumerate(seen.z_mm)
    ]
    head = tuple(text(f"predict.{name}") for name in columns)
    return [head, *(tuple(row[name] for name in columns) for row in rows)]


def _clamping(advice: ClampingAdvice, machine: MachineProfile, text: Catalogue) -> list[tuple[str, str]]:
    """Return the forces; limits above the maximum of chuck or spindle are left out."""
    least_n, most_n = advice.span.whole_n
    rows = [
        (text("predict.force_span"), f"{least_n} … {most_n} N"),
        (text("predict.force"), f"{advice.at_rest_n:.0f} ± {advice.at_rest_sd_n:.0f} N"),
        (text("predict.force_at_speed"), f"{advice.at_speed_n:.0f} N"),
    ]
    if advice.line_sd_n:
        parts = text("predict.force_parts", scatter=f"{advice.scatter_sd_n:.0f}", line=f"{advice.line_sd_n:.0f}")
        rows.insert(2, ("", parts))
    if advice.permitted_speed_rpm <= machine.spindle.max_speed_rpm:
        rows.append((text("predict.speed_limit"), f"{advice.permitted_speed_rpm:.0f} rpm"))
    limits = {name: n for name, n in limits_n(advice).items() if n <= machine.chuck.max_force_n}
    rows += [(text(f"clamp_limit.{name}"), f"{force_n:.0f} N") for name, force_n in limits.items()]
    if advice.torque_n_m is not None and advice.torque_span_n_m is not None:
        low, high = advice.torque_span_n_m
        rows.append((text("predict.torque"), f"{advice.torque_n_m:.2f} N m ({low:.2f} … {high:.2f})"))
    return rows


def _process(seen: Prediction, text: Catalogue) -> list[tuple[str, str]]:
    process = seen.process
    force = process.force
    return [
        (text("predict.cutting"), f"{force.main_n:.2f} / {force.passive_n:.2f} N"),
        (text("predict.copying"), f"{100 * process.copying.share_left():.2f} %"),
        (text("predict.lobed"), f"± {process.lobed_force_n:.2f} N, ± {process.lobed_motion_um:.2f} um"),
        (text("predict.chatter"), f"{process.chatter_limit_mm:.3f} mm"),
    ]


def _envelope(job: Job, seen: Envelope, machine: MachineProfile, text: Catalogue) -> list[tuple[str, str, str]]:
    """Return the speeds at which the limits are reached with the job's amplitude, the nearest first."""
    head = (text("predict.limit", amplitude=f"{seen.at_job.amplitude_um:.1f}"), "rpm", "%")
    most_rpm, beyond = machine.spindle.max_speed_rpm, beyond_spindle(seen, machine)
    ordered = sorted((n for n in seen.at_job.rpm if n not in beyond), key=seen.at_job.rpm.__getitem__)
    rows = [
        (text(f"envelope.{name}"), f"{seen.at_job.rpm[name]:.0f}", _percent(seen.percent[name]))
        for name in ordered
    ]
    rows.append((text("speed_limit.spindle"), f"{most_rpm:.0f}", f"{100 * job.spindle_speed_rpm / most_rpm:.1f}"))
    if seen.plain_sine_rpm is not None and seen.plain_sine_rpm <= most_rpm:
        rows.append((text("envelope.plain_sine"), f"{seen.plain_sine_rpm:.0f}", "–"))
    return [head, *rows]


def _percent(percent: float | None) -> str:
    return "–" if percent is None else f"{percent:.1f}"


def _amplitudes(seen: Envelope, machine: MachineProfile, text: Catalogue) -> list[tuple[str, str, str]]:
    head = (text("predict.amplitude"), "rpm", text("predict.binding"))
    return [head, *(_amplitude(row, machine.spindle.max_speed_rpm, text) for row in seen.rows)]


def _amplitude(row: EnvelopeRow, most_rpm: float, text: Catalogue) -> tuple[str, str, str]:
    rpm, name = row.rpm[row.binding], f"envelope.{row.binding}"
    if rpm > most_rpm:
        rpm, name = most_rpm, "speed_limit.spindle"
    return f"{row.amplitude_um:g} um", f"{rpm:.0f}", text(name)
