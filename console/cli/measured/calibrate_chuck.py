"""`console calibrate chuck` and `calibrate jaws`: force by torque or the stiffness of the jaws, from a table.

And how straight the jaws hold, from sections of a part that was cut without compensation.
"""

from __future__ import annotations

import hashlib
from argparse import Namespace
from dataclasses import asdict
from pathlib import Path

from console.cli.library import DEFAULT_MACHINE, SIM_OPTION, data_of, job_of, machine_of, naming
from console.cli.output import show, tell
from console.session.data.calibrated_chuck import large_step
from console.session.data.calibrations import Calibration, date_problems, newest
from console.session.data.run_reader import strategy_of_trace
from console.session.errors import refuse
from console.session.learning.chuck_calibrating import (
    chuck_calibration,
    fit_chuck_table,
    fit_warnings,
    keep_chuck,
    profile_values,
)
from console.session.learning.evaluated_part import place_heights
from console.text.catalogue import Catalogue
from console.text.columns import table
from drivers.cutting.strategy import UNCOMPENSATED
from profiles.calibration.deflection import DeflectionFit
from profiles.calibration.lobe import find_lobe
from profiles.calibration.table import CalibrationKind, MeasuredTable, read_table
from profiles.calibration.wrench import ConfidenceInterval, WrenchFit
from profiles.files import printable, read_regular_file
from profiles.lobe.jaw_fit import SectionLobe, fit_straight_fraction
from profiles.problem import Problem, ProfileError, refusal_error
from profiles.trace_files.header import header_of
from profiles.trace_files.sections import HEIGHT, read_sections
from profiles.traces import CAP_BYTES

OF_PHASE = ("lobe.phase_unknown", "lobe.not_significant")  # a section may be where the lobe changes its sign
Rows = list[tuple[str, ...]]


def calibrate_chuck(options: Namespace, text: Catalogue) -> int:
    """Fit a table of measurements of a machine's chuck."""
    loaded, where, data = (
        machine_of(options, f"--machine {DEFAULT_MACHINE}"),
        printable(options.file),
        data_of(options),
    )
    measured = read_table(Path(options.file), options.kind and CalibrationKind(options.kind))
    with naming(where):
        fit = fit_chuck_table(measured, loaded.machine, affine=options.affine)
        rows = _rows(fit, measured, text)
        asked = _convert_requested_values(fit, options)
        found = profile_values(fit)
    before = newest(data, loaded.machine.name, measured.kind, loaded.machine.chuck.name)
    calibration = chuck_calibration(loaded, measured, fit, options.file)
    kept = str(keep_chuck(data, calibration, loaded, options.confirm)) if options.keep else None
    dated = () if before is None else date_problems(*before)
    step = None if kept else large_step(data, loaded, calibration)
    doubts = () if step is None else (step.problem(where=where),)
    warnings = tell((*fit_warnings(fit, measured, where), *doubts, *dated), text)
    head = text("calibrate.chuck_head", machine=loaded.machine.name, file=where, rows=fit.points)
    rows += _asked_rows(asked, text)
    bands = {key: asdict(band) for key, band in asked.items()}
    show(
        options,
        lambda: {**asdict(calibration), "asked": bands, "kept": kept, "warnings": warnings},
        lambda: [head, *table(rows, numeric=(1,)), *_end(found, before and before[1], kept, text)],
    )
    return 0


def calibrate_jaws(options: Namespace, text: Catalogue) -> int:
    """Fit how the jaws of a machine hold to the sections of a plain part."""
    files = (options.file, *options.others)
    loaded, job, data = machine_of(options, SIM_OPTION), job_of(options).job, data_of(options)
    where, lobes, assumed = printable(", ".join(files)), list[SectionLobe](), False
    digest = hashlib.sha256()
    for file in files:
        content = read_regular_file(Path(file), cap_bytes=CAP_BYTES, area="trace")
        digest.update(content)
        strategy = strategy_of_trace(data, hashlib.sha256(content).hexdigest())
        if strategy not in (None, UNCOMPENSATED):
            raise refusal_error(
                "lobe.compensated", where=file, key="strategy", value=strategy, limit=UNCOMPENSATED
            )
        assumed |= strategy is None
    with naming(where):
        for section in read_sections([Path(file) for file in files]):
            if section.z_mm is None:
                raise refusal_error("trace.no_height", limit=f"# {HEIGHT}: Z")
            (z_mm,), _ = place_heights([section.z_mm], header_of(section.trace.meta)[0], job)
            found = find_lobe(section.trace, job, practice=options.sim)
            refuse([each for each in found.reasons if each.code not in OF_PHASE])
            assumed &= not {"strategy", "compensation"} & section.trace.meta.keys()
            lobe = found.fit.lobe
            at = complex(lobe.cos_um, -lobe.sin_um)
            lobes.append(SectionLobe(z_mm=z_mm or section.z_mm, lobe_um=at, sd_um=lobe.sd_um))
        fit = fit_straight_fraction(job, loaded.machine, lobes)
    calibration = chuck_calibration(loaded, None, fit, where, digest.hexdigest())
    kept = str(keep_chuck(data, calibration, loaded)) if options.keep else None
    warnings = tell([Problem(code="jaws.assumed_plain", where=where)] if assumed else (), text)
    heights = f"{fit.lowest_mm:g} … {fit.highest_mm:g} mm"
    rows = [(text("calibrate.straight"), f"{fit.fraction:.3f}", f"± {fit.sd:.2g}")]
    if fit.sections > 2:
        rows.append((text("calibrate.left"), f"{fit.left_um:.2f}", "um"))
    head = text("calibrate.jaws_head", machine=loaded.machine.name, count=fit.sections, heights=heights)
    show(
        options,
        lambda: {**asdict(calibration), "kept": kept, "warnings": warnings},
        lambda: [head, *table(rows, numeric=(1,)), *_end(profile_values(fit), None, kept, text)],
    )
    return 0


def _end(found: dict[str, float], before: Calibration | None, kept: str | None, text: Catalogue) -> list[str]:
    """Return what the profile would have, beside what the previous calibration found, and where it was kept."""
    lines = ["", text("calibrate.profile", lines=_format_values(found))]
    if before is not None:
        previous = _format_values(before.found.get("profile", {}))
        lines = ["", text("calibrate.before", date=before.date, lines=previous), *lines]
    return [*lines, text("calibrate.kept", file=kept) if kept else text("calibrate.not_kept")]


def _convert_requested_values(fit: WrenchFit | DeflectionFit, options: Namespace) -> dict[str, ConfidenceInterval]:
    """Return the force for a torque, and the torque for a force, requested on the command line."""
    torque_n_m, force_n = options.torque, options.force
    if not isinstance(fit, WrenchFit):
        if torque_n_m is not None or force_n is not None:
            raise ProfileError(Problem(code="calibration.affine", value=CalibrationKind.DEFLECTION))
        return {}
    asked = {} if torque_n_m is None else {f"torque {torque_n_m:g}": fit.force_n(torque_n_m)}
    return asked | ({} if force_n is None else {f"force {force_n:g}": fit.torque_n_m(force_n)})


def _asked_rows(asked: dict[str, ConfidenceInterval], text: Catalogue) -> Rows:
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


def _format_values(lines: dict[str, float]) -> str:
    return ", ".join(f"{key} = {value:.4g}" for key, value in lines.items()) or "-"
