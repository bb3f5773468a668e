"""Runs are read from the shop as from a lathe: those that are asked for, as a folder of records of their own.

So lists, debriefs and exports are made by the same code, from the same file format. The folder is thrown away.
"""

from __future__ import annotations

import sqlite3
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from console.session.data.record_file import FILE_NAME
from console.session.data.record_schema import create
from console.session.data.run_reader import RunFilters, recorded_date
from console.session.data.run_rows import COMPLETE, ENDS, STARTS
from console.session.errors import SessionError
from console.site.shop.connection import Values, connect_shop
from console.site.shop.outbox import EVENTS, MEASUREMENTS, RUNS, TELEMETRY, TEXTS, TRACES, SentTable
from console.site.shop.schema import refuse_other_schema
from profiles.files import printable
from profiles.problem import Problem

if TYPE_CHECKING:
    import psycopg

FAILED = f"""(
    (SELECT passed FROM shop.measurements AS m WHERE m.lathe_id = runs.lathe_id AND m.run_id = runs.run_id
        AND product = 1 ORDER BY number DESC LIMIT 1) = 0
    OR NOT EXISTS (SELECT 1 FROM shop.events AS e WHERE e.lathe_id = runs.lathe_id AND e.run_id = runs.run_id
            AND kind IN {COMPLETE})
        AND EXISTS (SELECT 1 FROM shop.events AS e WHERE e.lathe_id = runs.lathe_id AND e.run_id = runs.run_id
            AND kind IN {ENDS[2:]})
)"""
"""The same as `console.session.data.run_rows.FAILED`, where it is asked of the shop."""

SHOWN_LATHES = 8
PIECE = 1000  # rows
READ_S = 600.0  # an export of a whole shop is sorted before its first row comes
MOST_OF_ONE_ID = 20
LISTED_KINDS = (*ENDS, *STARTS)


@dataclass(frozen=True, slots=True, kw_only=True)
class ShopQuery:
    """Which runs of a shop: `limit` newest of the `filters`, or those whose id begins with `run`.

    With `whole`, all of each run; otherwise what a list shows.
    """

    lathe: str | None = None
    filters: RunFilters = field(default_factory=RunFilters)
    run: str | None = None
    limit: int = MOST_OF_ONE_ID
    whole: bool = True


@dataclass(frozen=True, slots=True)
class ShopFolder:
    """A folder with the records that were asked for. `lathes` has the name of the lathe of each run."""

    path: Path
    lathes: Mapping[str, str]


@contextmanager
def shop_folder(given: str, query: ShopQuery) -> Iterator[ShopFolder]:
    """Yield a folder with records of the shop, which is removed afterwards.

    Raises SessionError: as `connect_shop` and `refuse_other_schema`; `ship.no_lathe`, `ship.ambiguous_lathe`.
    """
    with tempfile.TemporaryDirectory(prefix="trilobe-shop-") as made:
        with connect_shop(given, READ_S if query.whole and query.run is None else None) as link:
            refuse_other_schema(link)
            # One moment for all tables: no run without its events.
            with link.transaction():
                link.execute("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY")
                lathes = _copy_queried_runs(link, query, Path(made) / FILE_NAME)
        yield ShopFolder(Path(made), lathes)


def _copy_queried_runs(link: psycopg.Connection[Values], query: ShopQuery, file: Path) -> dict[str, str]:
    names: dict[str, str] = dict(link.execute("SELECT lathe_id, name FROM shop.lathes").fetchall())
    found = _select_runs(link, query, _lathe_id(names, query.lathe))
    shown: dict[tuple[str, str], str] = {}
    for lathe_id, run_id in reversed(found):
        # Folders that were copied have runs with the same id; they are told apart.
        taken = run_id in shown.values()
        shown[lathe_id, run_id] = f"{run_id}@{names.get(lathe_id, lathe_id)}" if taken else run_id
    with closing(sqlite3.connect(file, isolation_level=None)) as database:
        database.execute("PRAGMA journal_mode=WAL")
        database.execute("BEGIN")
        create(database)
        _copy_runs(link, database, list(shown), shown)
        kinds = None if query.whole else LISTED_KINDS
        tables = (EVENTS, MEASUREMENTS, TRACES, TELEMETRY) if query.whole else (EVENTS, MEASUREMENTS)
        for table in tables:
            _copy(link, database, table, shown, kinds if table is EVENTS else None)
        database.execute("COMMIT")
    return {run: printable(names.get(lathe_id, lathe_id)) for (lathe_id, _), run in shown.items()}


