"""Text of the page Calibrate: the list of calibrations, the fit with its confidence, the points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from console.text.catalogue import Catalogue
from console.tui.calibration.chuck_facts import CalibrationStatus, ChuckFacts, KeptCalibration
from console.tui.calibration.draft import Draft
from console.tui.lines import Line, dim, fact, fit_text, hanging, line, to_the_right, wrap_line
from console.tui.rows import list_rows, problem_lines
from console.tui.theme import Token
from console.units import Units
from profiles.calibration.table import COLUMNS, MeasuredTable
from profiles.calibration.wrench import WrenchFit
from profiles.fields import Field
from profiles.files import printable

LABEL_WIDTH = 32
WIDEST = 72
DATE = len("2001-11-30 14:05")
HEAD_ROWS = 1
COUNTS = (CalibrationStatus.IN_FORCE, CalibrationStatus.NEXT_START)


def list_lines(
    kept: Sequence[KeptCalibration], draft: Draft | None, selected: int, text: Catalogue, width: int, height: int
) -> list[Line]:
    """Return one row for each calibration, newest first; points that are not kept come before all."""
    rows = [] if draft is None else [(text("calibrate_page.draft", count=len(draft.rows)), Token.WARNING)]
    for each in kept:
        token = Token.TEXT if each.standing in (*COUNTS, CalibrationStatus.OF_JOB) else Token.DIM
        rows.append((_row_words(each, text), token))
    if not rows:
        return wrap_line(text("calibrate_page.none"), width, Token.DIM)
    return list_rows([(fit_text(words, max(width - 2, 0)), token) for words, token in rows], selected, height)


def _row_words(each: KeptCalibration, text: Catalogue) -> str:
    if each.kept is None:
        return f"{printable(each.file.name, 30)}  {text('calibrate_page.unreadable')}"
    date = printable(each.kept.date.replace("T", " ")[:DATE])
    if each.standing is CalibrationStatus.OF_JOB:
        error = each.kept.found.get("error_um_pp")
        shown = text.units.show(error, "um", 2) if isinstance(error, float) else ""
        return f"{date}  {printable(each.kept.subject, 40)}  {shown}"
    return f"{date}  {text(f'calibrate_page.{each.standing}')}"


def fit_lines(facts: ChuckFacts, kept: KeptCalibration | None, text: Catalogue, width: int) -> list[Line]:
    """Return the fit with its confidence, what it gives the machine, and what speaks against it."""
    room = min(width, WIDEST)
    if facts.lobe is not None and kept is not None:
        return _lobe_lines(facts.lobe, kept, text, width)
    lines = problem_lines(facts.problems, text, width)
    lines += [_value_line(text(f"calibrate.{key}"), value, room) for key, value in _fit_rows(facts, text)]
    if facts.values:
        values = ", ".join(f"{key} = {value:.4g}" for key, value in facts.values.items())
        lines += hanging(dim("  "), text("calibrate.profile", lines=values), width, Token.DIM)
    lines += problem_lines(facts.warnings, text, width)
    if kept is not None and kept.kept is not None:
        lines += hanging(dim("  "), text(f"calibrate_page.why.{kept.standing}"), width)
        source = printable(kept.kept.file, 200)
        lines += hanging(dim("  "), text("calibrate_page.rests_on", file=source), width, Token.DIM)
        if facts.fit is not None and facts.measured is None:
            lines += hanging(("! ", Token.WARNING), text("calibrate_page.points_gone"), width)
    return lines


def _fit_rows(facts: ChuckFacts, text: Catalogue) -> list[tuple[str, str]]:
    fit, hold = facts.fit, facts.hold
    if fit is None:
        return [] if hold is None else [("straight", f"{hold.fraction:.2f} ± {hold.sd:.2g}")]
    if isinstance(fit, WrenchFit):
        rows = [("slope", f"{fit.slope_n_per_n_m:.2f} ± {fit.slope_ci:.2f} N/(N m)")]
        if fit.intercept_ci:
            rows.append(("intercept", f"{fit.intercept_n:.1f} ± {fit.intercept_ci:.1f} N"))
        return [*rows, ("scatter", f"{fit.sd_n:.1f} N, {fit.force_sd_percent:.2g} %")]
    length = f"{text.units.show(fit.jaw_length_mm, 'mm', 2)}, {text('calibrate.given')}"
    if fit.jaw_length_ci:
        length = f"{text.units.figure(fit.jaw_length_mm, 'mm', 2)} ± {text.units.show(fit.jaw_length_ci, 'mm', 2)}"
    return [
        ("stiffness", f"{fit.stiffness_n_per_um:.2f} ± {fit.stiffness_ci:.2f} N/um"),
        ("alpha", f"{fit.alpha:.3f} ± {fit.alpha_ci:.3f}"),
        ("length", length),
        ("scatter", text.units.show(fit.sd_um, "um", 3)),
    ]


def _lobe_lines(lobe: dict[str, Any], kept: KeptCalibration, text: Catalogue, width: int) -> list[Line]:
    """Return the lobe that a job has taken from a part."""
    assert kept.kept is not None  # one without numbers has no lobe
    rows = [("error", "error_um_pp", "error_ci_um_pp", "um"), ("phase", "crest_deg", "crest_ci_deg", "°")]
    room, lines = min(width, WIDEST), list[Line]()
    for label, key, ci, unit in rows:
        value, half = lobe.get(key), lobe.get(ci)
        if isinstance(value, float) and isinstance(half, float):
            shown = f"{text.units.figure(value, unit, 2)} ± {text.units.show(half, unit, 2)}"
            lines.append(_value_line(text(f"calibrate.{label}"), shown + (" p-p" if unit == "um" else ""), room))
    past = lobe.get("past_jaw_deg")
    if isinstance(past, float):
        lines.append(_value_line(text("calibrate.past_jaw"), f"{past:.2f} °", room))
    job = text("calibrate_page.job", job=printable(kept.kept.subject, 60))
    source = text("calibrate_page.rests_on", file=printable(kept.kept.file, 200))
    lines += hanging(dim("  "), job, width) + hanging(dim("  "), source, width, Token.DIM)
    if lobe.get("simulated"):
        lines += hanging(("! ", Token.WARNING), text("calibrate_page.simulated"), width)
    return lines


def _value_line(label: str, value: str, width: int) -> Line:
    return (dim("  "), *fact(label, value, width - 2, label_width=min(LABEL_WIDTH, max(width // 2, 1))))


def point_lines(facts: ChuckFacts, draft: Draft | None, text: Catalogue, width: int, height: int) -> list[Line]:
    """Return the points, the newest at the end always in sight, each with what the fit leaves of it."""
    names, rows = _point_table(facts, draft, text.units)
    if not rows:
        return wrap_line(text("calibrate_page.no_points"), width, Token.DIM)
    cells = max(min(width // max(len(names), 1), 14), 4)
    head = line(dim("".join(to_the_right(fit_text(name, cells - 1).rstrip(), cells) for name in names)))
    out = set() if facts.fit is None else set(facts.fit.outliers)
    room = max(height - HEAD_ROWS, 1)
    shown = list(enumerate(rows))[-room:]
    return [
        head,
        *(
            line(
                (
                    "".join(to_the_right(value, cells) for value in row),
                    Token.WARNING if place in out else Token.TEXT,
                )
            )
            for place, row in shown
        ),
    ]


def _point_table(facts: ChuckFacts, draft: Draft | None, units: Units) -> tuple[list[str], list[list[str]]]:
    measured = facts.measured
    if measured is None:
        if draft is None:
            return [], []
        rows = [
            [units.format_short(value, field.unit) for value, field in zip(row, draft.fields, strict=True)]
            for row in draft.rows
        ]
        return [_column_heading(field, units) for field in draft.fields], rows
    fields = COLUMNS[measured.kind]
    columns = [
        [units.format_short(float(value), each.unit) for value in measured.columns[each.key]] for each in fields
    ]
    names = [_column_heading(each, units) for each in fields]
    if facts.fit is not None:
        names, columns = [*names, "res"], [*columns, _format_residuals(facts, measured, units)]
    return names, [list(row) for row in zip(*columns, strict=True)]


def _format_residuals(facts: ChuckFacts, measured: MeasuredTable, units: Units) -> list[str]:
    fit = facts.fit
    if isinstance(fit, WrenchFit):
        torque, force = measured.columns["torque_n_m"], measured.columns["force_n"]
        return [f"{value:+.1f}" for value in force - fit.intercept_n - fit.slope_n_per_n_m * torque]
    assert fit is not None  # ensured by the caller
    left = measured.columns["deflection_um"] - fit.deflections_um(measured.columns)
    return [units.figure(value, "um", 3, "+") for value in left.tolist()]


def _column_heading(field: Field, units: Units) -> str:
    """Return the heading of a column: quantity and unit."""
    short = {
        "torque_n_m": "Tq",
        "force_n": "F",
        "chucking_force_n": "Fc",
        "load_n": "P",
        "angle_deg": "",
        "diameter_mm": "d",
        "overhang_mm": "a",
        "deflection_um": "u",
    }
    return f"{short[field.key]} {units.unit(field.unit)}".strip()
