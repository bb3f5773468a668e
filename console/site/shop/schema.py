"""Schema of the shop's database: numbered files of SQL, each carried out once, in a transaction, by the owner."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from importlib.resources import files
from typing import TYPE_CHECKING

from console.session.errors import SessionError
from console.site.shop.connection import Values, connect_shop, place_of
from profiles.problem import Problem

if TYPE_CHECKING:
    import psycopg

FOLDER = "migrations"
_NAME = re.compile(r"(\d{4})_[a-z_]+\.sql")
_LOCK = 7_411_902_655
"""Number of the lock that two owners who migrate at once wait for; any number that nobody else takes."""

MIGRATION_S = 6 * 3600.0
"""A step may work for long without a word: it goes over all records."""

_TABLE = """CREATE SCHEMA IF NOT EXISTS shop;
CREATE TABLE IF NOT EXISTS shop.migrations (
    number integer PRIMARY KEY, name text NOT NULL, sha256 text NOT NULL,
    applied_at timestamptz NOT NULL DEFAULT now()
)"""
_APPLIED = "SELECT number, sha256 FROM shop.migrations ORDER BY number"


@dataclass(frozen=True, slots=True)
class Migration:
    """A step of the schema."""

    number: int
    name: str
    sql: str

    @property
    def sha256(self) -> str:
        """Hash of its text: what was applied is not changed afterwards."""
        return hashlib.sha256(self.sql.encode()).hexdigest()


def migrations() -> tuple[Migration, ...]:
    """Return all steps of this console, in order."""
    folder = files("console.site.shop").joinpath(FOLDER)
    found = [(match, each) for each in folder.iterdir() if (match := _NAME.fullmatch(each.name))]
    made = [Migration(int(match[1]), each.name, each.read_text(encoding="utf-8")) for match, each in found]
    return tuple(sorted(made, key=lambda each: each.number))


def migrate(given: str) -> tuple[Migration, ...]:
    """Carry out the steps that are missing in a database; return them.

    Raises SessionError: as `connect_shop`; `ship.newer_schema`, `ship.changed_schema`, `ship.not_utf8`.
    """
    with connect_shop(given, answer_s=MIGRATION_S) as link:
        if (encoding := link.info.parameter_status("server_encoding")) != "UTF8":
            raise SessionError(Problem(code="ship.not_utf8", where=place_of(link, {}), value=str(encoding)))
        link.execute("SELECT pg_advisory_lock(%s)", (_LOCK,))
        if link.execute("SELECT to_regclass('shop.migrations')").fetchone() == (None,):
            link.execute(_TABLE)
        left = _missing(link)
        for each in left:
            with link.transaction():
                link.execute(each.sql.encode())
                link.execute(
                    "INSERT INTO shop.migrations (number, name, sha256) VALUES (%s, %s, %s)",
                    (each.number, each.name, each.sha256),
                )
        return left


def refuse_other_schema(link: psycopg.Connection[Values]) -> None:
    """Refuse a database without the schema of this console.

    Raises SessionError: `ship.no_schema`, `ship.older_schema`, `ship.newer_schema`, `ship.changed_schema`.
    """
    where = place_of(link, {})
    if link.execute("SELECT to_regclass('shop.migrations')").fetchone() == (None,):
        raise SessionError(Problem(code="ship.no_schema", where=where))
    if left := _missing(link):
        value, limit = str(left[0].number - 1), str(left[-1].number)
        raise SessionError(Problem(code="ship.older_schema", where=where, value=value, limit=limit))


def _missing(link: psycopg.Connection[Values]) -> tuple[Migration, ...]:
    known = migrations()
    applied: dict[int, str] = dict(link.execute(_APPLIED).fetchall())
    where = place_of(link, {})
    if applied and max(applied) > known[-1].number:
        value, limit = str(max(applied)), str(known[-1].number)
        raise SessionError(Problem(code="ship.newer_schema", where=where, value=value, limit=limit))
    for each in known:
        if applied.get(each.number, each.sha256) != each.sha256:
            raise SessionError(Problem(code="ship.changed_schema", where=where, value=each.name))
    return tuple(each for each in known if each.number not in applied)