def _lathe_id(names: Mapping[str, str], wanted: str | None) -> str | None:
    """Return the id of the lathe that is meant, None for all."""
    if wanted is None:
        return None
    found = [each for each, name in names.items() if name == wanted or each.startswith(wanted.lower())]
    if len(found) == 1:
        return found[0]
    value = printable(wanted, 60)
    if found:
        limit = " | ".join(each[:8] for each in sorted(found)[:SHOWN_LATHES])
        raise SessionError(Problem(code="ship.ambiguous_lathe", value=value, limit=limit))
    limit = " | ".join(printable(each) for each in sorted(set(names.values()))[:SHOWN_LATHES]) or "–"
    raise SessionError(Problem(code="ship.no_lathe", value=value, limit=limit))


def _select_runs(
    link: psycopg.Connection[Values], query: ShopQuery, lathe_id: str | None
) -> list[tuple[str, str]]:
    """Return lathe and id of the runs, newest first in the order in which they arrived."""
    filters, conditions, keys = query.filters, ["true"], list[object]()
    for line, value in (
        ("runs.lathe_id = %s", lathe_id),
        ("runs.job = %s", filters.job),
        ("runs.machine = %s", filters.machine),
        ("runs.started_utc >= %s", filters.since and recorded_date(filters.since)),
        ("runs.started_utc < %s", filters.until and recorded_date(filters.until)),
        ("starts_with(runs.run_id, %s)", None if query.run is None else query.run.strip().lower()),
    ):
        if value is not None:
            conditions.append(line)
            keys.append(value)
    if filters.failed:
        conditions.append(FAILED)
    where = " AND ".join(conditions)
    line = f"SELECT lathe_id, run_id FROM shop.runs WHERE {where} ORDER BY arrival DESC LIMIT %s"
    return [(str(lathe), str(run)) for lathe, run in link.execute(line.encode(), (*keys, query.limit)).fetchall()]


def _copy_runs(
    link: psycopg.Connection[Values],
    database: sqlite3.Connection,
    wanted: Sequence[tuple[str, str]],
    shown: Mapping[tuple[str, str], str],
) -> None:
    """Copy runs, oldest first, and the texts that they refer to."""
    columns = ", ".join(f"runs.{each}" for each in RUNS.columns)
    line = f"SELECT runs.lathe_id, {columns} FROM shop.runs JOIN {{wanted}} ORDER BY arrival"
    _insert(database, RUNS, ((shown[row[0], row[1]], *row[2:]) for row in _of_runs(link, line, wanted)))
    used = "SELECT job_text_sha256 FROM runs UNION SELECT machine_text_sha256 FROM runs"
    texts = [each for (each,) in database.execute(used).fetchall() if each is not None]
    line = "SELECT sha256, content FROM shop.texts WHERE sha256 = ANY(%s)"
    _insert(database, TEXTS, link.execute(line, (texts,)).fetchall())


def _copy(
    link: psycopg.Connection[Values],
    database: sqlite3.Connection,
    table: SentTable,
    shown: Mapping[tuple[str, str], str],
    kinds: Sequence[str] | None,
) -> None:
    columns = ", ".join(f"rows.{each}" for each in table.columns)
    of_kind = "" if kinds is None else f" WHERE rows.kind IN ({', '.join(repr(each) for each in kinds)})"
    line = (
        f"SELECT rows.lathe_id, {columns} FROM shop.{table.name} AS rows JOIN {{wanted}}{of_kind}"
        " ORDER BY rows.lathe_id, rows.file_id, rows.source_row"
    )
    _insert(database, table, ((shown[row[0], row[1]], *row[2:]) for row in _of_runs(link, line, list(shown))))


def _of_runs(
    link: psycopg.Connection[Values], line: str, wanted: Sequence[tuple[str, str]]
) -> Iterator[Sequence[Any]]:
    """Yield the rows of some runs; `{wanted}` in the query is what limits it to them.

    They come in pieces: all of a shop are more than a computer can hold.
    """
    joined = "unnest(%s::text[], %s::text[]) AS wanted (lathe_id, run_id) USING (lathe_id, run_id)"
    lathes, runs = [each for each, _ in wanted], [each for _, each in wanted]
    with link.cursor(name="in_pieces") as cursor:
        cursor.itersize = PIECE
        cursor.execute(line.format(wanted=joined).encode(), (lathes, runs))
        yield from cursor


def _insert(database: sqlite3.Connection, table: SentTable, rows: Iterable[Sequence[Any]]) -> None:
    marks = ", ".join("?" * len(table.columns))
    line = f"INSERT INTO {table.name} ({', '.join(table.columns)}) VALUES ({marks})"
    database.executemany(line, rows)
