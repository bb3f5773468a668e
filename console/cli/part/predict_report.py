"""Prediction of a plain cut, for people and for JSON: lengths in um, angles in degrees, in JSON not rounded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict

import numpy as np

from console.cli.judgement import finding_fields, finding_lines, lobe_place_line
from console.cli.output import harmonics_of
from console.session.data.calibrated_chuck import CalibratedMachine
from console.text.catalogue import Catalogue
from console.text.columns import table
from console.text.job_words import no_force_remedy, span_words
from profiles.axis.envelope import Envelope
from profiles.chucking.advice import ClampingAdvice
from profiles.chucking.diagnosis import diagnose
from profiles.chucking.ring import is_thin
from profiles.job import Job
from profiles.lobe.along import holding_spread
from profiles.lobe.cut_error import CutError
from profiles.lobe.prediction import Prediction
from profiles.machine import MachineProfile


def prediction_fields(
    job: Job, calibrated: CalibratedMachine, seen: Prediction, text: Catalogue
) -> dict[str, object]:
    """Return the whole prediction, with the source of each fact about the chuck."""
    machine, process, scale = calibrated.machine, seen.process, seen.scaled_to
    advice, limits_n = seen.advice, _limits_n(seen.advice)
    return {
        "job": job.name,
        "machine": machine.name,
        "scaled_to": None if scale is None else {**asdict(scale), "factor": scale.factor},
        "angle_deg": seen.angle_deg.tolist(),
        "z_mm": seen.z_mm.tolist(),
        "error_um": seen.error_um.tolist(),
        "error_um_pp": seen.error_um_pp.tolist(),
        "model_um_pp": seen.model_um_pp.tolist(),
        "parts_um_pp": {name.value: np.ptp(part, axis=1).tolist() for name, part in seen.parts_um.items()},
        "size_um": seen.size_um.tolist(),
        "cut": {**harmonics_of(seen.cut), "high_at_jaws": _high_at_jaws(job, seen.cut)},
        "model": {**harmonics_of(seen.model), "high_at_jaws": _high_at_jaws(job, seen.model)},
        "ends_of_cut": {name: list(ends) for name, ends in holding_spread(job, machine).items()},
        "stock_mm": seen.stock_mm.tolist(),
        "stock_um_pp": seen.stock_um_pp.tolist(),
        "process": {**asdict(process), "share_left_by_a_pass": process.copying.fraction_left()},
        "clamping": {
            "minimum_n": advice.span.least_n,
            "maximum_n": advice.span.most_n,
            "binding": advice.span.binding,
            "limits_n": limits_n,
            "beyond": [name for name, force_n in limits_n.items() if force_n > machine.chuck.max_force_n],
            **{key: value for key, value in asdict(advice).items() if key not in ("span", "uncompensated_n")},
        },
        "envelope": {**asdict(seen.envelope), "beyond": _beyond_spindle(seen.envelope, machine)},
        "assumed": list(seen.assumed),
        "findings": [finding_fields(f, text) for f in seen.findings],
        "sources": {f"chuck.{key}": date or "profile" for key, date in calibrated.sources.items()},
    }


def _limits_n(advice: ClampingAdvice) -> dict[str, float]:
    """Return each force limit, including that of a plain cut, which does not apply to a compensated one."""
    plain_n = advice.uncompensated_n
    return {**advice.span.limits_n, **({} if plain_n is None else {"uncompensated": plain_n})}


def _beyond_spindle(seen: Envelope, machine: MachineProfile) -> list[str]:
    """Return the limits of the axis above the maximum spindle speed: they limit nothing."""
    return [name for name, rpm in seen.at_job.rpm.items() if rpm > machine.spindle.max_speed_rpm]


def _high_at_jaws(job: Job, cut: CutError) -> bool | None:
    """Whether the part is high where the jaws were; None without a lobe, or between."""
    if cut.phase_deg is None:
        return None
    thin = is_thin(job.wall_thickness_mm, job.radius_mm)
    return diagnose(phase_deg=cut.phase_deg, jaw_1_deg=job.jaw_1_deg, jaws=job.jaws, thin=thin).high_at_jaws


def prediction_lines(job: Job, calibrated: CalibratedMachine, seen: Prediction, text: Catalogue) -> list[str]:
    """Return the error, the clamping, the process and the speeds, then every rule and the sources."""
    machine = calibrated.machine
    return [
        f"{job.name} · {machine.name}",
        "",
        *table([*_error(job, seen, text), *_ends_of_cut(job, machine, seen, text)]),
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
        *_source_lines(calibrated.sources, text),
    ]


def _source_lines(sources: Mapping[str, str], text: Catalogue) -> list[str]:
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


def _ends_of_cut(
    job: Job, machine: MachineProfile, seen: Prediction, text: Catalogue
) -> Iterator[tuple[str, str]]:
    """Yield the lobe at both ends of the cut, as the profile has it and in the two limits of how jaws hold."""
    first_mm, last_mm = job.overhang_mm - job.cut_length_mm, job.overhang_mm
    for name, ends in holding_spread(job, machine).items():
        label = text(f"predict.along_{name}", first=f"{first_mm:.1f}", last=f"{last_mm:.1f}")
        yield label, ", ".join(f"{abs(seen.cut.um_pp * each):.1f}" for each in ends) + " um p-p"


def _height(job: Job, cut: CutError, text: Catalogue) -> str:
    high = _high_at_jaws(job, cut)
    at_jaws = "predict.no_lobe" if high is None else "predict.high" if high else "predict.low"
    return f"{cut.um_pp:.2f} um p-p, {text(at_jaws)}"


def _place(cut: CutError, text: Catalogue) -> str:
    """Return what the lobe's position suggests, where its angle from the jaws is known."""
    return "" if cut.diagnosis is None else f", {lobe_place_line(cut.diagnosis, text)}"


