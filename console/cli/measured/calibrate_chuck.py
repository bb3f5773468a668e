"""`console calibrate chuck`: force by torque, or the stiffness of the jaws, from a table of measurements."""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from console.cli.arguments import number_or_nan
from console.cli.library import data_of, machine_of, naming
from console.cli.output import show, tell
from console.session.data.calibrated_chuck import refuse_unusable
from console.session.data.calibrations import Calibration, date_problems, newest, store
from console.session.data.kept_files import utc_now
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.calibration.deflection import DeflectionFit, fit_deflection
from profiles.calibration.table import CalibrationKind, MeasuredTable, read_table
from profiles.calibration.wrench import Band, WrenchFit, fit_wrench
from profiles.files import printable
from profiles.machine import MachineProfile
from profiles.materials import material_named
from profiles.problem import Problem, ProfileError

Rows = list[tuple[str, ...]]

WIDE_SLOPE = 0.10
"""Relative half-width of a slope above which the torque for a force is too uncertain to set by."""

NO_SCATTER = 1e-6
"""Scatter in % of the force, below which there is nothing but rounding."""


def calibrate_chuck(options: Namespace, text: Catalogue) -> int:
    """Fit a table of measurements of a machine's chuck."""
    loaded, where, data = machine_of(options), printable(options.file), data_of(options)
    measured = read_table(Path(options.file), options.kind and CalibrationKind(options.kind))
    with naming(where):
        fit = _fitted(measured, loaded.machine, options.affine)
        rows = _rows(fit, measured, text)
        asked = _asked(fit, options)
        found = _profile_lines(fit)
        if options.keep:
            refuse_unusable(found, where)
    before = newest(data, loaded.machine.name, measured.kind, loaded.machine.chuck.name)
    calibration = Calibration(
        kind=measured.kind,
        subject=loaded.machine.name,
        subject_sha256=loaded.sha256,
        date=utc_now(),
        file=options.file,
        file_sha256=measured.sha256,
        found={**asdict(fit), "profile": found},
        chuck=loaded.machine.chuck.name,
    )
    kept = str(store(data, calibration)) if options.keep else None
    dated = () if before is None else date_problems(*before)
    warnings = tell((*_warnings(fit, measured, where), *dated), text)
    head = text("calibrate.chuck_head", machine=loaded.machine.name, file=where, rows=fit.points)
    rows += _asked_rows(asked, text)
    bands = {key: asdict(band) for key, band in asked.items()}
    show(
        options,
        lambda: {**asdict(calibration), "asked": bands, "kept": kept, "warnings": warnings},
        lambda: [head, *table(rows, numeric=(1,)), *_end(found, before and before[1], kept, text)],
    )
    return 0


def _end(found: dict[str, float], before: Calibration | None, kept: str | None, text: Catalogue) -> list[str]:
    """Return what the profile would have, beside what the previous calibration found, and where it was kept."""
    lines = ["", text("calibrate.profile", lines=_spelled(found))]
    if before is not None:
        previous = _spelled(before.found.get("profile", {}))
        lines = ["", text("calibrate.before", date=before.date, lines=previous), *lines]
    return [*lines, text("calibrate.kept", file=kept) if kept else text("calibrate.not_kept")]


def _fitted(measured: MeasuredTable, machine: MachineProfile, affine: bool) -> WrenchFit | DeflectionFit:
    columns, meta = measured.columns, measured.meta
    if measured.kind is CalibrationKind.WRENCH:
        return fit_wrench(columns["torque_n_m"], columns["force_n"], affine=affine)
    if affine:
        raise ProfileError(Problem(code="calibration.affine", value=measured.kind))
    jaws = machine.chuck.jaws
    stated = meta.get("jaws", str(jaws))
    if stated != str(jaws):
        raise ProfileError(Problem(code="calibration.jaws_differ", value=printable(stated, 20), limit=str(jaws)))
    youngs_gpa = _stated(meta, "youngs_modulus_gpa")
    if youngs_gpa is None:
        if "material" not in meta:
            raise ProfileError(Problem(code="calibration.no_modulus", limit="# youngs_modulus_gpa: 206"))
        youngs_gpa = material_named(meta["material"]).youngs_modulus_gpa
    return fit_deflection(columns, jaws=jaws, youngs_gpa=youngs_gpa, jaw_length_mm=_stated(meta, "jaw_length_mm"))


def _stated(meta: Mapping[str, str], key: str) -> float | None:
    """Return the number in a header line, None where there is none."""
    if key not in meta:
        return None
    value = number_or_nan(meta[key].replace(",", "."))
    if not (math.isfinite(value) and value > 0):
        shown = printable(meta[key], 60) or '""'
        raise ProfileError(Problem(code="calibration.not_positive", key=key, value=shown, limit="> 0"))
    return value


