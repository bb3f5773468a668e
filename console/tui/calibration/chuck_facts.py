"""One calibration as numbers: its fit with the points that it rests on, as far as they are still there.

And the calibrations of a machine's chuck, newest first, with which of them counts; those of the lobes of all jobs.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from console.session.data.calibrated_chuck import (
    calibrated_or_stated,
    calibrations_of,
    fit_of,
    judged_calibrations,
)
from console.session.data.calibrations import FOLDER, Calibration, files_of, load
from console.session.data.kept_files import paths_in
from console.session.learning.chuck_calibrating import TableFit, fit_chuck_table, fit_warnings, profile_values
from console.tui.calibration.draft import Draft
from profiles.calibration.table import MeasuredTable, read_table
from profiles.lobe.jaw_fit import StraightFit
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError
from profiles.store import LoadedMachine, load_machine

LOBE = "lobe"
MOST = 200


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChuckFacts:
    """A fit, or why there is none (`problems`). `measured` are its points, None where they cannot be had.

    `lobe` are the kept numbers of a job's lobe, `hold` is the fit to sections of a part.
    """

    fit: TableFit | None = None
    measured: MeasuredTable | None = None
    values: dict[str, float] = field(default_factory=dict)
    warnings: tuple[Problem, ...] = ()
    problems: tuple[Problem, ...] = ()
    lobe: dict[str, Any] | None = None
    hold: StraightFit | None = None


def draft_facts(draft: Draft, machine: MachineProfile) -> ChuckFacts:
    """Fit the points that were entered or imported; before the first one there is nothing to say yet."""
    if not (draft.rows or draft.content):
        return ChuckFacts()
    try:
        measured = draft.measured_table()
    except ProfileError as error:
        return ChuckFacts(problems=tuple(error.problems))
    try:
        fit = fit_chuck_table(measured, machine, affine=draft.affine)
    except ProfileError as error:
        return ChuckFacts(measured=measured, problems=tuple(error.problems))
    return _facts(fit, measured)


class CalibrationStatus(StrEnum):
    """Whether a calibration counts, or why it does not."""

    IN_FORCE = "in_force"
    NEXT_START = "next_start"  # this console has read the calibrations when it began
    PROFILE = "profile"  # the profile states these values, and not as assumed
    OLDER = "older"
    OTHER_CHUCK = "other_chuck"
    IMPLAUSIBLE = "implausible"  # a large step that nobody has typed out
    UNREADABLE = "unreadable"
    OF_JOB = "of_job"


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptCalibration:
    """One file: its calibration, or why it cannot be read."""

    file: Path
    kept: Calibration | None
    standing: CalibrationStatus
    problems: tuple[Problem, ...] = ()


def kept_list(data: Path, machine: LoadedMachine, kind: str) -> tuple[KeptCalibration, ...]:
    """Return the calibrations of one kind. Raises ProfileError: `file.unreadable`, the folder or the profile."""
    if kind == LOBE:
        return lobe_list(data)
    name, chuck = machine.machine.name, machine.machine.chuck.name
    now_used = set(calibrations_of(machine).values())
    profile = load_machine(str(machine.path))
    next_used = set(calibrated_or_stated(profile, data).calibration_dates.values())
    steps = {each.file: each.step for each in judged_calibrations(data, profile.machine, kind)[0]}
    found: list[KeptCalibration] = []
    newest = True
    for file in files_of(data, name, kind)[:MOST]:
        try:
            kept = load(file, name, kind)
        except ProfileError as error:
            found.append(_unreadable(file, error))
            continue
        if kept.chuck not in (None, chuck):
            standing = CalibrationStatus.OTHER_CHUCK
        elif (step := steps.get(file)) is not None:
            why = (step.problem("calibration.step_kept", kept.date),)
            found.append(
                KeptCalibration(file=file, kept=kept, standing=CalibrationStatus.IMPLAUSIBLE, problems=why)
            )
            continue
        elif not newest:
            standing = CalibrationStatus.OLDER
        else:
            newest = False
            standing = CalibrationStatus.IN_FORCE if kept.date in now_used else CalibrationStatus.NEXT_START
            standing = standing if kept.date in next_used else CalibrationStatus.PROFILE
        found.append(KeptCalibration(file=file, kept=kept, standing=standing))
    return tuple(found)


def lobe_list(data: Path) -> tuple[KeptCalibration, ...]:
    """Return the calibrations of the lobes of all jobs, the newest by its date first."""
    found = []
    for folder in paths_in(data / FOLDER):
        subject = unquote(folder.name)
        for file in files_of(data, subject, LOBE):
            try:
                found.append(
                    KeptCalibration(file=file, kept=load(file, subject, LOBE), standing=CalibrationStatus.OF_JOB)
                )
            except ProfileError as error:
                found.append(_unreadable(file, error))
    found.sort(key=lambda each: ("" if each.kept is None else each.kept.date, each.file.name), reverse=True)
    return tuple(found[:MOST])


def _unreadable(file: Path, error: ProfileError) -> KeptCalibration:
    return KeptCalibration(
        file=file, kept=None, standing=CalibrationStatus.UNREADABLE, problems=tuple(error.problems)
    )


def kept_facts(row: KeptCalibration) -> ChuckFacts:
    """Return what is kept, with its points where their file is still as it was."""
    kept = row.kept
    if kept is None:
        return ChuckFacts(problems=row.problems)
    if kept.kind == LOBE:
        return ChuckFacts(lobe=dict(kept.found))
    try:
        fit = fit_of(kept, row.file)
        if isinstance(fit, StraightFit):
            return ChuckFacts(hold=fit, values=profile_values(fit), problems=row.problems)
        return replace(_facts(fit, _points(row)), problems=row.problems)
    except ProfileError as error:
        return ChuckFacts(problems=tuple(error.problems))


def _facts(fit: TableFit, measured: MeasuredTable | None) -> ChuckFacts:
    warnings = () if measured is None else tuple(fit_warnings(fit, measured, ""))
    return ChuckFacts(fit=fit, measured=measured, values=profile_values(fit), warnings=warnings)


def _points(row: KeptCalibration) -> MeasuredTable | None:
    """Return the measurements of a calibration: the file that it names, or one of that name beside it."""
    kept = row.kept
    assert kept is not None  # ensured by the caller
    for path in (Path(kept.file), row.file.parent / Path(kept.file).name):
        try:
            measured = read_table(path)
        except ProfileError:
            continue
        if measured.sha256 == kept.file_sha256:
            return measured
    return None
