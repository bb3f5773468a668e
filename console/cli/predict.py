"""`console predict`: what a plain cut leaves, how hard to clamp, how fast the lobe may be followed."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Mapping
from dataclasses import asdict

import numpy as np

from console.cli.findings import finding_fields, finding_rows
from console.cli.library import data_of, job_of, profile_of
from console.cli.lobe_place import said_of_place
from console.cli.output import print_json
from console.cli.warn import tell
from console.session.calibrated_chuck import calibrated
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.chucking.advice import ClampingAdvice
from profiles.chucking.diagnosis import diagnose
from profiles.chucking.ring import is_thin
from profiles.envelope import Envelope
from profiles.job import Job
from profiles.prediction import Prediction, predict
from profiles.rules import refusals


def main(options: Namespace, text: Catalogue) -> int:
    """Print the prediction; 1 when a rule refuses the job."""
    job, found = job_of(options).job, calibrated(profile_of(options).machine, data_of(options))
    machine, seen = found.machine, predict(job, found.machine)
    warnings = tell(found.warnings, text)
    if options.json:
        sources = {f"chuck.{key}": date or "profile" for key, date in found.sources.items()}
        more = {"sources": sources, "warnings": warnings}
        print_json({"job": job.name, "machine": machine.name, **_fields(job, seen, text), **more})
    else:
        told = [*_lines(job, seen, text), *_sources(found.sources, text)]
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


def _fields(job: Job, seen: Prediction, text: Catalogue) -> dict[str, object]:
    advice = {key: value for key, value in asdict(seen.advice).items() if key != "findings"}
    process = seen.process
    return {
        "angle_deg": seen.angle_deg.tolist(),
        "z_mm": seen.z_mm.tolist(),
        "error_um": seen.error_um.tolist(),
        "error_um_pp": seen.error_um_pp.tolist(),
        "parts_um_pp": {name.value: np.ptp(part, axis=1).tolist() for name, part in seen.parts_um.items()},
        "size_um": seen.size_um.tolist(),
        "cut": {**asdict(seen.cut), "high_at_jaws": _high(job, seen)},
        "stock_mm": seen.stock_mm.tolist(),
        "stock_um_pp": seen.stock_um_pp.tolist(),
        "process": {**asdict(process), "share_left_by_a_pass": process.copying.share_left()},
        "clamping": advice,
        "envelope": asdict(seen.envelope),
        "assumed": list(seen.assumed),
        "findings": [finding_fields(f, text) for f in seen.findings],
    }


def _high(job: Job, seen: Prediction) -> bool | None:
    """Whether the part is high where the jaws were; None without a lobe, or between."""
    if seen.cut.crest_deg is None:
        return None
    thin = is_thin(job.wall_thickness_mm, job.radius_mm)
    place = diagnose(crest_deg=seen.cut.crest_deg, jaw_1_deg=job.jaw_1_deg, jaws=job.jaws, thin=thin)
    return place.high_at_jaws


def _lines(job: Job, seen: Prediction, text: Catalogue) -> list[str]:
    return [
        *table(_error(job, seen, text)),
        "",
        *table(_places(job, seen, text), numeric=(0, 1, 2, 3, 4)),
        "",
        *table(_clamping(seen.advice, text)),
        "",
        *table(_process(seen, text)),
        "",
        *table(_envelope(seen.envelope, text), numeric=(1, 2)),
        "",
        *table(_amplitudes(seen.envelope, text), numeric=(0, 1)),
        "",
        *finding_rows(seen.findings, text),
        *([text("predict.assumed", keys=", ".join(seen.assumed))] if seen.assumed else []),
    ]


def _error(job: Job, seen: Prediction, text: Catalogue) -> list[tuple[str, str]]:
    cut, high = seen.cut, _high(job, seen)
    at_jaws = "predict.no_lobe" if high is None else "predict.high" if high else "predict.low"
    rows = [
        (text("predict.mechanism"), text(f"mechanism.{cut.mechanism}")),
        (text("predict.at_cut", z=f"{cut.z_mm:.1f}"), f"{cut.um_pp:.2f} um p-p, {text(at_jaws)}"),
        (text("predict.spread"), f"± {cut.sd_um_pp:.2f} um p-p"),
    ]
    if cut.measured_um_pp is not None:
        place = "" if cut.diagnosis is None else f", {said_of_place(cut.diagnosis, text)}"
        rows.append((text("predict.measured"), f"{cut.measured_um_pp:.1f} um p-p{place}"))
    if cut.matching_force_n is not None:
        rows.append((text("predict.matching"), f"{cut.matching_force_n:.0f} N"))
    turned = ", ".join(f"{um:.1f}" for um in seen.stock_um_pp)
    return [*rows, (text("predict.stock", depth=f"{seen.stock_mm[-1]:g}"), f"{turned} um p-p")]


def _places(job: Job, seen: Prediction, text: Catalogue) -> list[tuple[str, ...]]:
    """The error at each Z: at a jaw, between two, peak to peak; and how much too large the part is."""
    lobe_deg = np.array([0.0, 180.0 / job.jaws]) + job.jaw_1_deg
    at_jaw, between = (int(np.argmin(np.abs((seen.angle_deg - deg + 180) % 360 - 180))) for deg in lobe_deg)
    head = tuple(text(f"predict.{name}") for name in ("z", "jaw", "between", "pp", "size"))
    pp_um = seen.error_um_pp
    return [
        head,
        *(
            (
                f"{z:.1f}",
                f"{seen.error_um[i, at_jaw]:+z.3f}",
                f"{seen.error_um[i, between]:+z.3f}",
                f"{pp_um[i]:.3f}",
                f"{seen.size_um[i]:.3f}",
            )
            for i, z in enumerate(seen.z_mm)
        ),
    ]


def _clamping(advice: ClampingAdvice, text: Catalogue) -> list[tuple[str, str]]:
    span = f"{advice.minimum_n:.0f} … {advice.maximum_n:.0f} N"
    rows = [
        (text("predict.force_span"), span),
        (text("predict.force"), f"{advice.at_rest_n:.0f} ± {advice.at_rest_sd_n:.0f} N"),
        (text("predict.force_at_speed"), f"{advice.at_speed_n:.0f} N"),
        (text("predict.speed_limit"), f"{advice.permitted_speed_rpm:.0f} rpm"),
    ]
    rows += [(text(f"clamp_limit.{name}"), f"{force:.0f} N") for name, force in advice.limits_n.items()]
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


def _envelope(seen: Envelope, text: Catalogue) -> list[tuple[str, str, str]]:
    """The speeds at which the limits are reached with the amplitude of the job, the nearest first."""
    head = (text("predict.limit", amplitude=f"{seen.at_job.amplitude_um:.1f}"), "rpm", "%")
    ordered = sorted(seen.at_job.rpm, key=seen.at_job.rpm.__getitem__)
    rows = [
        (text(f"envelope.{name}"), f"{seen.at_job.rpm[name]:.0f}", f"{seen.percent[name]:.1f}") for name in ordered
    ]
    if seen.plain_sine_rpm is not None:
        rows.append((text("envelope.plain_sine"), f"{seen.plain_sine_rpm:.0f}", "–"))
    return [head, *rows]


def _amplitudes(seen: Envelope, text: Catalogue) -> list[tuple[str, str, str]]:
    head = (text("predict.amplitude"), "rpm", text("predict.binding"))
    return [
        head,
        *((f"{r.amplitude_um:g} um", f"{r.rpm[r.binding]:.0f}", text(f"envelope.{r.binding}")) for r in seen.rows),
    ]
