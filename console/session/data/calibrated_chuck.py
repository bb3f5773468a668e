"""Machine with its chuck calibrations applied; every judgement of a job uses this machine.

The newest calibrations supply what the profile leaves open and what it lists under `assumed`, which nobody has
measured. What the profile otherwise states stays; where a calibration surely contradicts it, a warning says so.
The wrench line (slope and offset) comes as a whole from one source, with its uncertainty. A calibration of a
chuck of another name is not used; a warning says so. Nor is one that is a large step from the profile, or from
those before it, and was not typed out: whoever kept it may have taken one unit for another.

The profile file and its hash stay unchanged: learned compensations and records refer to them. Signature, owner,
stopping performance and identification do not use these keys. Nothing heavy is imported for values,
because the screen opens with them; a contradiction needs the fit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from console.session.data.calibrations import Calibration, date_problems, files_of, load, record_problem
from profiles.calibration.plausible import QUANTITIES, ImplausibleStep, step_of, worst_step
from profiles.chucking.holding import holding_of
from profiles.fields import fault, spell_toml
from profiles.files import printable
from profiles.machine import MachineProfile
from profiles.machine_fields import SECTIONS
from profiles.problem import Problem, ProfileError
from profiles.store import LoadedMachine, load_machine
from profiles.strict_values import number, number_or_none, record

if TYPE_CHECKING:
    from profiles.calibration.deflection import DeflectionFit
    from profiles.calibration.wrench import WrenchFit
    from profiles.lobe.jaw_fit import StraightFit

WRENCH, JAWS, HOLD = "wrench", "deflection", "hold"
"""The kinds of `profiles.calibration.table.CalibrationKind`, which loads numerics; and how the jaws hold."""

LINE = ("force_per_torque_n_per_n_m", "force_offset_n")
OF_WRENCH = (*LINE, "force_sd_percent")
OF_JAWS = ("jaw_stiffness_n_per_um", "jaw_contact_exponent", "jaw_length_mm")

OF_HOLD = ("jaw_straight_fraction",)

GIVES = {WRENCH: OF_WRENCH, JAWS: OF_JAWS, HOLD: OF_HOLD}
"""The keys of [chuck] that a calibration of each kind may give."""

TYPED = "typed"  # under this name a calibration keeps the large step that was typed out

Variance = tuple[float, float, float]
"""Variance of the offset, covariance, variance of the slope of the wrench line."""

NO_VARIANCE: Variance = (0.0, 0.0, 0.0)

_FOUND = (*OF_WRENCH, *OF_JAWS, *OF_HOLD)
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
    def calibration_dates(self) -> dict[str, str]:
        """Dates of the calibrations in use, by the keys of [chuck] that they supply."""
        return {key: date for key, date in self.sources.items() if date}


def apply_calibrations(loaded: LoadedMachine, data: Path) -> CalibratedMachine:
    """Return a machine with the newest calibrations of its chuck from the data folder.

    Raises:
        ProfileError: `calibration.record`, not a calibration file; `calibration.unusable`, a value that no
            profile may have; `file.unreadable`, `file.too_large`.
    """
    machine = loaded.machine
    found: dict[str, tuple[float, str]] = {}
    warnings: list[Problem] = []
    variance = NO_VARIANCE
    for kind in GIVES:
        of_chuck, broken = judged_calibrations(data, machine, kind)
        if broken is not None:
            raise broken
        if not of_chuck:
            files = files_of(data, machine.name, kind)[:1]
            warnings += [_other_chuck(load(file, machine.name, kind), machine) for file in files]
            continue
        if (step := of_chuck[-1].step) is not None:
            warnings.append(step.problem("calibration.step_kept", of_chuck[-1].kept.date))
        newest = next((each for each in reversed(of_chuck) if each.step is None), None)
        if newest is None:
            continue
        file, kept, values = newest.file, newest.kept, newest.values
        warnings += date_problems(file, kept)
        unset = {key: value for key, value in values.items() if _is_open(key, machine)}
        found |= {key: (value, kept.date) for key, value in unset.items()}
        if LINE[0] in unset:
            variance = _line_variance(kept, file)
        stated = {key: getattr(machine.chuck, key) for key in values if key not in unset}
        if stated:
            warnings += _contradictions(kept, stated, file)
    return _put_calibrated_values(loaded, found, tuple(warnings), variance)


def calibrated_or_stated(loaded: LoadedMachine, data: Path) -> CalibratedMachine:
    """Return the same for a screen, which must open: where the calibrations cannot be read, without them.

    Then `warnings` has `calibration.not_used`, and each reason.
    """
    try:
        return apply_calibrations(loaded, data)
    except ProfileError as error:
        return _put_calibrated_values(loaded, {}, (Problem(code="calibration.not_used"), *error.problems))


class JudgedCalibration(NamedTuple):
    """A kept calibration with the keys of [chuck] that it gives; not used after a `step` that nobody typed out."""

    file: Path
    kept: Calibration
    values: Mapping[str, float]
    step: ImplausibleStep | None = None


def judged_calibrations(
    data: Path, machine: MachineProfile, kind: str
) -> tuple[list[JudgedCalibration], ProfileError | None]:
    """Return the calibrations of a machine's chuck, oldest first, each compared with the profile and those before.

    `machine` is that of the profile. The error is why files newer than all of these cannot be used.
    """
    found: list[JudgedCalibration] = []
    broken = None
    for file in reversed(files_of(data, machine.name, kind)):
        try:
            kept = load(file, machine.name, kind)
            if kept.chuck in (None, machine.chuck.name):
                new = JudgedCalibration(file, kept, _values(kept, file))
                step, typed = _step(new, machine, found), number_or_none(kept.found.get(TYPED))
                found.append(new if step is None or step.is_typed(typed) else new._replace(step=step))
                broken = None
        except ProfileError as error:
            broken = error
    return found, broken


def large_step(data: Path, loaded: LoadedMachine, calibration: Calibration) -> ImplausibleStep | None:
    """Return the large step of a calibration that is not kept yet, from its profile or those before."""
    machine = load_machine(str(loaded.path)).machine
    new = JudgedCalibration(Path(calibration.file), calibration, calibration.found["profile"])
    return _step(new, machine, judged_calibrations(data, machine, calibration.kind)[0])


def _step(
    new: JudgedCalibration, machine: MachineProfile, before: Sequence[JudgedCalibration]
) -> ImplausibleStep | None:
    """Return the largest step; what was last typed out counts in place of the profile, as small steps add up."""
    stated = ((key, getattr(machine.chuck, key)) for key in _FOUND)
    anchor = newest = {key: value for key, value in stated if value is not None}
    for each in before:
        if each.step is None:
            newest = {**newest, **each.values}
            anchor = newest if TYPED in each.kept.found else anchor
    kind, found = new.kept.kind, new.kept.found
    try:
        ends = [number(found[key]) for key in ("lowest_n_m", "highest_n_m")] if kind == WRENCH else []
        of_bar = {"youngs_modulus_gpa": number(found["youngs_gpa"])} if kind == JAWS else {}
        at, *known = (_comparable_values(each, ends) for each in ({**new.values, **of_bar}, anchor, newest))
    except (KeyError, TypeError, ValueError, ArithmeticError) as error:
        raise record_problem(new.file, str(error)) from error
    return worst_step(step_of(key[0], at[key], [each[key] for each in known if key in each]) for key in at)


def _comparable_values(
    values: Mapping[str, float], torques_n_m: Sequence[float]
) -> dict[tuple[str, float], float]:
    """Return what is compared of a calibration by key and torque: of the line, its force for each N m there."""
    found = {(key, 0.0): values[key] for key in QUANTITIES if key in values and key != LINE[0]}
    if LINE[0] in values:
        offset_n = values.get(LINE[1], 0.0)
        found |= {(LINE[0], each): values[LINE[0]] + offset_n / each for each in torques_n_m}
    return found


def warnings_of(machine: LoadedMachine) -> tuple[Problem, ...]:
    """Return the calibration warnings of a machine; none for one that was loaded without calibrations."""
    return machine.warnings if isinstance(machine, CalibratedMachine) else ()


def calibrations_of(machine: LoadedMachine) -> dict[str, str]:
    """Return `calibration_dates` of a machine; empty for one that was loaded without calibrations."""
    return machine.calibration_dates if isinstance(machine, CalibratedMachine) else {}


def refuse_unusable(values: Mapping[str, Any], where: str) -> None:
    """Refuse (`calibration.unusable`) each value for a key of [chuck] that no profile may have."""
    code = "calibration.unusable"
    problems = [
        Problem(code=code, where=where, key=f"chuck.{key}", value=spell_toml(value), limit=_FIELDS[key].limit)
        for key, value in values.items()
        if fault(_FIELDS[key], value)
    ]
    if problems:
        raise ProfileError(*problems)


def _put_calibrated_values(
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
    if found:
        stated = holding_of(machine)
        measured["uncalibrated_jaw_length_mm"] = stated.jaw_length_mm
        measured["uncalibrated_force_sd_percent"] = 100 * stated.force_sd_fraction
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


def _values(kept: Calibration, file: Path) -> dict[str, float]:
    """Return calibrated values by keys of [chuck]; a line through the origin has the offset 0."""
    said = kept.found.get("profile")
    if not isinstance(said, dict) or not said or not said.keys() <= set(GIVES[kept.kind]):
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


def fit_of(kept: Calibration, file: Path) -> DeflectionFit | WrenchFit | StraightFit:
    """Return the fit that a calibration of a chuck keeps. Raises ProfileError: `calibration.record`."""
    from profiles.calibration.deflection import DeflectionFit
    from profiles.calibration.wrench import WrenchFit
    from profiles.lobe.jaw_fit import StraightFit

    kinds: dict[str, type[DeflectionFit | WrenchFit | StraightFit]] = {JAWS: DeflectionFit, HOLD: StraightFit}
    kind = kinds.get(kept.kind, WrenchFit)
    try:
        return record(kind, {f.name: kept.found[f.name] for f in fields(kind) if f.name in kept.found})
    except (KeyError, TypeError, ValueError, ArithmeticError) as error:
        raise record_problem(file, str(error)) from error


def _contradictions(kept: Calibration, stated: Mapping[str, float | None], file: Path) -> list[Problem]:
    """Return `calibration.differs` for each key of [chuck] whose profile value a calibration contradicts."""
    from profiles.calibration.wrench import WrenchFit

    fit = fit_of(kept, file)
    try:
        differ = _line_differs(fit, stated) if isinstance(fit, WrenchFit) else _jaws_differ(fit, stated)
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


def _jaws_differ(
    fit: DeflectionFit | StraightFit, stated: Mapping[str, float | None]
) -> Iterator[tuple[str, str, str]]:
    """Compare each key that is stated with its half-width."""
    from profiles.calibration.deflection import DeflectionFit

    if isinstance(fit, DeflectionFit):
        found = {
            "jaw_stiffness_n_per_um": (fit.stiffness_n_per_um, fit.stiffness_ci),
            "jaw_contact_exponent": (fit.alpha, fit.alpha_ci),
            "jaw_length_mm": (fit.jaw_length_mm, fit.jaw_length_ci),
        }
    else:
        found = {OF_HOLD[0]: (fit.fraction, 2.0 * fit.sd)}
    for key, said in stated.items():
        value, half = found[key]
        if said is not None and abs(said - value) > half:
            yield key, f"{said:.4g}", f"{value:.4g} ± {half:.2g}"
