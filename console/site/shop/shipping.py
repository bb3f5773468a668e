"""What a lathe has recorded is sent to the shop: each row once, in order, together with how far it was sent.

A transaction holds the rows and their progress; so after any failure of either side the next one begins where
the last whole one ended. Two consoles that send from one folder take turns: the rows of progress are locked first.
`follow` sends what is recorded as it is recorded, whatever happens to network and database meanwhile.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from console.session.data.record_file import FILE_NAME
from console.session.errors import SessionError
from console.site.shop.connection import Values, commit_transaction, connect_shop
from console.site.shop.identity import LatheIdentity, lathe_identity
from console.site.shop.outbox import SENT, Outbox, Row, SentTable, mark_of, outbox
from console.site.shop.schema import refuse_other_schema
from profiles.files import printable
from profiles.problem import Problem, ProblemError

if TYPE_CHECKING:
    import psycopg

MOST_ROWS = 5_000
MOST_BYTES = 8_000_000
"""A transaction has so much at the most, and one row more: what is lost with it is sent again soon."""

BESIDE = ("lathe_id", "file_id", "source_row")

_BEGIN = """INSERT INTO shop.progress (lathe_id, file_id, source_table) SELECT %s, %s, unnest(%s::text[])
    ON CONFLICT DO NOTHING"""
_LOCKED = """SELECT source_table, last_row, last_mark, again FROM shop.progress
    WHERE lathe_id = %s AND file_id = %s ORDER BY source_table FOR UPDATE"""
_KEPT = """UPDATE shop.progress SET last_row = %s, last_mark = %s, updated_at = now()
    WHERE lathe_id = %s AND file_id = %s AND source_table = %s"""
_AGAIN = """UPDATE shop.progress SET last_row = 0, last_mark = '', again = true, updated_at = now()
    WHERE lathe_id = %s AND file_id = %s"""
_CONTACT = "INSERT INTO shop.contacts (lathe_id, name, software, lathe_at) VALUES (%s, %s, %s, %s)"


@dataclass(slots=True)
class SentRows:
    """What was sent so far: rows by table, in how many transactions.

    `left` are rows that wait, None where nothing is recorded. `upto` is where the records ended: the id of
    their file, and the last row of each table.
    """

    lathe: LatheIdentity
    rows: dict[str, int] = field(default_factory=dict)
    transactions: int = 0
    left: int | None = None
    upto: tuple[str, Mapping[str, int]] | None = None

    @property
    def total(self) -> int:
        """Rows of all tables."""
        return sum(self.rows.values())


@dataclass(frozen=True, slots=True)
class _Place:
    """How far a table was sent."""

    last_row: int
    last_mark: str
    again: bool


def ship(
    data: Path,
    given: str,
    *,
    again: bool = False,
    told: Callable[[SentRows], object] = lambda sent: None,
    most_rows: int = MOST_ROWS,
) -> SentRows:
    """Send what is recorded in a data folder and was not sent yet; `told` is called after each transaction.

    `again` goes over everything from its beginning: what the shop has stays there as it is.

    Raises SessionError: as `connect_shop`, `refuse_other_schema`, `lathe_identity`, `outbox`; `ship.diverged`,
    these
        records are not a continuation of those that were sent; `ship.not_text`. What was sent before, stays.
    """
    lathe = lathe_identity(data)
    with connect_shop(given) as link:
        refuse_other_schema(link)
        greet(link, lathe)
        return ship_over(link, data, lathe, again=again, told=told, most_rows=most_rows)


def greet(link: psycopg.Connection[Values], lathe: LatheIdentity) -> None:
    """Tell the shop the lathe's name and what its clock says. Raises psycopg.Error."""
    link.execute(_CONTACT, (lathe.lathe_id, lathe.name, f"trilobe {version('trilobe')}", clock()))


