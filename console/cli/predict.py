"""`console predict`: what a plain cut leaves, how hard to clamp, how fast the lobe may be followed."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Mapping
from dataclasses import asdict

import numpy as np

from console.cli.library import job_of, judged_of
from console.cli.output import finding_fields, finding_rows, print_json, said_of_place, tell
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.axis.envelope import Envelope, EnvelopeRow
from profiles.chucking.advice import ClampingAdvice, force_span
from profiles.chucking.diagnosis import diagnose
from profiles.chucking.holding import holding_of
from profiles.chucking.job_grip import wrench_force_sd_n
from profiles.chucking.ring import is_thin
from profiles.chucking.wrench import torque_or_none_n_m
from profiles.findings import refusals
from profiles.job import Job
from profiles.lobe.cut_error import CutError
from profiles.lobe.prediction import Prediction, predict
from profiles.machine import MachineProfile


def main(options: Namespace, text: Catalogue) -> int:
    """Print the prediction; 1 when a rule refuses the job."""
    job, found = job_of(options).job, judged_of(options)
    machine, seen = found.machine, predict(job, found.machine)
    warnings = tell(found.warnings, text)
    if options.json:
        sources = {f"chuck.{key}": date or "profile" for key, date in found.sources.items()}
        more = {"sources": sources, "warnings": warnings}
        print_json({"job": job.name, "machine": machine.name, **_fields(job, machine, seen, text), **more})
    else:
        told = [*_lines(job, machine, seen, text), *_sources(found.sources, text)]
        print("\n".join([f"{job.name} · {machine.name}", "", *told]))
    return 1 if refusals(seen.findings) else 0


def _sources(sources: Mapping[str, str], text: Catalogue) -> list[str]:
    """Return where what is known of the chuck is from: the profile, or a calibration of a date."""
    keys: dict[str, list[str]] = {}
    for key, date in sorted(sources.items(), key=lambda each: each[1]):
        keys.setdefault(date, []).append(f"chuck.{key}")
    return [
        text("predict.calibrated", keys=", ".join(of_date), date=date)
        if date
        else text("predict.from_profile", keys=", ".join(of_date))
        for date, of_date in keys.items()
    ]


def _fields(job: Job, machine: MachineProfile, seen: Prediction, text: Catalogue) -> dict[str, object]:
    process, scale = seen.process, seen.scaled_to
    return {
        "scaled_to": None if scale is None else {**asdict(scale), "factor": scale.factor},
        "angle_deg": seen.angle_deg.tolist(),
        "z_mm": seen.z_mm.tolist(),
        "error_um": seen.error_um.tolist(),
        "error_um_pp": seen.error_um_pp.tolist(),
        "model_um_pp": seen.model_um_pp.tolist(),
        "parts_um_pp": {name.value: np.ptp(part, axis=1).tolist() for name, part in seen.parts_um.items()},
        "size_um": seen.size_um.tolist(),
        "cut": {**asdict(seen.cut), "high_at_jaws": _high(job, seen.cut)},
        "model": {**asdict(seen.model), "high_at_jaws": _high(job, seen.model)},
        "stock_mm": seen.stock_mm.tolist(),
        "stock_um_pp": seen.stock_um_pp.tolist(),
        "process": {**asdict(process), "share_left_by_a_pass": process.copying.share_left()},
        "clamping": _clamping_fields(seen.advice, machine),
        "envelope": {**asdict(seen.envelope), "beyond": _beyond_rpm(seen.envelope, machine)},
        "assumed": list(seen.assumed),
        "findings": [finding_fields(f, text) for f in seen.findings],
    }


def _clamping_fields(advice: ClampingAdvice, machine: MachineProfile) -> dict[str, object]:
    more = {key: value for key, value in asdict(advice).items() if key not in ("span", "uncompensated_n")}
    return {
        "minimum_n": advice.span.least_n,
        "maximum_n": advice.span.most_n,
        "binding": advice.span.binding,
        "limits_n": _limits_n(advice),
        "beyond": [name for name, force_n in _limits_n(advice).items() if force_n > machine.chuck.max_force_n],
        **more,
    }


def _limits_n(advice: ClampingAdvice) -> dict[str, float]:
    """Return where each limit lies, with that of a plain cut, which is none of a compensated one."""
    plain_n = advice.uncompensated_n
    return {**advice.span.limits_n, **({} if plain_n is None else {"uncompensated": plain_n})}


def _beyond_rpm(seen: Envelope, machine: MachineProfile) -> list[str]:
    """Return the limits of the axis that lie above what the spindle can turn: they limit nothing."""
    return [name for name, rpm in seen.at_job.rpm.items() if rpm > machine.spindle.max_speed_rpm]


def _high(job: Job, cut: CutError) -> bool | None:
    """Whether the part is high where the jaws were; None without a lobe, or between."""
    if cut.crest_deg is None:
        return None
    thin = is_thin(job.wall_thickness_mm, job.radius_mm)
    place = diagnose(crest_deg=cut.crest_deg, jaw_1_deg=job.jaw_1_deg, jaws=job.jaws, thin=thin)
    return place.high_at_jaws


def _lines(job: Job, machine: MachineProfile, seen: Prediction, text: Catalogue) -> list[str]:
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
        *finding_rows(seen.findings, text),
        *([text("predict.assumed", keys=", ".join(seen.assumed))] if seen.assumed else []),
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
    high = _high(job, cut)
    at_jaws = "predict.no_lobe" if high is None else "predict.high" if high else "predict.low"
    return f"{cut.um_pp:.2f} um p-p, {text(at_jaws)}"


def _place(cut: CutError, text: Catalogue) -> str:
    """What the place of the lobe speaks for, where it is known how far past the jaws it stands."""
    return "" if cut.diagnosis is None else f", {said_of_place(cut.diagnosis, text)}"


def _places(job: Job, seen: Prediction, text: Catalogue) -> list[tuple[str, ...]]:
    """The error at each Z: at a jaw, between two, peak to peak; and how much too large the part is."""
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
    """The forces; what lies above the chuck's most, or the spindle's, limits nothing and is left out."""
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
    limits_n = {name: n for name, n in _limits_n(advice).items() if n <= machine.chuck.max_force_n}
    rows += [(text(f"clamp_limit.{name}"), f"{force_n:.0f} N") for name, force_n in limits_n.items()]
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
    """The speeds at which the limits are reached with the amplitude of the job, the nearest first."""
    head = (text("predict.limit", amplitude=f"{seen.at_job.amplitude_um:.1f}"), "rpm", "%")
    most_rpm, beyond = machine.spindle.max_speed_rpm, _beyond_rpm(seen, machine)
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


def span_fields(job: Job, machine: MachineProfile) -> dict[str, float | str]:
    """Return least and most force at rest, N, the limit of the most, and where the force of the job stands."""
    span = force_span(job, machine)
    return {
        "force_least_n": span.least_n,
        "force_most_n": span.most_n,
        "force_limit": span.binding,
        "force_stands": span.stands(job.chucking_force_n).value,
    }


def span_words(job: Job, machine: MachineProfile, text: Catalogue) -> str:
    """Return the span in whole newtons, with the limit at which it ends."""
    span = force_span(job, machine)
    least_n, most_n = span.whole_n
    return f"{least_n} … {most_n} N ({text(f'clamp_limit.{span.binding}')})"


def force_words(job: Job, machine: MachineProfile, text: Catalogue) -> str:
    """Return a sentence of the force of a job: how sure it is, its torque where there is one, and the span."""
    wrench = holding_of(machine).wrench
    torque_n_m = None if wrench is None else torque_or_none_n_m(wrench, job.chucking_force_n)
    return text(
        "clamping.force" if torque_n_m is None else "clamping.force_and_torque",
        force=f"{job.chucking_force_n:.0f}",
        sd=f"{wrench_force_sd_n(job, machine):.0f}",
        torque="" if torque_n_m is None else f"{torque_n_m:.2f}",
        span=span_words(job, machine, text),
    )
