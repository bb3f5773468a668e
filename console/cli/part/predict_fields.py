"""Prediction of a plain cut for JSON: lengths in um, angles in degrees, nothing rounded."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from console.cli.finding_fields import finding_fields
from console.text.catalogue import Catalogue
from profiles.axis.envelope import Envelope
from profiles.chucking.advice import ClampingAdvice
from profiles.chucking.diagnosis import diagnose
from profiles.chucking.ring import is_thin
from profiles.job import Job
from profiles.lobe.cut_error import CutError
from profiles.lobe.prediction import Prediction
from profiles.machine import MachineProfile


def prediction_fields(job: Job, machine: MachineProfile, seen: Prediction, text: Catalogue) -> dict[str, object]:
    """Return the whole prediction."""
    process, scale = seen.process, seen.scaled_to
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
        "cut": {**asdict(seen.cut), "high_at_jaws": high_at_jaws(job, seen.cut)},
        "model": {**asdict(seen.model), "high_at_jaws": high_at_jaws(job, seen.model)},
        "stock_mm": seen.stock_mm.tolist(),
        "stock_um_pp": seen.stock_um_pp.tolist(),
        "process": {**asdict(process), "share_left_by_a_pass": process.copying.share_left()},
        "clamping": _clamping_fields(seen.advice, machine),
        "envelope": {**asdict(seen.envelope), "beyond": beyond_spindle(seen.envelope, machine)},
        "assumed": list(seen.assumed),
        "findings": [finding_fields(f, text) for f in seen.findings],
    }


def _clamping_fields(advice: ClampingAdvice, machine: MachineProfile) -> dict[str, object]:
    more = {key: value for key, value in asdict(advice).items() if key not in ("span", "uncompensated_n")}
    return {
        "minimum_n": advice.span.least_n,
        "maximum_n": advice.span.most_n,
        "binding": advice.span.binding,
        "limits_n": limits_n(advice),
        "beyond": [name for name, force_n in limits_n(advice).items() if force_n > machine.chuck.max_force_n],
        **more,
    }


def limits_n(advice: ClampingAdvice) -> dict[str, float]:
    """Return each force limit, including that of a plain cut, which does not apply to a compensated one."""
    plain_n = advice.uncompensated_n
    return {**advice.span.limits_n, **({} if plain_n is None else {"uncompensated": plain_n})}


def beyond_spindle(seen: Envelope, machine: MachineProfile) -> list[str]:
    """Return the limits of the axis above the maximum spindle speed: they limit nothing."""
    return [name for name, rpm in seen.at_job.rpm.items() if rpm > machine.spindle.max_speed_rpm]


def high_at_jaws(job: Job, cut: CutError) -> bool | None:
    """Whether the part is high where the jaws were; None without a lobe, or between."""
    if cut.crest_deg is None:
        return None
    thin = is_thin(job.wall_thickness_mm, job.radius_mm)
    place = diagnose(crest_deg=cut.crest_deg, jaw_1_deg=job.jaw_1_deg, jaws=job.jaws, thin=thin)
    return place.high_at_jaws
