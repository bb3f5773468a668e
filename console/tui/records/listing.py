"""The list of recorded runs, read in pieces as far as it is scrolled."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from console.session.data.run_reader import RunFilters, runs
from console.session.data.run_rows import RunRow

PIECE = 50  # runs that are read at once
SEARCH_PIECE = 500  # the same where most of them are only looked through
ALL = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class ListQuery:
    """Which runs to list: `words` are in the name of the job; `version` changes when the record may have."""

    filters: RunFilters
    words: str = ""
    version: tuple[object, ...] = ()
    count: int = PIECE


@dataclass(frozen=True, slots=True, kw_only=True)
class Listing:
    """The runs found so far, newest first, and whether there may be more."""

    wanted: ListQuery
    rows: tuple[RunRow, ...] = ()
    more: bool = True

    def place_of(self, run_id: str | None) -> int | None:
        """Return the place of a run, None where it is not listed."""
        return next((place for place, row in enumerate(self.rows) if row.run_id == run_id), None)


def list_runs(folder: Path, wanted: ListQuery, known: Listing | None) -> Listing:
    """Return as many runs as are wanted, continuing what is `known` of the same ones.

    Raises SessionError: as `console.session.data.run_reader.runs`.
    """
    rows: list[RunRow] = []
    if known is not None and _same(known.wanted, wanted):
        rows, more = list(known.rows), known.more
    else:
        more = True
    last = rows[-1].run_id if rows else None
    words = wanted.words.casefold()
    piece = SEARCH_PIECE if words or wanted.count > SEARCH_PIECE else PIECE
    while more and len(rows) < wanted.count:
        found = runs(folder, wanted.filters, before=last, limit=piece)
        more = len(found) == piece
        rows += [row for row in found if words in row.job.casefold()]
        last = found[-1].run_id if found else last
    return Listing(wanted=wanted, rows=tuple(rows), more=more)


def _same(one: ListQuery, other: ListQuery) -> bool:
    return (one.filters, one.words, one.version) == (other.filters, other.words, other.version)
