"""Two recorded runs side by side: their traces on one scale, and every figure of both in a table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from console.text.catalogue import Catalogue
from console.tui.lines import NOTHING, Line, dim, fitted, line, name_in, ranged, to_the_right
from console.tui.pages.preview_lines import AFTER_KEY, BEFORE_KEY
from console.tui.plot.polar_view import Mark, PolarTrace
from console.tui.records.list_lines import local
from console.tui.records.opened_run import OpenedRun, RecordedTrace
from console.tui.records.run_lines import jaw_harmonics, made_of
from console.tui.theme import Token
from profiles.files import printable
from profiles.own_values import number

_LABEL_LEAST = 13
_MARKS = {True: "✓", False: "✗", None: "·"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pair:
    """Two opened runs: the one that was marked, and the one that was opened beside it."""

    marked: OpenedRun
    other: OpenedRun

    @property
    def sides(self) -> tuple[OpenedRun, OpenedRun]:
        """Both, the marked one first."""
        return self.marked, self.other


def polar_of(traces: Sequence[tuple[RecordedTrace | None, Token, bool]]) -> tuple[list[PolarTrace], list[Mark]]:
    """Return what is plotted, with jaw 1 of all at the angle of the last; each with its token, or dashed."""
    shown = [(trace, token, dashed) for trace, token, dashed in traces if trace is not None]
    jaw_1_deg = shown[-1][0].jaw_1_deg if shown else None
    polar = [
        PolarTrace(
            angle_deg=trace.angle_deg + _turn_deg(trace, jaw_1_deg),
            deviation_um=trace.profile_um,
            token=token,
            dashed=dashed,
        )
        for trace, token, dashed in shown
    ]
    return polar, [] if jaw_1_deg is None else [Mark(angle_deg=jaw_1_deg, label="1")]


def _turn_deg(trace: RecordedTrace, jaw_1_deg: float | None) -> float:
    return 0.0 if jaw_1_deg is None or trace.jaw_1_deg is None else jaw_1_deg - trace.jaw_1_deg


def pair_caption(pair: Pair, um_per_division: float, text: Catalogue, width: int) -> list[Line]:
    """Return the legend of the two traces, and their scale."""
    rows = []
    for run, key in zip(pair.sides, (BEFORE_KEY, AFTER_KEY), strict=True):
        part = run.product
        ront = NOTHING if part is None else text.units.show(part.ront_um, "um", 2)
        token = Token.BEFORE if run is pair.marked else Token.AFTER
        rows.append(
            ranged(line((key, token), f" {local(run.story.row.started)}"), line((f" {ront}", token)), width)
        )
    scale = text("inspect_page.scale", value=text.units.short(um_per_division, "um"))
    untied = any(run.trace is not None and run.trace.jaw_1_deg is None for run in pair.sides)
    note = text("records_page.not_turned") if untied else text("records_page.turned")
    return [*rows, ranged(line(dim(note)), line(dim(" " + scale)), width)]


def pair_lines(pair: Pair, text: Catalogue, width: int) -> list[Line]:
    """Return the table of both runs, the most important rows first."""
    column = max((width - _LABEL_LEAST) // 2, 8)
    label = max(width - 2 * column, 1)
    rows = []
    for name, values in _rows(pair, text):
        cells = "".join(to_the_right(name_in(value, column - 1), column) for value in values)
        same = values[0] == values[1]
        rows.append(line(dim(fitted(name, label)), (cells, Token.DIM if same else Token.TEXT)))
    return rows


def _rows(pair: Pair, text: Catalogue) -> list[tuple[str, tuple[str, str]]]:
    """Return each row of the table with the values of both."""
    marked, other = (_values(run, text) for run in pair.sides)
    names = [*marked, *(name for name in other if name not in marked)]
    return [(name, (marked.get(name, NOTHING), other.get(name, NOTHING))) for name in names]


def _values(run: OpenedRun, text: Catalogue) -> dict[str, str]:
    row, part, job, units = run.story.row, run.product, run.job, text.units
    values = {units.unit("um"): local(row.started)[5:], text("records_page.job"): printable(row.job)}
    if part is not None:
        values["RONt"] = f"{units.figure(part.ront_um, 'um', 2)} {_MARKS[part.passed]}"
        for name in ("RONp", "RONv", "RONq"):
            values[name] = _shown(part.data.get(f"{name}_um"), lambda value: units.figure(value, "um", 2))
        if part.diameter_mm is not None:
            values[f"D {units.unit('mm')}"] = units.figure(part.diameter_mm, "mm", 3)
        harmonics = {text("inspect_page.harmonic", n=n): um_pp for n, um_pp in jaw_harmonics(part, run)}
        values |= {name: units.figure(um_pp, "um", 2) for name, um_pp in harmonics.items()}
    values[text("records_page.ended")] = text(f"records_page.how.{row.ended.how}")
    values[text("records_page.made")] = made_of(row, text)
    values[text("records_page.force_n")] = _shown(run.story.setup.get("force_n"), _one)
    values[f"{text('records_page.jaw')} °"] = _shown(run.story.setup.get("jaw_1_deg"), _one)
    if job is not None:
        values["rpm"] = f"{job.spindle_speed_rpm:.0f}"
        values[text("records_page.depth_mm")] = units.figure(job.depth_of_cut_mm, "mm", 3)
    values[text("records_page.of.alarms")] = str(len(run.story.alarms))
    values[text("records_page.machine")] = printable(row.machine)
    values[text("records_page.operator")] = printable(row.operator or NOTHING)
    return values


def _one(value: float) -> str:
    return f"{value:.1f}"


def _shown(value: object, form: Callable[[float], str]) -> str:
    try:
        return form(number(value))
    except (TypeError, ValueError):
        return NOTHING
