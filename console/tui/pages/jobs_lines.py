"""Text of the page Jobs: the table of the saved jobs, and a summary of one of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from rich.cells import cell_len

from console.session.data.history import LastResult, LastResults
from console.text.along_length import ront_words
from console.text.catalogue import Catalogue
from console.text.job_words import lobe_number
from console.tui.lines import BLANK, NOTHING, Line, dim, fact, fit_text, hanging, line, name_among, wrap_line
from console.tui.pages.fields import provenance
from console.tui.theme import Token
from console.units import Units
from drivers.cutting.strategy import UNCOMPENSATED
from profiles.files import printable
from profiles.job import NO_LOBE, Job
from profiles.lobe.lobe_conditions import lobe_source
from profiles.lobe.lobe_origin import MODEL
from profiles.problem import Problem
from profiles.store import LibraryEntry, LoadedJob

Loaded = LoadedJob | tuple[Problem, ...]  # a job, or why its file cannot be read
OPEN = "●"
_NAME_LEAST = 16
_NAME_IN_FULL = 30  # cells of the name beside which further columns are shown
_FURTHER = (("measured", 12), ("chucking", 8), ("labels", 16))
_ROWS_WITH_PARTS = 24  # rows of the summary from which it has the parts that were measured
_LABEL = 15
_SUMMARY_WIDTH = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class JobList:
    """The saved jobs, the index of the selected one, and how to read each: only visible ones are read."""

    entries: Sequence[LibraryEntry]
    selected: int
    load: Callable[[LibraryEntry], Loaded]
    results: LastResults
    simulated: bool
    open_path: Path | None = None

    @property
    def entry(self) -> LibraryEntry | None:
        """The selected one, None where there are no jobs."""
        return self.entries[self.selected] if self.entries else None


def table_lines(jobs: JobList, text: Catalogue, width: int, height: int) -> list[Line]:
    """Return the header and the rows around the selected job."""
    if not jobs.entries:
        return [line(text("jobs_page.none"))][: max(height, 0)]
    columns = _columns(width)
    name_width = max(width - 2 - sum(cells for _, cells in columns), 1)
    header = fit_text("  " + text("jobs_page.name"), name_width + 2)
    header += "".join(_align_right(text(f"jobs_page.{name}"), cells) for name, cells in columns)
    seen = visible(jobs, height)
    rows = [_row(jobs, place, seen, columns, name_width, text) for place in seen]
    return [(dim(header),), *rows][: max(height, 0)]


def visible(jobs: JobList, height: int) -> range:
    """Return the indexes of the jobs visible in a table of this height, header included."""
    room = max(height - 1, 1)
    first = min(max(jobs.selected - room // 2, 0), max(len(jobs.entries) - room, 0))
    return range(first, min(first + room, len(jobs.entries)))


def hidden_words(jobs: JobList, text: Catalogue, height: int) -> str:
    """Return how many jobs are above and below the visible ones, "" for none."""
    seen = visible(jobs, height)
    below = len(jobs.entries) - seen.stop
    above_words = "↑ " + text("jobs_page.above", count=seen.start) if seen.start else ""
    below_words = "↓ " + text("jobs_page.below", count=below) if below > 0 else ""
    return "  ".join(filter(None, (above_words, below_words)))


def summary_lines(
    jobs: JobList, text: Catalogue, width: int, height: int | None = None, *, edited: bool
) -> list[Line]:
    """Return the details of the selected job, the most important first; in a tall panel its latest parts, too."""
    entry = jobs.entry
    if entry is None:
        return []
    loaded = jobs.load(entry)
    if not isinstance(loaded, LoadedJob):
        return _reasons(entry, loaded, text, width)
    room = min(width, _SUMMARY_WIDTH)
    kept = text("jobs.bundled") if entry.bundled else text("jobs.own")
    lines: list[Line] = [line(("! " + text("jobs_page.in_hand"), Token.WARNING))] if edited else []
    if entry.path == jobs.open_path and not edited:
        lines = [line((f"{OPEN} {text('jobs_page.open')}", Token.STRONG))]
    last = jobs.results.get(loaded.job.name)
    rows = [
        *lines,
        *_label_lines(loaded.job, text, width),
        *job_lines(loaded.job, text, room),
        *_last_lines(last, jobs.simulated, text, room),
        _fact(text("jobs_page.revision"), f"{loaded.sha256[:6]}, {kept}", room),
        *wrap_line(provenance(loaded.job, text), width, Token.DIM),
    ]
    if last is not None and height is not None and height >= _ROWS_WITH_PARTS:
        rows += [BLANK, *_part_lines(last, text, room)[: max(height - len(rows) - 1, 0)]]
    return rows


def _part_lines(last: LastResult, text: Catalogue, width: int) -> list[Line]:
    """Return the latest measured parts of a job, newest first."""
    title = line((text("jobs_page.latest", count=len(last.recent)), Token.TITLE))
    return [
        title,
        *(
            _fact(
                at.astimezone().strftime("%Y-%m-%d %H:%M"),
                f"{strategy}  {_ront(ront_um, text.units, 2):>8} {text.units.unit('um')}",
                width,
            )
            for at, ront_um, strategy in reversed(last.recent)
        ),
    ]


def _columns(width: int) -> list[tuple[str, int]]:
    """Return name and cells of the columns after that of the job; wide tables have more of them."""
    columns = [("material", 6), ("diameter", 7), ("last", 8)]
    if width >= 62:
        columns[2:2] = [("speed", 8), ("error", 9)]
    while columns and width - 2 - sum(cells for _, cells in columns) < _NAME_LEAST:
        del columns[0]
    room = width - 2 - sum(cells for _, cells in columns) - _NAME_IN_FULL
    for name, cells in _FURTHER:
        if cells <= room:
            columns.append((name, cells))
            room -= cells
    return columns


def _row(
    jobs: JobList, place: int, seen: range, columns: Sequence[tuple[str, int]], name_width: int, text: Catalogue
) -> Line:
    entry, chosen = jobs.entries[place], place == jobs.selected
    loaded = jobs.load(entry)
    marks = ("▸" if chosen else " ") + (OPEN if entry.path == jobs.open_path else " ")
    others = tuple(printable(jobs.entries[each].name) for each in seen)
    name = fit_text(marks + name_among(printable(entry.name), others, name_width), name_width + 2)
    if not isinstance(loaded, LoadedJob):
        reason = _align_right("✗ " + text("jobs_page.unreadable"), sum(cells for _, cells in columns))
        return ((name + reason, Token.SELECTED),) if chosen else line(name, (reason, Token.WARNING))
    last = jobs.results.get(loaded.job.name)
    name += "".join(_align_right(_value(column, loaded.job, last, text.units), cells) for column, cells in columns)
    return ((name, Token.SELECTED if chosen else Token.TEXT),)


def _value(column: str, job: Job, last: LastResult | None, units: Units) -> str:
    """Return what a job has in a column."""
    match column:
        case "material":
            return job.material
        case "diameter":
            return units.figure(job.diameter_mm, "mm", 1)
        case "speed":
            return f"{job.spindle_speed_rpm:.0f}"
        case "error":
            return lobe_number(job, units)
        case "chucking":
            return f"{job.chucking_force_n:.0f}"
        case "labels":
            return printable(" ".join(job.tags))
        case "measured":
            return NOTHING if last is None else _day(last.measured_at)
        case _:
            return NOTHING if last is None else _ront(last.ront_um, units, 1)


def _ront(ront_um: float | None, units: Units, digits: int) -> str:
    return NOTHING if ront_um is None else units.figure(ront_um, "um", digits)


def _day(at: datetime) -> str:
    return at.astimezone().date().isoformat()


def _reasons(entry: LibraryEntry, problems: Sequence[Problem], text: Catalogue, width: int) -> list[Line]:
    lines = [line(("✗ " + text("jobs_page.unreadable"), Token.WARNING))]
    lines += wrap_line(printable(str(entry.path)), width, Token.DIM)
    for problem in problems:
        lines += hanging(("· ", Token.TEXT), text.problem(replace(problem, where="")), width)
    return lines


def job_lines(job: Job, text: Catalogue, width: int) -> list[Line]:
    """Return what is cut and how, a line for each value."""
    solid = job.wall_thickness_mm >= job.radius_mm
    form = text("jobs_page.bar" if solid else "jobs_page.tube", material=job.material)
    diameter, wall = (text.units.figure(each, "mm", 1) for each in (job.diameter_mm, job.wall_thickness_mm))
    size = f"D {diameter}" + ("" if solid else f" x {wall}") + f" {text.units.unit('mm')}"
    lobe = text("jobs_page.jaws", count=job.jaws, frequency=f"{job.lobe_frequency_hz:.1f}")
    rows: tuple[tuple[str, str], ...] = (
        (text("jobs_page.part"), form),
        (text("jobs_page.outside") if solid else text("jobs_page.size"), size),
        (text("jobs_page.overhang"), text.units.show(job.overhang_mm, "mm", 3)),
        (
            text("jobs_page.force"),
            _mark_assumed_value(job, "chucking_force_n", f"{job.chucking_force_n:.1f} N", text),
        ),
        (
            text("jobs_page.depth"),
            _mark_assumed_value(job, "depth_of_cut_mm", text.units.show(job.depth_of_cut_mm, "mm", 3), text),
        ),
        (text("jobs_page.spindle"), f"{job.spindle_speed_rpm:.1f} rpm"),
        (text("jobs_page.lobe"), lobe),
        (text("jobs_page.uncompensated"), _lobe_error(job, text)),
        (text("jobs_page.tolerance"), text.units.show(job.roundness_tolerance_um, "um", 1)),
    )
    if job.cylindricity_tolerance_um is not None:
        rows += ((text("jobs_page.cylindricity"), text.units.show(job.cylindricity_tolerance_um, "um", 1)),)
    return [_fact(label, value, width) for label, value in rows]


def _lobe_error(job: Job, text: Catalogue) -> str:
    """Return the lobe error with its source, in a word that leaves room for the number."""
    name = lobe_source(job)
    source = text("jobs_page.model" if name == MODEL else f"source.{name}")
    if job.lobe_error_source == NO_LOBE:
        return source
    return f"{source} {lobe_number(job, text.units)} {text.units.unit('um')}"


def _label_lines(job: Job, text: Catalogue, width: int) -> list[Line]:
    """Return the note in full, then the tags."""
    rows = wrap_line(printable(job.note), width, Token.STRONG) if job.note else []
    if job.tags:
        rows += hanging(dim(f"{text('jobs_page.tags')} "), printable(" ".join(job.tags)), width)
    return rows


def _last_lines(last: LastResult | None, simulated: bool, text: Catalogue, width: int) -> list[Line]:
    if last is None:
        return [_fact(text("jobs_page.last_part"), text("jobs_page.never"), width)]
    simulation = text("jobs_page.simulated") if simulated else ""
    uncompensated = text("jobs_page.without") if last.strategy == UNCOMPENSATED else ""
    notes = filter(None, (text("jobs_page.circle"), simulation, uncompensated))
    at = "" if last.z_mm is None else text("inspect_page.at", z=text.units.figure(last.z_mm, "mm", 1))
    cylt = [] if last.cylt_um is None else [_fact("CYLt", text.units.show(last.cylt_um, "um", 2), width)]
    return [
        _fact(text("jobs_page.last_part"), ront_words(last.ront_um, text) + at, width),
        *cylt,
        *((dim(_align_right(note, width)),) for note in notes),
        _fact(text("jobs_page.parts", count=last.parts), _day(last.measured_at), width),
    ]


def _mark_assumed_value(job: Job, key: str, value: str, text: Catalogue) -> str:
    """Return a value with its mark of assumption in front, so that the numbers stay aligned."""
    return f"{text('jobs_page.assumed')} {value}" if key in job.assumed else value


def _fact(label: str, value: str, width: int) -> Line:
    return fact(label, value, width, label_width=min(_LABEL, max(width - 10, 0)))


def _align_right(text: str, cells: int) -> str:
    kept = text if cell_len(text) < cells else fit_text(text, cells - 1)
    return " " * max(cells - cell_len(kept), 0) + kept