def _places(job: Job, seen: Prediction, text: Catalogue) -> list[tuple[str, ...]]:
    """Return the error at each Z: at a jaw, between two, peak to peak; and the oversize of the part."""
    lobe_deg = np.array([0.0, 180.0 / job.jaws]) + job.jaw_1_deg
    at_jaw, between = (int(np.argmin(np.abs((seen.angle_deg - deg + 180) % 360 - 180))) for deg in lobe_deg)
    columns = {
        "z": [f"{z:.1f}" for z in seen.z_mm],
        "jaw": [f"{um:+z.3f}" for um in seen.error_um[:, at_jaw]],
        "between": [f"{um:+z.3f}" for um in seen.error_um[:, between]],
        "pp": [f"{um:.3f}" for um in seen.error_um_pp],
        **({} if seen.scaled_to is None else {"model_pp": [f"{um:.3f}" for um in seen.model_um_pp]}),
        "size": [f"{um:.3f}" for um in seen.size_um],
    }
    return [tuple(text(f"predict.{name}") for name in columns), *zip(*columns.values(), strict=True)]


def _clamping(advice: ClampingAdvice, machine: MachineProfile, text: Catalogue) -> list[tuple[str, str]]:
    """Return the forces; limits above the maximum of chuck or spindle are left out."""
    remedy = no_force_remedy(advice.span, text)
    rows = [
        (text("predict.force_span"), span_words(advice.span, text)),
        *([("", remedy)] if remedy else []),
        (text("predict.force"), f"{advice.at_rest_n:.0f} ± {advice.at_rest_sd_n:.0f} N"),
    ]
    if advice.line_sd_n:
        parts = text("predict.force_parts", scatter=f"{advice.scatter_sd_n:.0f}", line=f"{advice.line_sd_n:.0f}")
        rows.append(("", parts))
    rows.append((text("predict.force_at_speed"), f"{advice.at_speed_n:.0f} N"))
    if advice.permitted_speed_rpm <= machine.spindle.max_speed_rpm:
        rows.append((text("predict.speed_limit"), f"{advice.permitted_speed_rpm:.0f} rpm"))
    limits_n = {name: n for name, n in _limits_n(advice).items() if n <= machine.chuck.max_force_n}
    rows += [(text(f"clamp_limit.{name}"), f"{force_n:.0f} N") for name, force_n in limits_n.items()]
    if advice.torque_n_m is not None and advice.torque_span_n_m is not None:
        low, high = advice.torque_span_n_m
        between = "" if advice.span.empty else f" ({low:.2f} … {high:.2f})"
        rows.append((text("predict.torque"), f"{advice.torque_n_m:.2f} N m{between}"))
    return rows


def _process(seen: Prediction, text: Catalogue) -> list[tuple[str, str]]:
    process, force = seen.process, seen.process.force
    return [
        (text("predict.cutting"), f"{force.main_n:.2f} / {force.passive_n:.2f} N"),
        (text("predict.copying"), f"{100 * process.copying.fraction_left():.2f} %"),
        (text("predict.lobed"), f"± {process.lobed_force_n:.2f} N, ± {process.lobed_motion_um:.2f} um"),
        (text("predict.chatter"), f"{process.chatter_limit_mm:.3f} mm"),
    ]


def _envelope(job: Job, seen: Envelope, machine: MachineProfile, text: Catalogue) -> list[tuple[str, str, str]]:
    """Return the speeds at which the limits are reached with the job's amplitude, the nearest first."""
    head = (text("predict.limit", amplitude=f"{seen.at_job.amplitude_um:.1f}"), "rpm", "%")
    most_rpm, beyond = machine.spindle.max_speed_rpm, _beyond_spindle(seen, machine)
    rows = [
        (text(f"envelope.{name}"), f"{rpm:.0f}", "–" if (p := seen.percent[name]) is None else f"{p:.1f}")
        for name, rpm in sorted(seen.at_job.rpm.items(), key=lambda each: each[1])
        if name not in beyond
    ]
    rows.append((text("speed_limit.spindle"), f"{most_rpm:.0f}", f"{100 * job.spindle_speed_rpm / most_rpm:.1f}"))
    if seen.plain_sine_rpm is not None and seen.plain_sine_rpm <= most_rpm:
        rows.append((text("envelope.plain_sine"), f"{seen.plain_sine_rpm:.0f}", "–"))
    return [head, *rows]


def _amplitudes(seen: Envelope, machine: MachineProfile, text: Catalogue) -> list[tuple[str, str, str]]:
    rows = [(text("predict.amplitude"), "rpm", text("predict.binding"))]
    for row in seen.rows:
        rpm, name = row.rpm[row.binding], f"envelope.{row.binding}"
        if rpm > machine.spindle.max_speed_rpm:
            rpm, name = machine.spindle.max_speed_rpm, "speed_limit.spindle"
        rows.append((f"{row.amplitude_um:g} um", f"{rpm:.0f}", text(name)))
    return rows
