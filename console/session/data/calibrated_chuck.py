"""Machine with its chuck calibrations applied; every judgement of a job uses this machine.

The newest calibrations supply what the profile leaves open and what it lists under `assumed`, which nobody has
measured. What the profile otherwise states stays; where a calibration surely contradicts it, a warning says so.
The wrench line (slope and offset) comes as a whole from one source, with its uncertainty. A calibration of a
chuck of another name is not used; a warning says so.

The profile file and its hash stay unchanged: learned compensations and records refer to them. Signature, owner,
stopping performance and identification do not use these keys. Nothing heavy is imported for values,
because the screen opens with them; a contradiction needs the fit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from console.session.data.calibrations import Calibration, date_problems, files_of, load, newest, record_problem
from profiles.fields import fault, spelled
from profiles.files import printable
from profiles.machine import MachineProfile
from profiles.machine_fields import SECTIONS
from profiles.own_values import number, record
from profiles.problem import Problem, ProfileError
from profiles.store import LoadedMachine

if TYPE_CHECKING:
    from profiles.calibration.deflection import DeflectionFit
    from profiles.calibration.wrench import WrenchFit

WRENCH, JAWS = "wrench", "deflection"
"""The kinds of `profiles.calibration.table.CalibrationKind`, which loads numerics."""

LINE = ("force_per_torque_n_per_n_m", "force_offset_n")
OF_WRENCH = (*LINE, "force_sd_percent")
OF_JAWS = ("jaw_stiffness_n_per_um", "jaw_contact_exponent", "jaw_length_mm")

Variance = tuple[float, float, float]
"""Variance of the offset, covariance, variance of the slope of the wrench line."""

NO_VARIANCE: Variance = (0.0, 0.0, 0.0)

_FOUND = (*OF_WRENCH, *OF_JAWS)
_FIELDS = {field.key: field for field in SECTIONS["chuck"]}


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibratedMachine(LoadedMachine):
    """Machine with the calibrations of its chuck; path and hash are those of its profile's file.

    `sources` gives the source of each key of [chuck] that can be calibrated: the date of a calibration, or "" for
    the profile; a key without a value is not in it. `warnings` are contradictions, or why the calibrations are
    not used.
    """

    sources: Mapping[str, str]
    warnings: tuple[Problem, ...]

    @property
    def used(self) -> dict[str, str]:
        """Dates of the calibrations in use, by the keys of [chuck] that they supply."""
        return {key: date for key, date in self.sources.items() if date}


def calibrated(loaded: LoadedMachine, data: Path) -> CalibratedMachine:
    """Return a machine with the newest calibrations of its chuck from the data folder.

    Raises:
        ProfileError: `calibration.record`, not a calibration file; `calibration.unusable`, a value that no
            profile may have; `file.unreadable`, `file.too_large`.
    """
    machine = loaded.machine
    found: dict[str, tuple[float, str]] = {}
    warnings: list[Problem] = []
    variance = NO_VARIANCE
    for kind, may_say in ((WRENCH, OF_WRENCH), (JAWS, OF_JAWS)):
        of_chuck = newest(data, machine.name, kind, machine.chuck.name)
        if of_chuck is None:
            files = files_of(data, machine.name, kind)[:1]
            warnings += [_other_chuck(load(file, machine.name, kind), machine) for file in files]
            continue
        file, kept = of_chuck
        warnings += date_problems(file, kept)
        values = _values(kept, may_say, file)
        unset = {key: value for key, value in values.items() if _is_open(key, machine)}
        found |= {key: (value, kept.date) for key, value in unset.items()}
        if LINE[0] in unset:
            variance = _line_variance(kept, file)
        stated = {key: getattr(machine.chuck, key) for key in values if key not in unset}
        if stated:
            warnings += _contradictions(kept, stated, file)
    return _with(loaded, found, tuple(warnings), variance)


def calibrated_or_stated(loaded: LoadedMachine, data: Path) -> CalibratedMachine:
    """Return the same for a screen, which must open: where the calibrations cannot be read, without them.

    Then `warnings` has `calibration.not_used`, and each reason.
    """
    try:
        return calibrated(loaded, data)
    except ProfileError as error:
        return _with(loaded, {}, (Problem(code="calibration.not_used"), *error.problems))


def warnings_of(machine: LoadedMachine) -> tuple[Problem, ...]:
    """Return the calibration warnings of a machine; none for one that was loaded without calibrations."""
    return machine.warnings if isinstance(machine, CalibratedMachine) else ()


def calibrations_of(machine: LoadedMachine) -> dict[str, str]:
    """Return `used` of a machine; empty for one that was loaded without calibrations."""
    return machine.used if isinstance(machine, CalibratedMachine) else {}


def refuse_unusable(values: Mapping[str, Any], where: str) -> None:
    """Refuse (`calibration.unusable`) each value for a key of [chuck] that no profile may have."""
    code = "calibration.unusable"
    problems = [
        Problem(code=code, where=where, key=f"chuck.{key}", value=spelled(value), limit=_FIELDS[key].limit)
        for key, value in values.items()
        if fault(_FIELDS[key], value)
    ]
    if problems:
        raise ProfileError(*problems)


def _with(
    loaded: LoadedMachine,
    found: Mapping[str, tuple[float, str]],
    warnings: tuple[Problem, ...],
    variance: Variance = NO_VARIANCE,
) -> CalibratedMachine:
    """Put values with their dates into the chuck; measured values are no longer assumed."""
    machine, chuck = loaded.machine, loaded.machine.chuck
    given = {key: "" for key in _FOUND if getattr(chuck, key) is not None}
    dates = given | {key: date for key, (_, date) in found.items()}
    measured: dict[str, Any] = {key: value for key, (value, _) in found.items()}
    left = tuple(name for name in machine.assumed if name.removeprefix("chuck.") not in measured)
    return CalibratedMachine(
        machine=replace(machine, chuck=replace(chuck, **measured, force_line_variance=variance), assumed=left),
        path=loaded.path,
        sha256=loaded.sha256,
        text=loaded.text,
        sources={key: dates[key] for key in _FOUND if key in dates},
        warnings=warnings,
    )


def _is_open(key: str, machine: MachineProfile) -> bool:
    """Whether a profile leaves a key to a calibration: not given, or given as assumed."""
    together = LINE if key in LINE else (key,)
    return all(getattr(machine.chuck, each) is None or f"chuck.{each}" in machine.assumed for each in together)


def _values(kept: Calibration, may_say: tuple[str, ...], file: Path) -> dict[str, float]:
    """Return calibrated values by keys of [chuck]; a line through the origin has the offset 0."""
    said = kept.found.get("profile")
    if not isinstance(said, dict) or not said or not said.keys() <= set(may_say):
        raise record_problem(file, f"profile {said!r}")
    refuse_unusable(said, printable(str(file)))
    return ({LINE[1]: 0.0} if LINE[0] in said else {}) | said


def _line_variance(kept: Calibration, file: Path) -> Variance:
    """Return the covariance of offset and slope of a kept line: s^2 (X' X)^-1; refuse a file without it."""
    try:
        u00, u01, u11 = (number(each) for each in kept.found["covariance"])
        square = number(kept.found["sd_n"]) ** 2
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise record_problem(file, str(error)) from error
    variance = (square * u00, square * u01, square * u11)
    if not (all(math.isfinite(each) for each in variance) and variance[0] >= 0 and variance[2] >= 0):
        raise record_problem(file, f"covariance {kept.found['covariance']!r}")
    return variance


def _other_chuck(kept: Calibration, machine: MachineProfile) -> Problem:
    value, limit = f'"{printable(kept.chuck or "", 60)}"', f'"{machine.chuck.name}"'
    return Problem(code="calibration.other_chuck", where=kept.date, key="chuck.name", value=value, limit=limit)


def fit_of(kept: Calibration, file: Path) -> DeflectionFit | WrenchFit:
    """Return the fit that a calibration of a chuck keeps. Raises ProfileError: `calibration.record`."""
    from profiles.calibration.deflection import DeflectionFit
    from profiles.calibration.wrench import WrenchFit

    kind: type[DeflectionFit] | type[WrenchFit] = DeflectionFit if kept.kind == JAWS else WrenchFit
    try:
        return record(kind, {f.name: kept.found[f.name] for f in fields(kind) if f.name in kept.found})
    except (KeyError, TypeError, ValueError, ArithmeticError) as error:
        raise record_problem(file, str(error)) from error


def _contradictions(kept: Calibration, stated: Mapping[str, float | None], file: Path) -> list[Problem]:
    """Return `calibration.differs` for each key of [chuck] whose profile value a calibration contradicts."""
    from profiles.calibration.deflection import DeflectionFit

    fit = fit_of(kept, file)
    try:
        differ = _jaws_differ(fit, stated) if isinstance(fit, DeflectionFit) else _line_differs(fit, stated)
        return [
            Problem(code="calibration.differs", where=kept.date, key=f"chuck.{key}", value=value, limit=limit)
            for key, value, limit in differ
        ]
    except (KeyError, TypeError, ValueError, ArithmeticError) as error:
        raise record_problem(file, str(error)) from error


def _line_differs(line: WrenchFit, stated: Mapping[str, float | None]) -> Iterator[tuple[str, str, str]]:
    """Compare two lines at both ends of the measured force range."""
    slope = stated.get(LINE[0])
    if slope is None:
        return
    for torque_n_m in (line.highest_n_m, line.lowest_n_m):
        band = line.line_n(torque_n_m)
        said_n = (stated.get(LINE[1]) or 0.0) + slope * torque_n_m
        if not band.low <= said_n <= band.high:
            limit = f"{band.value:.4g} ± {band.high - band.value:.2g} N"
            yield f"{LINE[0]} ({torque_n_m:g} N m)", f"{said_n:.4g} N", limit
            return


def _jaws_differ(fit: DeflectionFit, stated: Mapping[str, float | None]) -> Iterator[tuple[str, str, str]]:
    """Compare each key that is stated with its half-width."""
    found = {
        "jaw_stiffness_n_per_um": (fit.stiffness_n_per_um, fit.stiffness_ci),
        "jaw_contact_exponent": (fit.alpha, fit.alpha_ci),
        "jaw_length_mm": (fit.jaw_length_mm, fit.jaw_length_ci),
    }
    for key, said in stated.items():
        value, half = found[key]
        if said is not None and abs(said - value) > half:
            yield key, f"{said:.4g}", f"{value:.4g} ± {half:.2g}"
