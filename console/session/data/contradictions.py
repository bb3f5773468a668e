"""Contradictions between a machine profile's chuck values and a calibration."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import TypeVar

from console.session.data.calibrations import Calibration, record_problem
from profiles.calibration.deflection import DeflectionFit
from profiles.calibration.table import CalibrationKind
from profiles.calibration.wrench import WrenchFit
from profiles.own_values import record
from profiles.problem import Problem

Fit = TypeVar("Fit", WrenchFit, DeflectionFit)

SLOPE, OFFSET = "force_per_torque_n_per_n_m", "force_offset_n"


def contradictions(kept: Calibration, stated: Mapping[str, float | None], file: Path) -> list[Problem]:
    """Return `calibration.differs` for each key of [chuck] whose profile value a calibration contradicts.

    Raises:
        ProfileError: `calibration.record`, the file has no fit of its kind.
    """
    try:
        if kept.kind == CalibrationKind.DEFLECTION:
            return list(_jaws_differ(_fit(kept, DeflectionFit), stated, kept.date))
        return list(_line_differs(_fit(kept, WrenchFit), stated, kept.date))
    except (KeyError, TypeError, ValueError, ArithmeticError) as error:
        raise record_problem(file, str(error)) from error


def _fit(kept: Calibration, kind: type[Fit]) -> Fit:
    """Return the stored fit, by the names of its numbers."""
    return record(kind, {f.name: kept.found[f.name] for f in fields(kind) if f.name in kept.found})


def _line_differs(line: WrenchFit, stated: Mapping[str, float | None], date: str) -> Iterator[Problem]:
    """Compare two lines at both ends of the measured force range."""
    slope = stated.get(SLOPE)
    if slope is None:
        return
    for torque_n_m in (line.highest_n_m, line.lowest_n_m):
        band = line.line_n(torque_n_m)
        said_n = (stated.get(OFFSET) or 0.0) + slope * torque_n_m
        if not band.low <= said_n <= band.high:
            limit = f"{band.value:.4g} ± {band.high - band.value:.2g} N"
            yield _differs(f"{SLOPE} ({torque_n_m:g} N m)", f"{said_n:.4g} N", limit, date)
            return


def _jaws_differ(fit: DeflectionFit, stated: Mapping[str, float | None], date: str) -> Iterator[Problem]:
    """Compare each key that is stated with its half-width."""
    found = {
        "jaw_stiffness_n_per_um": (fit.stiffness_n_per_um, fit.stiffness_ci),
        "jaw_contact_exponent": (fit.alpha, fit.alpha_ci),
        "jaw_length_mm": (fit.jaw_length_mm, fit.jaw_length_ci),
    }
    for key, said in stated.items():
        value, half = found[key]
        if said is not None and abs(said - value) > half:
            yield _differs(key, f"{said:.4g}", f"{value:.4g} ± {half:.2g}", date)


def _differs(key: str, value: str, limit: str, date: str) -> Problem:
    return Problem(code="calibration.differs", where=date, key=f"chuck.{key}", value=value, limit=limit)
