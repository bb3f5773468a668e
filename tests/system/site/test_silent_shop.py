"""`console ship` at a database that is stopped, locked, silent, or undoes what it was sent: nothing is lost."""

from __future__ import annotations

import os
import signal
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psycopg
import pytest

from console.session.errors import SessionError
from console.site.shop import connection
from console.site.shop.shipping import SentRows, follow, ship
from profiles.problem import Problem
from tests.preloaded import completed
from tests.site.shop_server import SHIPPER, ShopServer, needs_postgresql
from tests.site.shop_server import running as running
from tests.system.site.lathe_records import assert_all_there, record_runs

pytestmark = [pytest.mark.system, needs_postgresql]

COMMIT, ROLLBACK = b"Q\0\0\0\x0bCOMMIT\0", b"Q\0\0\0\x0dROLLBACK\0"
"""The query as PostgreSQL's protocol writes it: a letter, the length with its own four bytes, the text."""


@pytest.fixture
def shop(running: ShopServer, monkeypatch: pytest.MonkeyPatch) -> ShopServer:
    """A shop without records, and a lathe that is not patient: a test waits a second, not half a minute."""
    for name in [name for name in os.environ if name.startswith("PG")]:
        monkeypatch.delenv(name)
    monkeypatch.setattr(connection, "ANSWER_S", 1.0)
    monkeypatch.setattr(connection, "LOCK_S", 1)
    running.new_shop()
    return running


@pytest.fixture
def lathe(tmp_path: Path) -> Path:
    record_runs(tmp_path / "lathe", 1)
    return tmp_path / "lathe"


def refused(lathe: Path, dsn: str) -> str:
    """Why nothing was sent."""
    with pytest.raises(SessionError) as error:
        ship(lathe, dsn)
    (problem,) = error.value.problems
    assert problem.code == "ship.lost"
    return str(problem.value)


@contextmanager
def stopped(shop: ShopServer) -> Iterator[None]:
    """All processes of a server, stopped: its sockets still take what they are sent."""
    postmaster = int((shop.folder / "data" / "postmaster.pid").read_text().split()[0])
    children = [
        int(each.name) for each in Path("/proc").iterdir() if each.name.isdigit() and parent_of(each) == postmaster
    ]
    for process in (postmaster, *children):
        os.kill(process, signal.SIGSTOP)
    try:
        yield
    finally:
        for process in (postmaster, *children):
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGCONT)


def parent_of(process: Path) -> int:
    try:
        return int((process / "stat").read_text().rpartition(")")[2].split()[1])
    except OSError:
        return 0


@contextmanager
def carried(shop: ShopServer, *, rolls_back: bool) -> Iterator[int]:
    """A port of this computer that leads to the server, and may turn each COMMIT on its way into a ROLLBACK."""
    ends: list[socket.socket] = []

    def carry(source: socket.socket, target: socket.socket, turns: bool) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                target.sendall(data.replace(COMMIT, ROLLBACK) if turns else data)
            target.shutdown(socket.SHUT_WR)

    def serve(listening: socket.socket) -> None:
        with suppress(OSError):
            while True:
                client, _ = listening.accept()
                server = socket.socket(socket.AF_UNIX)
                server.connect(str(shop.folder / ".s.PGSQL.5432"))
                ends.extend((client, server))
                for way in ((client, server, rolls_back), (server, client, False)):
                    threading.Thread(target=carry, args=way, daemon=True).start()

    with socket.create_server(("127.0.0.1", 0)) as listening:
        threading.Thread(target=serve, args=(listening,), daemon=True).start()
        yield listening.getsockname()[1]
        for each in ends:
            each.close()


