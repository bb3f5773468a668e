"""One calibration as numbers: its fit with the points that it rests on, as far as they are still there."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from console.session.data.calibrated_chuck import fit_of
from console.session.learning.chuck_calibrating import ChuckFit, fit_warnings, fitted, profile_values
from console.tui.calibrating.draft import Draft
from console.tui.calibrating.kept_list import LOBE, KeptCalibration
from profiles.calibration.table import MeasuredTable, read_table
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChuckFacts:
    """A fit, or why there is none (`problems`). `measured` are its points, None where they cannot be had.

    `lobe` are the kept numbers of a job's lobe.
    """

    fit: ChuckFit | None = None
    measured: MeasuredTable | None = None
    values: dict[str, float] = field(default_factory=dict)
    warnings: tuple[Problem, ...] = ()
    problems: tuple[Problem, ...] = ()
    lobe: dict[str, Any] | None = None


def draft_facts(draft: Draft, machine: MachineProfile) -> ChuckFacts:
    """Fit the points that were entered or imported; before the first one there is nothing to say yet."""
    if not (draft.rows or draft.content):
        return ChuckFacts()
    try:
        measured = draft.measured()
    except ProfileError as error:
        return ChuckFacts(problems=tuple(error.problems))
    try:
        fit = fitted(measured, machine, affine=draft.affine)
    except ProfileError as error:
        return ChuckFacts(measured=measured, problems=tuple(error.problems))
    return _facts(fit, measured)


def kept_facts(row: KeptCalibration) -> ChuckFacts:
    """Return what is kept, with its points where their file is still as it was."""
    kept = row.kept
    if kept is None:
        return ChuckFacts(problems=row.problems)
    if kept.kind == LOBE:
        return ChuckFacts(lobe=dict(kept.found))
    try:
        return replace(_facts(fit_of(kept, row.file), _points(row)), problems=row.problems)
    except ProfileError as error:
        return ChuckFacts(problems=tuple(error.problems))


def _facts(fit: ChuckFit, measured: MeasuredTable | None) -> ChuckFacts:
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