def clock() -> datetime:
    """Return what the clock of this computer says; it may be wrong, and the shop finds that out."""
    return datetime.now(UTC)


def ship_over(
    link: psycopg.Connection[Values],
    data: Path,
    lathe: LatheIdentity,
    *,
    again: bool = False,
    told: Callable[[SentRows], object] = lambda sent: None,
    most_rows: int = MOST_ROWS,
    before: SentRows | None = None,
) -> SentRows:
    """Do the same over a connection to a database that has the schema. Raises psycopg.Error, too.

    Where nothing was recorded since the pass `before`, the database is not asked.
    """
    sent = SentRows(lathe)
    with outbox(data) as box:
        if box is None:
            return sent
        sent.upto, sent.left = (box.file_id, box.heads), 0
        if before is not None and before.left == 0 and before.upto == sent.upto:
            return sent
        keys = (lathe.lathe_id, box.file_id)
        link.execute(_BEGIN, (*keys, [table.name for table in SENT]))
        if again:
            link.execute(_AGAIN, keys)
        sent.left = 1
        while sent.left:
            with _refuse_repeated_rows(data), commit_transaction(link):
                _send_some(link, box, keys, sent, data, most_rows)
            sent.transactions += 1
            told(sent)
    return sent


@contextmanager
def _refuse_repeated_rows(data: Path) -> Iterator[None]:
    """Raise SessionError `ship.diverged` if the shop has a row already which the progress does not know of."""
    from psycopg.errors import UniqueViolation

    try:
        yield
    except UniqueViolation as error:
        where, value = printable(str(data / FILE_NAME)), printable(str(error.diag.table_name))
        raise SessionError(Problem(code="ship.diverged", where=where, value=value)) from None


def _send_some(
    link: psycopg.Connection[Values],
    box: Outbox,
    keys: tuple[str, str],
    sent: SentRows,
    data: Path,
    most_rows: int,
) -> None:
    """Send the next rows inside the caller's transaction, and keep how far they go. Raises psycopg.Error."""
    from psycopg import OperationalError

    found = link.execute(_LOCKED, keys).fetchall()
    places = {str(name): _Place(row, mark, again) for name, row, mark, again in found}
    if hidden := {table.name for table in SENT} - set(places):
        raise OperationalError(f"shop.progress has no row of this lathe for {', '.join(sorted(hidden))}")
    _refuse_diverged(box, places, data)
    rows_left, bytes_left = most_rows, MOST_BYTES
    sent.left = 0
    for table in SENT:
        place = places[table.name]
        batch = list(_limit_rows(box.rows(table, place.last_row, max(rows_left, 0)), bytes_left))
        if batch:
            _refuse_unstorable(table, batch, data)
            _insert(link, table, keys, batch, again=place.again)
            link.execute(_KEPT, (batch[-1][0], mark_of(batch[-1][1:]), *keys, table.name))
        rows_left -= len(batch)
        bytes_left -= sum(map(_size, batch))
        last = batch[-1][0] if batch else place.last_row
        left = max(box.heads[table.name] - last, 0)
        sent.rows[table.name] = sent.rows.get(table.name, 0) + len(batch)
        sent.left += left
        if left:  # the tables behind it refer to its rows
            sent.left += sum(
                max(box.heads[other.name] - places[other.name].last_row, 0)
                for other in SENT[SENT.index(table) + 1 :]
            )
            return


def _limit_rows(rows: Iterator[Row], most_bytes: int) -> Iterator[Row]:
    """Yield rows until they are as large as allowed, and the one that passes it."""
    for row in rows:
        if most_bytes <= 0:
            return
        most_bytes -= _size(row)
        yield row


def _size(row: Row) -> int:
    return sum(len(each) if isinstance(each, str | bytes) else 8 for each in row)