@pytest.mark.timeout(60)
def test_a_stopped_server_is_given_up_and_gets_everything_once_it_goes_on(shop: ShopServer, lathe: Path) -> None:
    following = follow(lathe, f"{shop.dsn(SHIPPER)} connect_timeout=2", waits=lambda seconds: None)
    assert isinstance(next(following), SentRows)
    record_runs(lathe, 1)
    with stopped(shop):
        found = next(following)  # over the connection that there is
        assert isinstance(found, Problem) and (found.code, found.value) == ("ship.lost", "no answer for 1 s")
        found = next(following)  # which is made anew, and not taken
        assert isinstance(found, Problem) and "timeout" in str(found.value)
        assert "timeout" in refused(lathe, f"{shop.dsn(SHIPPER)} connect_timeout=2")
    while not isinstance(found, SentRows):
        found = next(following)
    following.close()
    assert found.rows["runs"] == 1
    assert_all_there(shop, lathe)


@pytest.mark.timeout(60)
def test_a_port_that_takes_everything_and_says_nothing_is_given_up(shop: ShopServer, lathe: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        assert "timeout" in refused(lathe, f"host=127.0.0.1 port={port} dbname=shop user=x connect_timeout=2")


def test_once_says_within_seconds_that_it_waits_and_then_why_it_does_not(shop: ShopServer, lathe: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        dsn = f"host=127.0.0.1 port={silent.getsockname()[1]} dbname=shop user=x connect_timeout=4"
        done = completed(["ship", "--once", "--shop", dsn, "--data", str(lathe)], 30.0)
    first, second = done.stderr.splitlines()
    assert done.returncode == 1 and "no answer from the database for 2 s" in first and "timeout" in second


def test_a_lock_that_somebody_holds_is_named_and_nobody_waits_behind_it(shop: ShopServer, lathe: Path) -> None:
    with psycopg.connect(shop.dsn()) as held:
        held.execute("LOCK TABLE shop.runs")
        assert "lock timeout" in refused(lathe, shop.dsn(SHIPPER))
        waiting = held.execute("SELECT count(*) FROM pg_locks WHERE NOT granted").fetchone()
        assert waiting == (0,), "the server goes on waiting for a lathe that has left"
    ship(lathe, shop.dsn(SHIPPER))
    assert_all_there(shop, lathe)


def test_what_the_server_has_rolled_back_is_not_sent(shop: ShopServer, lathe: Path) -> None:
    way = f"host=127.0.0.1 dbname=shop user={SHIPPER} sslmode=disable port="
    with carried(shop, rolls_back=True) as port:
        assert refused(lathe, f"{way}{port}") == "COMMIT was answered by ROLLBACK"
    with carried(shop, rolls_back=False) as port:
        ship(lathe, f"{way}{port}")
    assert_all_there(shop, lathe)


def test_a_progress_that_the_lathe_may_not_see_is_refused_in_words(shop: ShopServer, lathe: Path) -> None:
    shop.sql("ALTER TABLE shop.progress ENABLE ROW LEVEL SECURITY")
    shop.sql("CREATE POLICY adds ON shop.progress FOR INSERT WITH CHECK (true)")
    assert "shop.progress has no row of this lathe for" in refused(lathe, shop.dsn(SHIPPER))


def test_what_lasts_is_said_at_once_and_each_minute(tmp_path: Path) -> None:
    """A port where nobody listens is refused at once; only the pauses take time, by the clock of the test."""
    now_s, waited = 0.0, list[float]()

    def waits(seconds: float) -> None:
        nonlocal now_s
        waited.append(seconds)
        now_s += seconds

    with socket.create_server(("127.0.0.1", 0)) as closed:
        port = closed.getsockname()[1]
    dsn = f"host=127.0.0.1 port={port} dbname=shop user=x"
    following = follow(tmp_path, dsn, waits=waits, clock=lambda: now_s)
    said_s = []
    for _ in range(4):
        assert isinstance(next(following), Problem)
        said_s.append(now_s)
    assert said_s == [0.0, 63.0, 123.0, 183.0]  # 1 + 2 + 4 + 8 + 16 + 32, then a minute each
    assert waited == [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 60.0, 60.0]
