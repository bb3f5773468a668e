"""Reader of the page Records: the list, one run or two, the chart of a job; each in a thread."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path

from console.session.data.run_reader import RunFilters, runs
from console.session.data.run_rows import RunRow
from console.session.learning.job_chart import ChartedQuantity, JobChart, job_chart, list_like_parts
from console.session.learning.opened_run import OpenedRun, open_run
from console.tui.records.background_reader import BackgroundReader, Problems
from profiles.store import LoadedMachine

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
class RunListing:
    """The runs found so far, newest first, and whether there may be more."""

    wanted: ListQuery
    rows: tuple[RunRow, ...] = ()
    more: bool = True

    def place_of(self, run_id: str | None) -> int | None:
        """Return the place of a run, None if it is not listed."""
        return next((place for place, row in enumerate(self.rows) if row.run_id == run_id), None)


def list_runs(folder: Path, wanted: ListQuery, known: RunListing | None) -> RunListing:
    """Return as many runs as are wanted, continuing the `known` list of the same query.

    Raises SessionError: as `console.session.data.run_reader.runs`.
    """
    rows: list[RunRow] = []
    if known is not None and _is_same_query(known.wanted, wanted):
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
    return RunListing(wanted=wanted, rows=tuple(rows), more=more)


def _is_same_query(one: ListQuery, other: ListQuery) -> bool:
    return (one.filters, one.words, one.version) == (other.filters, other.words, other.version)


STATISTICS = "scipy.stats"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OpenedRuns:
    """The runs that are open: one, or the marked one and another."""

    runs: tuple[OpenedRun, ...]


class RecordsReader:
    """Reads the data folder; returns None meanwhile, problems if it cannot be read."""

    def __init__(self, data: Path, machine: LoadedMachine) -> None:
        self._data, self._machine = data, machine
        self._list: BackgroundReader[RunListing] = BackgroundReader()
        self._runs: BackgroundReader[OpenedRuns] = BackgroundReader()
        self._chart: BackgroundReader[JobChart] = BackgroundReader()
        self._known: RunListing | None = None

    def listing(self, wanted: ListQuery) -> RunListing | Problems | None:
        """Return the queried runs, continuing the known list."""
        known = self._known
        found = self._list.answer(wanted, lambda: list_runs(self._data, wanted, known))
        if isinstance(found, RunListing):
            self._known = found
        return found

    def open_runs(
        self, run_ids: tuple[str, ...], version: tuple[object, ...], *, moving: bool
    ) -> OpenedRuns | Problems | None:
        """Return these runs in full. While something moves, why a part is not round is left for later."""
        data, machine, explains = self._data, self._machine, not moving

        def read() -> OpenedRuns:
            return OpenedRuns(runs=tuple(open_run(data, each, machine, explains=explains) for each in run_ids))

        return self._runs.answer((run_ids, explains, version), read)

    def chart(
        self, row: RunRow, figure: ChartedQuantity, version: tuple[object, ...], *, moving: bool
    ) -> JobChart | Problems | None:
        """Return the chart of a run's job. While something moves scipy is not loaded: it holds up the threads."""
        judge = not moving or STATISTICS in sys.modules
        question = (row.run_id, figure, judge, version)

        def read() -> JobChart:
            parts, others = list_like_parts(self._data, row)
            found = job_chart(parts, figure, judge=judge)
            return replace(found, job=row.job, strategy=row.strategy, others=others)

        return self._chart.answer(question, read)
