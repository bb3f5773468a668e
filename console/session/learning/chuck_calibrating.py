"""The chuck from a table of measurements: the fit, what a profile would have of it, what speaks against it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path

from console.session.data.calibrated_chuck import HOLD, OF_HOLD, TYPED, large_step, refuse_unusable
from console.session.data.calibrations import Calibration, store
from console.session.data.kept_files import utc_now
from console.session.typed_number import plain_number
from profiles.calibration.deflection import DeflectionFit, fit_deflection
from profiles.calibration.plausible import refuse_untyped
from profiles.calibration.table import CalibrationKind, MeasuredTable
from profiles.calibration.wrench import WrenchFit, fit_wrench
from profiles.files import printable
from profiles.lobe.jaw_fit import StraightFit
from profiles.machine import MachineProfile
from profiles.materials import material_named
from profiles.problem import Problem, ProfileError
from profiles.store import LoadedMachine

TableFit = WrenchFit | DeflectionFit
ChuckFit = TableFit | StraightFit

WIDE_SLOPE = 0.10
"""Relative half-width of a slope above which the torque for a force is too uncertain to set by."""

NO_SCATTER = 1e-6
"""Scatter in % of the force, below which there is nothing but rounding."""


def fit_chuck_table(measured: MeasuredTable, machine: MachineProfile, *, affine: bool = False) -> TableFit:
    """Fit a table. Raises ProfileError: `calibration.*`, why it cannot be."""
    columns, meta = measured.columns, measured.meta
    if measured.kind is CalibrationKind.WRENCH:
        return fit_wrench(columns["torque_n_m"], columns["force_n"], affine=affine)
    if affine:
        raise ProfileError(Problem(code="calibration.affine", value=measured.kind))
    jaws = machine.chuck.jaws
    stated = meta.get("jaws", str(jaws))
    if stated != str(jaws):
        raise ProfileError(Problem(code="calibration.jaws_differ", value=printable(stated, 20), limit=str(jaws)))
    youngs_gpa = stated_number(meta, "youngs_modulus_gpa")
    if youngs_gpa is None:
        if "material" not in meta:
            raise ProfileError(Problem(code="calibration.no_modulus", limit="# youngs_modulus_gpa: 206"))
        youngs_gpa = material_named(meta["material"]).youngs_modulus_gpa
    jaw_length_mm = stated_number(meta, "jaw_length_mm")
    return fit_deflection(columns, jaws=jaws, youngs_gpa=youngs_gpa, jaw_length_mm=jaw_length_mm)


def stated_number(meta: Mapping[str, str], key: str) -> float | None:
    """Return the number in a header line, None without one.

    Raises ProfileError: `value.ambiguous`, as for a typed number; `calibration.not_positive`.
    """
    if key not in meta:
        return None
    value = _number(plain_number(meta[key], key, "> 0") or meta[key])
    if not (math.isfinite(value) and value > 0):
        shown = printable(meta[key], 60) or '""'
        raise ProfileError(Problem(code="calibration.not_positive", key=key, value=shown, limit="> 0"))
    return value


def chuck_calibration(
    loaded: LoadedMachine, measured: MeasuredTable | None, fit: ChuckFit, file: str, sha256: str = ""
) -> Calibration:
    """Return the calibration of a machine's chuck as it is kept, dated now; `file` is that of the measurements.

    Sections of a part are no `measured` table; they have the hash `sha256`.
    """
    return Calibration(
        kind=HOLD if measured is None else measured.kind,
        subject=loaded.machine.name,
        subject_sha256=loaded.sha256,
        date=utc_now(),
        file=file,
        file_sha256=sha256 if measured is None else measured.sha256,
        found={**asdict(fit), "profile": profile_values(fit)},
        chuck=loaded.machine.chuck.name,
    )


def keep_chuck(data: Path, calibration: Calibration, loaded: LoadedMachine, typed: float | None = None) -> Path:
    """Keep the calibration of a chuck, and return its file; `typed` is the value or the ratio of a large step.

    Raises ProfileError: `calibration.unusable`, a value that no profile may have; as `refuse_untyped` and `keep`.
    """
    where = printable(calibration.file)
    refuse_unusable(calibration.found["profile"], where)
    step = large_step(data, loaded, calibration)
    refuse_untyped(step, typed, where)
    confirmed = {} if step is None else {TYPED: step.value}
    return store(data, replace(calibration, found={**calibration.found, **confirmed}))


def profile_values(fit: ChuckFit) -> dict[str, float]:
    """Return the keys of [chuck] in a machine profile that this calibration determines."""
    if isinstance(fit, StraightFit):
        return {OF_HOLD[0]: fit.fraction}
    if isinstance(fit, DeflectionFit):
        found = {"jaw_stiffness_n_per_um": fit.stiffness_n_per_um, "jaw_contact_exponent": fit.alpha}
        return found | ({"jaw_length_mm": fit.jaw_length_mm} if fit.jaw_length_ci else {})
    found = {"force_per_torque_n_per_n_m": fit.slope_n_per_n_m}
    if fit.intercept_ci:
        found["force_offset_n"] = fit.intercept_n
    if fit.force_sd_percent > NO_SCATTER:  # a table without any does not predict the next clamping
        found["force_sd_percent"] = fit.force_sd_percent
    return found


def fit_warnings(fit: TableFit, measured: MeasuredTable, where: str) -> list[Problem]:
    """Return what speaks against a fit; `where` names the measurements."""
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
    if measured.numbers_read:
        value = printable(measured.numbers_read, 60)
        found.append(Problem(code="value.numbers_read", where=where, value=value))
    if measured.ignored:
        value = printable(", ".join(measured.ignored), 60)
        found.append(Problem(code="calibration.ignored", where=where, value=value))
    return found


def _number(text: str) -> float:
    """Return a number, not a number for anything else."""
    try:
        return float(text)
    except ValueError:
        return math.nan
