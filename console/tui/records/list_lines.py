"""Text of the list of recorded runs: one row a run, and which runs are listed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from console.session.data.run_rows import MODEL, RunOutcome, RunRow
from console.text.catalogue import Catalogue
from console.text.recorded_words import local
from console.tui.lines import BLANK, NOTHING, Line, Piece, dim, fit_text, line, name_in, to_the_right, wrap_line
from console.tui.records.reading import ListQuery, RunListing
from console.tui.theme import Token
from console.units import Units
from profiles.files import printable

_SELECTED, _MARKED = "▸", "*"
_NAME_LEAST = 22
_TIME, _CYLT, _RONT, _HOW, _SIM = 17, 7, 10, 15, 4
_MORE = (("machine", 17), ("operator", 11), ("strategy", 10), ("version", 8), ("diameter", 11))
"""Columns that are shown where there is room for them, with the name of the job not shortened."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunList:
    """The runs, the place of the selected one, and the id of the run marked for comparison."""

    listing: RunListing
    selected: int
    marked: str | None = None

    @property
    def row(self) -> RunRow | None:
        """The selected run, None without any."""
        rows = self.listing.rows
        return rows[self.selected] if 0 <= self.selected < len(rows) else None


def format_verdict(row: RunRow, units: Units) -> Piece:
    """Return RONt of the least round section of a run with the mark of its verdict."""
    if row.least_round_um is None and row.cylt_um is None:
        return to_the_right(f"{NOTHING}  ", _RONT), Token.DIM
    ront = NOTHING if row.least_round_um is None else units.figure(row.least_round_um, "um", 2)
    mark, token = {True: ("✓", Token.TEXT), False: ("✗", Token.WARNING), None: ("·", Token.DIM)}[row.passed]
    return to_the_right(f"{ront} {mark}", _RONT), token


def title_words(wanted: ListQuery, listing: RunListing | None, text: Catalogue, *, everywhere: bool) -> str:
    """Return how many runs are listed, and which."""
    count = NOTHING if listing is None else f"{len(listing.rows)}{'+' if listing.more else ''}"
    said = [text("records_page.title", count=count)]
    if everywhere:
        said.append(text("records_page.everywhere"))
    else:
        said.append(text("records_page.simulated" if wanted.filters.simulated else "records_page.real"))
    if wanted.filters.job is not None:
        said.append(printable(wanted.filters.job, 24))
    if wanted.words:
        said.append(f"/{printable(wanted.words, 24)}")
    if wanted.filters.failed:
        said.append(text("records_page.failed_only"))
    return " · ".join(said)


def run_lines(runs: RunList, text: Catalogue, width: int, height: int, *, everywhere: bool) -> list[Line]:
    """Return the heading and the rows around the selected run; cost by what is shown."""
    columns = _columns(width, everywhere=everywhere)
    name_width = max(width - 3 - _TIME - _CYLT - _RONT - _HOW - _SIM - sum(cells for _, cells in columns), 1)
    head = [fit_text(f"   {text('fact.time')}", 3 + _TIME), fit_text(text("fact.job"), name_width)]
    head += [
        to_the_right("CYLt ", _CYLT),
        to_the_right(f"RONt {text.units.unit('um')}".ljust(9), _RONT + 1),
        fit_text(text("records_page.ended"), _HOW + _SIM - 1),
    ]
    head += [fit_text(text(f"fact.{name}"), cells) for name, cells in columns]
    rows = [_row(runs, place, columns, name_width, text) for place in visible(runs, max(height - 1, 1))]
    return [line(dim("".join(head))), *rows][: max(height, 0)]


def visible(runs: RunList, room: int) -> range:
    """Return the places of the runs that are seen in some rows."""
    count = len(runs.listing.rows)
    first = min(max(runs.selected - room // 2, 0), max(count - room, 0))
    return range(first, min(first + room, count))


def hidden_words(runs: RunList, text: Catalogue, height: int) -> str:
    """Return how many runs are above and below the visible ones, "" for none."""
    seen, rows = visible(runs, max(height - 1, 1)), len(runs.listing.rows)
    below = f"{rows - seen.stop}{'+' if runs.listing.more else ''}"
    words = ["↑ " + text("jobs_page.above", count=seen.start)] if seen.start else []
    if rows > seen.stop or runs.listing.more:
        words.append("↓ " + text("jobs_page.below", count=below))
    return "  ".join(words)


def nothing_lines(wanted: ListQuery, text: Catalogue, width: int) -> list[Line]:
    """Return why the list is empty, and how a run is recorded."""
    filters = wanted.filters
    if filters.failed or filters.job is not None or wanted.words:
        return wrap_line(text("records_page.no_match"), width)
    said = "nothing" if filters.machine is None else "nothing_here"
    return [*wrap_line(text(f"records_page.{said}"), width), BLANK, *wrap_line(text("records_page.how"), width)]


def _columns(width: int, *, everywhere: bool) -> list[tuple[str, int]]:
    """Return the further columns that fit; the machine is the first where those of all are listed."""
    columns: list[tuple[str, int]] = []
    room = width - 3 - _TIME - _CYLT - _RONT - _HOW - _SIM - _NAME_LEAST
    for name, cells in _MORE:
        if (everywhere or name != "machine") and cells <= room:
            columns.append((name, cells))
            room -= cells
    return columns if everywhere or room >= 0 else []


def _row(runs: RunList, place: int, columns: Sequence[tuple[str, int]], name_width: int, text: Catalogue) -> Line:
    row = runs.listing.rows[place]
    chosen = place == runs.selected
    mark = (_SELECTED if chosen else " ") + (_MARKED if row.run_id == runs.marked else " ")
    mark += "!" if row.damaged else " "
    name = fit_text(name_in(printable(row.job), max(name_width - 1, 1)), name_width)
    how = row.ended.how
    ended_token = (
        Token.TEXT
        if how is RunOutcome.DONE
        else Token.WARNING
        if row.failed and row.passed is not False
        else Token.DIM
    )
    cylt = NOTHING if row.cylt_um is None else text.units.figure(row.cylt_um, "um", 2)
    pieces: list[Piece] = [
        (f"{mark}{fit_text(local(row.started), _TIME)}{name}", Token.TEXT),
        (to_the_right(cylt, _CYLT), Token.DIM),
        format_verdict(row, text.units),
        (
            " " + fit_text(text.first_sentence(f"records_page.how.{how}", f"records.how.{how}"), _HOW - 1),
            ended_token,
        ),
        (fit_text(text("sim") if row.simulated else "", _SIM), Token.DIM),
        *((fit_text(_value(row, name, cells - 1, text), cells), Token.DIM) for name, cells in columns),
    ]
    return ((("".join(piece for piece, _ in pieces)), Token.SELECTED),) if chosen else tuple(pieces)


def _value(row: RunRow, column: str, cells: int, text: Catalogue) -> str:
    match column:
        case "machine":
            return name_in(printable(row.machine), cells)
        case "operator":
            return name_in(printable(row.operator or NOTHING), cells)
        case "strategy":
            return fit_text(printable(row.strategy), cells)
        case "version":
            return NOTHING if row.compensation in (None, MODEL) else str(row.compensation)
        case _:
            return NOTHING if row.diameter_mm is None else text.units.figure(row.diameter_mm, "mm", 3)