def _asked(fit: WrenchFit | DeflectionFit, options: Namespace) -> dict[str, Band]:
    """Return the force for a torque, and the torque for a force, requested on the command line."""
    torque_n_m, force_n = options.torque, options.force
    if not isinstance(fit, WrenchFit):
        if torque_n_m is not None or force_n is not None:
            raise ProfileError(Problem(code="calibration.affine", value=CalibrationKind.DEFLECTION))
        return {}
    asked = {} if torque_n_m is None else {f"torque {torque_n_m:g}": fit.force_n(torque_n_m)}
    return asked | ({} if force_n is None else {f"force {force_n:g}": fit.torque_n_m(force_n)})


def _asked_rows(asked: dict[str, Band], text: Catalogue) -> Rows:
    rows: Rows = []
    for key, band in asked.items():
        kind, _, value = key.partition(" ")
        limits = f"{band.low:.4g} … {band.high:.4g} {'N' if kind == 'torque' else 'N m'}"
        rows.append((text(f"calibrate.at_{kind}", value=value), f"{band.value:.4g}", limits))
    return rows


def _rows(fit: WrenchFit | DeflectionFit, measured: MeasuredTable, text: Catalogue) -> Rows:
    if isinstance(fit, WrenchFit):
        rows = [(text("calibrate.slope"), f"{fit.slope_n_per_n_m:.2f}", f"± {fit.slope_ci:.2f} N/(N m)")]
        if fit.intercept_ci:
            rows.append((text("calibrate.intercept"), f"{fit.intercept_n:.1f}", f"± {fit.intercept_ci:.1f} N"))
        return [*rows, (text("calibrate.scatter"), f"{fit.sd_n:.1f}", "N")]
    length_ci = f"± {fit.jaw_length_ci:.2f} mm" if fit.jaw_length_ci else f"mm, {text('calibrate.given')}"
    return [
        (text("calibrate.stiffness"), f"{fit.stiffness_n_per_um:.2f}", f"± {fit.stiffness_ci:.2f} N/um"),
        (text("calibrate.alpha"), f"{fit.alpha:.3f}", f"± {fit.alpha_ci:.3f}"),
        (text("calibrate.length"), f"{fit.jaw_length_mm:.2f}", length_ci),
        (text("calibrate.scatter"), f"{fit.sd_um:.3f}", "um"),
        *_softest(fit, measured, text),
    ]


def _softest(fit: DeflectionFit, measured: MeasuredTable, text: Catalogue) -> Rows:
    """Return the softest direction of the part under a rotating load."""
    place = int(measured.columns["deflection_um"].argmax())
    at = {key: float(measured.columns[key][place]) for key in ("chucking_force_n", "load_n", "overhang_mm")}
    seen = fit.anisotropy(**at, diameter_mm=float(measured.columns["diameter_mm"][place]))
    force, load, overhang = at.values()
    name = text("calibrate.anisotropy", force=f"{force:g}", load=f"{load:g}", overhang=f"{overhang:g}")
    mean = text("calibrate.of_mean", mean=f"{seen.mean_um:.2f}")
    return [(name, f"{seen.pp_um:.3f}", f"± {seen.pp_ci_um:.3f} um p-p, {mean}")]


def _profile_lines(fit: WrenchFit | DeflectionFit) -> dict[str, float]:
    """Return the keys of [chuck] in a machine profile that this calibration determines."""
    if isinstance(fit, DeflectionFit):
        found = {"jaw_stiffness_n_per_um": fit.stiffness_n_per_um, "jaw_contact_exponent": fit.alpha}
        return found | ({"jaw_length_mm": fit.jaw_length_mm} if fit.jaw_length_ci else {})
    found = {"force_per_torque_n_per_n_m": fit.slope_n_per_n_m}
    if fit.intercept_ci:
        found["force_offset_n"] = fit.intercept_n
    if fit.force_sd_percent > NO_SCATTER:  # a table without any does not predict the next clamping
        found["force_sd_percent"] = fit.force_sd_percent
    return found


def _spelled(lines: dict[str, float]) -> str:
    return ", ".join(f"{key} = {value:.4g}" for key, value in lines.items()) or "-"


def _warnings(fit: WrenchFit | DeflectionFit, measured: MeasuredTable, where: str) -> list[Problem]:
    found = [
        Problem(code="calibration.outlier", where=f"{where}:{measured.lines[place]}") for place in fit.outliers
    ]
    if isinstance(fit, WrenchFit):
        if fit.misses:
            value = f"{100 * (fit.lack_of_fit_chance or 0.0):.2g} %"
            found.append(Problem(code="calibration.lack_of_fit", where=where, value=value, limit=">= 5 %"))
        if fit.slope_ci > WIDE_SLOPE * fit.slope_n_per_n_m:
            value, limit = f"{100 * fit.slope_ci / fit.slope_n_per_n_m:.2g} %", f"<= {100 * WIDE_SLOPE:g} %"
            found.append(
                Problem(code="calibration.wide_slope", where=where, key="slope", value=value, limit=limit)
            )
    if measured.ignored:
        value = printable(", ".join(measured.ignored), 60)
        found.append(Problem(code="calibration.ignored", where=where, value=value))
    return found
