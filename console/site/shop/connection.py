"""A connection to the database of the shop: by the rules of libpq, encrypted, and never telling a password.

Where the database is, and how its certificate is checked, is said as libpq wants it: a connection string, a
service, the variables PG*. The password is not part of it: a command line is seen by every account of a computer.
"""

from __future__ import annotations

import gc
import os
import time
from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from console.session.errors import SessionError, require_extra
from profiles.files import printable
from profiles.problem import Problem

if TYPE_CHECKING:
    import psycopg

Values = tuple[Any, ...]

DEFAULTS: Mapping[str, str] = {
    "connect_timeout": "10",
    "keepalives_idle": "20",
    "keepalives_interval": "5",
    "keepalives_count": "4",
    "tcp_user_timeout": "60000",
    "application_name": "console ship",
}
"""Of a server that no longer answers, the console learns within a minute."""

ANSWER_S = 20.0
"""A server that is silent for so long in a statement is given up: one that is stopped keeps its connections."""

LOCK_S = 10
"""So long a statement waits for a lock that another session has; less than `ANSWER_S`, as a lock has a name."""

SECRETS = ("password", "sslpassword", "oauth_client_secret")
SHOWN_CHARACTERS = 300


def judged_address(given: str) -> dict[str, str]:
    """Return the parts of a connection string.

    Raises SessionError: `extra.missing`; `ship.not_an_address`; `ship.password_given`, of which nothing is shown.
    """
    require_extra("psycopg", "shop")
    from psycopg import ProgrammingError
    from psycopg.conninfo import conninfo_to_dict

    try:
        found = {key: str(value) for key, value in conninfo_to_dict(given).items()}
    except ProgrammingError:
        # What libpq says of it may quote a password.
        raise SessionError(Problem(code="ship.not_an_address")) from None
    if any(key in found for key in SECRETS):
        raise SessionError(Problem(code="ship.password_given"))
    return found


@contextmanager
def connect_shop(given: str, answer_s: float | None = None) -> Iterator[psycopg.Connection[Values]]:
    """Yield a connection; each transaction is begun by its user. `answer_s` is the longest silence, s.

    Raises SessionError: as `judged_address`; `ship.not_encrypted`, over a network; `ship.lost`, whatever the
    database or the network refuses, also later, and a database that does not answer.
    """
    parts = judged_address(given)
    gc.collect()  # a connection that was given up stays open in a circle of references of psycopg
    import psycopg
    from psycopg.conninfo import make_conninfo

    class AnsweringConnection(psycopg.Connection[Values]):
        def wait(self, gen: Any, *more: Any, **how: Any) -> Any:
            return super().wait(_await_answer(gen, self, answer_s or ANSWER_S), *more, **how)

    link: AnsweringConnection | None = None
    where = place_of(None, parts)
    try:
        whole = make_conninfo(**{**DEFAULTS, **parts, "client_encoding": "utf8"})
        # Not prepared: a pool of connections in between need not know statements.
        link = AnsweringConnection.connect(whole, autocommit=True, prepare_threshold=None)
        where = place_of(link, parts)
        _refuse_plain(link, parts)
        link.execute(f"SET lock_timeout = '{LOCK_S}s'".encode())
        yield link
    except psycopg.Error as error:
        raise SessionError(lost_problem(error, where)) from None
    finally:
        if link is not None:
            with suppress(psycopg.Error):
                link.close()


def _await_answer(
    steps: Generator[Any, Any, Any], link: psycopg.Connection[Values], answer_s: float
) -> Generator[Any, Any, Any]:
    """Run a generator of psycopg, woken ten times a second for nothing, until the silence has lasted too long."""
    from psycopg import OperationalError

    heard_s, ready = time.monotonic(), None
    try:
        while True:
            ready = yield steps.send(ready)
            if ready:
                heard_s = time.monotonic()
            elif time.monotonic() - heard_s > answer_s:
                link.pgconn.finish()  # nothing else is asked of it, not even to roll back
                raise OperationalError(f"no answer for {answer_s:g} s")
    except StopIteration as done:
        return done.value


@contextmanager
def commit_transaction(link: psycopg.Connection[Values]) -> Iterator[None]:
    """Carry out what is done inside as a transaction. Raises psycopg.Error, also if it was not committed.

    A transaction that the server has given up answers COMMIT with ROLLBACK, which is no error to psycopg.
    """
    from psycopg import Error, OperationalError

    link.execute("BEGIN")
    try:
        yield
    except BaseException:
        with suppress(Error):
            link.execute("ROLLBACK")
        raise
    if (said := link.execute("COMMIT").statusmessage) != "COMMIT":
        raise OperationalError(f"COMMIT was answered by {said}")


def lost_problem(error: psycopg.Error, where: str) -> Problem:
    """Return the problem of what libpq or the server has refused; values of rows are not told."""
    said = error.diag.message_primary or str(error)
    return Problem(
        code="ship.lost", where=where, value=printable(" ".join(said.split()).rstrip("."), SHOWN_CHARACTERS)
    )


def place_of(link: psycopg.Connection[Values] | None, parts: Mapping[str, str]) -> str:
    """Return where the database is, in words without secrets."""
    if link is not None:
        info = link.info
        return printable(f"{info.user}@{info.host or 'local'}:{info.port}/{info.dbname}")
    known = [f"{key}={parts[key]}" for key in ("service", "host", "port", "dbname", "user") if key in parts]
    return printable(" ".join(known) or "PG*")


def _refuse_plain(link: psycopg.Connection[Values], parts: Mapping[str, str]) -> None:
    """Refuse to send records over a network in the clear, unless that is what was said."""
    said = parts.get("sslmode") or os.environ.get("PGSSLMODE", "")
    host = link.info.hostaddr or link.info.host
    here = not host or host.startswith(("/", "127.", "@")) or host == "::1"
    if not here and not link.pgconn.ssl_in_use and said != "disable":
        raise SessionError(Problem(code="ship.not_encrypted", where=place_of(link, parts)))
