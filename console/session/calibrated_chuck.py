"""A machine whose chuck has been calibrated: what its profile leaves open comes from the newest calibrations.

What the profile says, it says: where a calibration surely contradicts it, that is told. The line of the wrench,
slope and offset, is one thing and comes from one place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeVar

from console.session.calibrations import Calibration, newest
from profiles.calibration.deflection import DeflectionFit
from profiles.calibration.table import CalibrationKind
from profiles.calibration.wrench import WrenchFit
from profiles.machine import Chuck, MachineProfile
from profiles.problem import Problem, ProfileError

LINE = ("force_per_torque_n_per_n_m", "force_offset_n")
SCATTER = "force_sd_percent"

Fit = TypeVar("Fit", WrenchFit, DeflectionFit)


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibratedMachine:
    """A machine with what calibrations add to its chuck.

    `sources` says where the keys of [chuck] that can be calibrated are from: the date of a calibration, or "" for
    the profile; a key that nobody gave is not in it. `warnings` are the contradictions.
    """

    machine: MachineProfile
    sources: Mapping[str, str]
    warnings: tuple[Problem, ...]


def calibrated(machine: MachineProfile, data: Path) -> CalibratedMachine:
    """Return a machine with the newest calibrations of its chuck, as they are kept in the data folder.

    Raises:
        ProfileError: `calibration.record`, a file that is none of ours; `file.unreadable`, `file.too_large`.
    """
    wrench = newest(data, machine.name, CalibrationKind.WRENCH)
    jaws = newest(data, machine.name, CalibrationKind.DEFLECTION)
    chuck = machine.chuck
    found: dict[str, tuple[float, str]] = {}
    warnings: list[Problem] = []
    if wrench is not None:
        line = _fit(wrench, WrenchFit)
        found |= {key: (value, wrench.date) for key, value in _of_wrench(line, chuck).items()}
        warnings += _line_differs(line, chuck, wrench.date)
    if jaws is not None:
        of_jaws = _of_jaws(_fit(jaws, DeflectionFit))
        found |= {key: (value, jaws.date) for key, (value, _) in of_jaws.items() if getattr(chuck, key) is None}
        warnings += _jaws_differ(of_jaws, chuck, jaws.date)
    keys = (*LINE, SCATTER, "jaw_stiffness_n_per_um", "jaw_contact_exponent", "jaw_length_mm")
    given = {key: "" for key in keys if getattr(chuck, key) is not None}
    values: dict[str, Any] = {key: value for key, (value, _) in found.items()}
    return CalibratedMachine(
        machine=replace(machine, chuck=replace(chuck, **values)),
        sources=given | {key: date for key, (_, date) in found.items()},
        warnings=tuple(warnings),
    )


def _fit(kept: Calibration, kind: type[Fit]) -> Fit:
    """Return the fit of a record: its numbers by their names."""
    try:
        found = {field.name: _frozen(kept.found[field.name]) for field in fields(kind)}
        return kind(**found)
    except (KeyError, TypeError) as error:
        value = f"{kept.kind} {kept.date}: {error}"
        raise ProfileError(Problem(code="calibration.record", where=kept.subject, value=value)) from error


def _frozen(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _of_wrench(line: WrenchFit, chuck: Chuck) -> dict[str, float]:
    """Return what the profile leaves open of the line and its scatter."""
    found: dict[str, float] = {}
    if chuck.force_per_torque_n_per_n_m is None:
        found = dict(zip(LINE, (line.slope_n_per_n_m, line.intercept_n), strict=True))
    if chuck.force_sd_percent is None:
        found[SCATTER] = line.force_sd_percent
    return found


def _of_jaws(fit: DeflectionFit) -> dict[str, tuple[float, float]]:
    """Return each key with its half-width; a length that was given to the fit is no finding."""
    found = {
        "jaw_stiffness_n_per_um": (fit.stiffness_n_per_um, fit.stiffness_ci),
        "jaw_contact_exponent": (fit.alpha, fit.alpha_ci),
    }
    return found | ({"jaw_length_mm": (fit.jaw_length_mm, fit.jaw_length_ci)} if fit.jaw_length_ci else {})


def _line_differs(line: WrenchFit, chuck: Chuck, date: str) -> list[Problem]:
    """Compare two lines by the forces at both ends of what was measured."""
    slope = chuck.force_per_torque_n_per_n_m
    if slope is None:
        return []
    for torque_n_m in (line.highest_n_m, line.lowest_n_m):
        band = line.line_n(torque_n_m)
        said_n = (chuck.force_offset_n or 0.0) + slope * torque_n_m
        if not band.low <= said_n <= band.high:
            limit = f"{band.value:.4g} ± {band.high - band.value:.2g} N"
            return [_differs(f"{LINE[0]} ({torque_n_m:g} N m)", f"{said_n:.4g} N", limit, date)]
    return []


def _jaws_differ(found: Mapping[str, tuple[float, float]], chuck: Chuck, date: str) -> list[Problem]:
    said = {key: getattr(chuck, key) for key in found}
    return [
        _differs(key, f"{said[key]:.4g}", f"{value:.4g} ± {half:.2g}", date)
        for key, (value, half) in found.items()
        if said[key] is not None and abs(said[key] - value) > half
    ]


def _differs(key: str, value: str, limit: str, date: str) -> Problem:
    return Problem(code="calibration.differs", where=date, key=f"chuck.{key}", value=value, limit=limit)