def _insert(
    link: psycopg.Connection[Values], table: SentTable, keys: tuple[str, str], batch: Sequence[Row], *, again: bool
) -> None:
    """Insert rows. Where some may be there already, those stay; otherwise one that is there is an error."""
    columns = ", ".join(table.columns if table.shared else (*BESIDE, *table.columns))
    if table.shared or again:
        values: list[Values] = [row[1:] if table.shared else (*keys, *row) for row in batch]
        # In one order for all lathes: two that send the same texts do not wait for each other in a circle.
        values = sorted(values) if table.shared else values
        marks = ", ".join(["%s"] * len(values[0]))
        line = f"INSERT INTO shop.{table.name} ({columns}) VALUES ({marks}) ON CONFLICT DO NOTHING"
        with link.cursor() as cursor:
            cursor.executemany(line.encode(), values)
        return
    with link.cursor() as cursor, cursor.copy(f"COPY shop.{table.name} ({columns}) FROM STDIN".encode()) as copy:
        for row in batch:
            copy.write_row((*keys, *row))


def _refuse_diverged(box: Outbox, places: dict[str, _Place], data: Path) -> None:
    """Refuse where the last row that was sent of any table is not the one that is there now."""
    for table in SENT:
        place = places[table.name]
        if place.last_row and box.mark(table, place.last_row) != place.last_mark:
            where, value = printable(str(data / FILE_NAME)), f"{table.name} {place.last_row}"
            raise SessionError(Problem(code="ship.diverged", where=where, value=value))


def _refuse_unstorable(table: SentTable, batch: Sequence[Row], data: Path) -> None:
    """Refuse a text with a NUL, which PostgreSQL cannot hold; no console writes any."""
    for row in batch:
        if any(isinstance(each, str) and "\0" in each for each in row):
            where, value = printable(str(data / FILE_NAME)), f"{table.name} {row[0]}"
            raise SessionError(Problem(code="ship.not_text", where=where, value=value))


PERIOD_S = 5.0
GREET_S = 3600.0
LEAST_PAUSE_S, MOST_PAUSE_S = 1.0, 60.0
SAID_AGAIN_S = 60.0

PASSING = frozenset({"ship.lost", "ship.no_schema", "ship.older_schema", "record.not_readable"})
"""Refusals that may end by themselves, or by what somebody does at the database: tried again."""

Waits = Callable[[float], object]


def follow(
    data: Path,
    given: str,
    *,
    period_s: float = PERIOD_S,
    told: Callable[[SentRows], object] = lambda sent: None,
    waits: Waits = time.sleep,
    clock: Callable[[], float] = time.monotonic,
) -> Generator[SentRows | Problem, None, None]:
    """Send for ever; yield what each pass has sent, and a refusal that is tried again, each minute while it lasts.

    `waits` waits some seconds. Between two tries the pause doubles, up to a minute. Raises SessionError: any
    refusal that is not in `PASSING`.
    """
    pause_s, last, said_s = LEAST_PAUSE_S, None, 0.0
    while True:
        try:
            for sent in _over_one_link(data, given, period_s, told, waits):
                pause_s, last = LEAST_PAUSE_S, None
                yield sent
        except ProblemError as error:
            problem = error.problems[0]
            if problem.code not in PASSING:
                raise
            if problem != last or clock() - said_s >= SAID_AGAIN_S:
                last, said_s = problem, clock()
                yield problem
        waits(pause_s)
        pause_s = min(2.0 * pause_s, MOST_PAUSE_S)


def _over_one_link(
    data: Path, given: str, period_s: float, told: Callable[[SentRows], object], waits: Waits
) -> Iterator[SentRows]:
    lathe = lathe_identity(data)
    with connect_shop(given) as link:
        refuse_other_schema(link)
        greeted_s, sent = -GREET_S, None
        while True:
            if time.monotonic() - greeted_s >= GREET_S:
                greet(link, lathe)
                greeted_s = time.monotonic()
            sent = ship_over(link, data, lathe, told=told, before=sent)
            yield sent
            waits(period_s)
