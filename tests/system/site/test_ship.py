"""`console ship`: what is recorded at lathes is in the shop once, in order and whole, whatever fails meanwhile."""

from __future__ import annotations

import json
import random
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from console.session.data.record_file import FILE_NAME
from console.session.data.run_reader import runs
from console.session.errors import SessionError
from console.site.shop import shipping
from console.site.shop.identity import lathe_identity
from console.site.shop.shipping import MOST_ROWS, SentRows, follow, ship
from profiles.problem import Problem
from tests.record_clock import set_dates
from tests.site.shop_server import OWNER, READER, SHIPPER, ShopServer, needs_postgresql
from tests.site.shop_server import running as running
from tests.system.site.lathe_records import (
    assert_all_there,
    copied_lathes,
    multiply,
    record_runs,
    rows_here,
    rows_in_shop,
)

pytestmark = [pytest.mark.system, needs_postgresql]
Rows = list[tuple[Any, ...]]

SHIPS = """
import sys
from pathlib import Path
from console.site.shop.shipping import ship
ship(Path(sys.argv[1]), sys.argv[2], most_rows=int(sys.argv[3]), told=lambda sent: print(sent.total, flush=True))
"""


@pytest.fixture
def shop(running: ShopServer, monkeypatch: pytest.MonkeyPatch) -> ShopServer:
    """A shop without records, and nothing that this account has said of databases."""
    for name in ("PGHOST", "PGSERVICE", "PGPASSWORD", "PGUSER", "PGDATABASE", "PGSSLMODE", "PGPASSFILE"):
        monkeypatch.delenv(name, raising=False)
    running.new_shop()
    return running


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A lathe with five runs of a console, and fifty copies of the first."""
    folder = tmp_path_factory.mktemp("recorded") / "lathe"
    record_runs(folder, 5)
    multiply(folder, 50)
    return folder


def code_of(error: pytest.ExceptionInfo[SessionError]) -> str:
    return error.value.problems[0].code


def shipper(folder: Path, shop: ShopServer, most_rows: int) -> subprocess.Popen[str]:
    words = [sys.executable, "-c", SHIPS, str(folder), shop.dsn(SHIPPER), str(most_rows)]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


def killed_after(folder: Path, shop: ShopServer, most_rows: int, transactions: int) -> None:
    """Send, and kill the sender while it sends what follows some transactions."""
    with shipper(folder, shop, most_rows) as process:
        assert process.stdout is not None
        for _ in range(transactions):
            process.stdout.readline()
        process.send_signal(signal.SIGKILL)


def test_three_lathes_with_the_same_runs_are_apart_and_whole_after_kills_and_a_crash(
    shop: ShopServer, recorded: Path, tmp_path: Path
) -> None:
    lathes = copied_lathes(recorded, tmp_path, ["lathe-1", "lathe-2", "lathe-3"])
    killed_after(lathes[0], shop, 40, 3)

    def crash(sent: SentRows) -> None:
        if sent.transactions == 4:
            shop.crash()

    with pytest.raises(SessionError) as refused:
        ship(lathes[1], shop.dsn(SHIPPER), most_rows=40, told=crash)
    assert code_of(refused) == "ship.lost"
    shop.start()
    for folder in lathes:
        ship(folder, shop.dsn(SHIPPER), most_rows=70)
        assert_all_there(shop, folder)
    assert ship(lathes[0], shop.dsn(SHIPPER)).total == 0
    counted = shop.sql("SELECT name, runs, clock_wrong FROM shop.lathes ORDER BY name", READER)
    assert counted == [("lathe-1", 55, False), ("lathe-2", 55, False), ("lathe-3", 55, False)]


@pytest.mark.long
@pytest.mark.timeout(300)
def test_forty_failures_of_either_side_lose_nothing_and_double_nothing(
    shop: ShopServer, recorded: Path, tmp_path: Path
) -> None:
    draw = random.Random(20260501)
    lathes = copied_lathes(recorded, tmp_path, ["lathe-1", "lathe-2", "lathe-3"])
    for folder in lathes:
        record_runs(folder, 2)
    for turn in range(18):
        with shipper(lathes[turn % 3], shop, 5) as one, shipper(lathes[(turn + 1) % 3], shop, 5) as other:
            assert one.stdout is not None
            for _ in range(draw.randrange(1, 4)):
                one.stdout.readline()
            if turn % 4 == 0:
                shop.crash()
                shop.start()
            one.send_signal(signal.SIGKILL)
            other.send_signal(signal.SIGKILL)
        record_runs(lathes[turn % 3], 1)
    for folder in lathes:
        ship(folder, shop.dsn(SHIPPER))
        assert_all_there(shop, folder)


@pytest.mark.long
@pytest.mark.timeout(300)
def test_the_backlog_of_a_month_is_whole_after_kills_and_a_crash(shop: ShopServer, tmp_path: Path) -> None:
    """Two shifts on 22 days, a run every 2.5 minutes: 8400, in transactions as large as usual."""
    folder = tmp_path / "lathe"
    record_runs(folder, 2)
    multiply(folder, 8398)
    for transactions in (1, 3):
        killed_after(folder, shop, MOST_ROWS, transactions)
    shop.crash()
    shop.start()
    sent = ship(folder, shop.dsn(SHIPPER))
    assert 0 < sent.rows["runs"] + sent.rows["events"] < 8400 * 6
    assert_all_there(shop, folder)
    assert len(rows_here(folder)["runs"]) == 8400


def test_two_consoles_that_record_and_two_that_send_on_one_folder(shop: ShopServer, tmp_path: Path) -> None:
    folder = tmp_path / "lathe"
    record_runs(folder, 1)
    ended = threading.Event()
    failures: list[BaseException] = []

    def guarded(act: Callable[[], object]) -> Callable[[], None]:
        def acts() -> None:
            try:
                act()
            except BaseException as error:
                failures.append(error)

        return acts

    def send() -> None:
        while not ended.is_set():
            ship(folder, shop.dsn(SHIPPER), most_rows=3)

    recording = [threading.Thread(target=guarded(lambda: record_runs(folder, 4))) for _ in range(2)]
    sending = [threading.Thread(target=guarded(send)) for _ in range(2)]
    for thread in (*recording, *sending):
        thread.start()
    for thread in recording:
        thread.join()
    ended.set()
    for thread in sending:
        thread.join()
    assert failures == []
    ship(folder, shop.dsn(SHIPPER))
    assert len(rows_here(folder)["runs"]) == 9
    assert_all_there(shop, folder)


def test_a_clock_that_is_a_day_wrong_changes_no_order_and_is_found(
    shop: ShopServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "lathe"
    record_runs(folder, 4)
    behind = (datetime.now(UTC) - timedelta(days=1)).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    with monkeypatch.context() as wrong:
        set_dates(wrong, lambda: behind)
        record_runs(folder, 4)
    monkeypatch.setattr(shipping, "clock", lambda: datetime.now(UTC) - timedelta(days=1))
    ship(folder, shop.dsn(SHIPPER))
    assert_all_there(shop, folder)
    chart = shop.sql("SELECT run_id FROM shop.run_chart ORDER BY place", READER)
    assert [run for (run,) in chart] == [row.run_id for row in reversed(runs(folder))]
    ((ahead_s, is_wrong),) = shop.sql("SELECT clock_ahead_s, clock_wrong FROM shop.lathes", READER)
    assert float(str(ahead_s)) == pytest.approx(-86400.0, abs=30.0) and is_wrong is True


def test_what_is_recorded_while_the_database_is_away_is_sent_when_it_is_back(
    shop: ShopServer, tmp_path: Path
) -> None:
    folder = tmp_path / "lathe"
    record_runs(folder, 1)
    waited: list[float] = []

    def waits(seconds: float) -> None:
        """What happens while nothing is done: the server crashes, a run is cut, two tries later it is back."""
        waited.append(seconds)
        if len(waited) == 1:
            shop.crash()
            record_runs(folder, 1)
        if len(waited) == 4:
            shop.start()

    following_it = follow(folder, shop.dsn(SHIPPER), period_s=7.0, waits=waits)
    first, lost, away, last = (next(following_it) for _ in range(4))
    following_it.close()
    assert isinstance(first, SentRows) and isinstance(last, SentRows)
    assert isinstance(lost, Problem) and isinstance(away, Problem) and lost.code == away.code == "ship.lost"
    assert (first.rows["runs"], last.rows["runs"]) == (1, 1)
    assert waited == [7.0, 1.0, 2.0, 4.0]
    assert_all_there(shop, folder)


def test_new_records_after_the_old_ones_were_put_away_are_sent_too(shop: ShopServer, tmp_path: Path) -> None:
    folder = tmp_path / "lathe"
    record_runs(folder, 2)
    ship(folder, shop.dsn(SHIPPER))
    kept = rows_here(folder)["runs"]
    for path in folder.glob(f"{FILE_NAME}*"):
        path.unlink()
    record_runs(folder, 1)
    assert ship(folder, shop.dsn(SHIPPER)).rows["runs"] == 1
    found = rows_in_shop(shop, folder)["runs"]
    assert sorted(row[1] for row in found) == sorted(row[1] for row in (*kept, *rows_here(folder)["runs"]))


def test_a_restored_backup_is_refused_and_then_gone_over_again(shop: ShopServer, tmp_path: Path) -> None:
    folder, backup = tmp_path / "lathe", tmp_path / "backup"
    record_runs(folder, 2)
    shutil.copytree(folder, backup)
    record_runs(folder, 1)
    lathe_identity(folder)
    ship(folder, shop.dsn(SHIPPER))
    lost = rows_here(folder)["runs"][-1][1]
    shutil.copy(folder / "lathe.json", backup)
    with pytest.raises(SessionError) as refused:
        ship(backup, shop.dsn(SHIPPER))
    assert code_of(refused) == "ship.diverged"
    record_runs(backup, 3)
    with pytest.raises(SessionError) as refused:
        ship(backup, shop.dsn(SHIPPER))
    assert code_of(refused) == "ship.diverged"
    ship(backup, shop.dsn(SHIPPER), again=True)
    record_runs(backup, 1)
    ship(backup, shop.dsn(SHIPPER))
    here = {row[1] for row in rows_here(backup)["runs"]}
    found = [row[1] for row in rows_in_shop(shop, backup)["runs"]]
    assert len(found) == len(set(found)) == 7 and set(found) == here | {lost}
    events = [row[1:] for row in rows_in_shop(shop, backup)["events"]]
    assert {row[1:] for row in rows_here(backup)["events"]} <= set(events)


def test_rows_that_the_shop_has_already_are_not_taken_for_a_lost_connection(
    shop: ShopServer, tmp_path: Path
) -> None:
    record_runs(tmp_path, 2)
    ship(tmp_path, shop.dsn(SHIPPER))
    shop.sql("UPDATE shop.progress SET last_row = 0, last_mark = ''")
    with pytest.raises(SessionError) as refused:
        ship(tmp_path, shop.dsn(SHIPPER))
    assert code_of(refused) == "ship.diverged"
    ship(tmp_path, shop.dsn(SHIPPER), again=True)
    assert_all_there(shop, tmp_path)


def test_a_lathe_can_add_rows_and_nothing_else(shop: ShopServer, tmp_path: Path) -> None:
    import psycopg

    record_runs(tmp_path / "lathe", 1)
    ship(tmp_path / "lathe", shop.dsn(SHIPPER))
    tables = ("runs", "events", "measurements", "traces", "telemetry", "texts", "contacts")
    for table in tables:
        for line in (f"SELECT * FROM shop.{table}", f"DELETE FROM shop.{table}", f"TRUNCATE shop.{table}"):
            with pytest.raises(psycopg.errors.InsufficientPrivilege):
                shop.sql(line, SHIPPER)
    for line in (
        "UPDATE shop.runs SET job = 'other'",
        "DELETE FROM shop.progress",
        "UPDATE shop.progress SET lathe_id = 'other'",
        "CREATE TABLE shop.mine ()",
        "INSERT INTO shop.migrations (number, name, sha256) VALUES (9, '', '')",
    ):
        with pytest.raises(psycopg.errors.InsufficientPrivilege):
            shop.sql(line, SHIPPER)
    with pytest.raises(psycopg.errors.InsufficientPrivilege):
        shop.sql("INSERT INTO shop.contacts VALUES ('', '', '', now())", READER)
    with pytest.raises(psycopg.errors.CheckViolation):
        shop.sql("INSERT INTO shop.texts VALUES (repeat('0', 64), 'another text')", SHIPPER)


def test_a_database_without_the_schema_or_of_another_console_is_refused(shop: ShopServer, tmp_path: Path) -> None:
    record_runs(tmp_path, 1)
    shop.sql("DELETE FROM shop.migrations WHERE number > 1")
    shop.sql("UPDATE shop.migrations SET number = 0")
    for change, code in (
        (None, "ship.older_schema"),
        ("INSERT INTO shop.migrations VALUES (99, '0099_later.sql', '')", "ship.newer_schema"),
        ("DELETE FROM shop.migrations WHERE number = 99", "ship.older_schema"),
        ("UPDATE shop.migrations SET number = 1, sha256 = 'changed'", "ship.changed_schema"),
        ("DROP SCHEMA shop CASCADE", "ship.no_schema"),
    ):
        if change is not None:
            shop.sql(change)
        with pytest.raises(SessionError) as refused:
            ship(tmp_path, shop.dsn(OWNER))
        assert code_of(refused) == code
    assert rows_here(tmp_path)["runs"]


def test_a_following_console_waits_for_the_owner_to_migrate(shop: ShopServer, tmp_path: Path) -> None:
    from console.site.shop.schema import migrate

    record_runs(tmp_path, 1)
    shop.sql("DROP SCHEMA shop CASCADE")
    found = follow(tmp_path, shop.dsn(OWNER), waits=lambda seconds: migrate(shop.dsn(OWNER)))
    first, second = next(found), next(found)
    assert isinstance(first, Problem) and first.code == "ship.no_schema" and first.code in shipping.PASSING
    assert isinstance(second, SentRows) and second.rows["runs"] == 1


def test_the_list_of_the_shop_is_that_of_the_lathe(
    shop: ShopServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from console.__main__ import main

    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "home"))
    folder = tmp_path / "one"
    record_runs(folder, 6)
    record_runs(folder, 1, job="bar", machine="other", simulated=1)
    one, two = copied_lathes(folder, tmp_path / "lathes", ["lathe-1", "lathe-2"])

    def said(*words: str) -> Any:
        capsys.readouterr()
        assert main(["records", *words, "--json"]) == 0, capsys.readouterr().err
        return json.loads(capsys.readouterr().out)

    ship(one, shop.dsn(SHIPPER))
    of_shop, of_lathe = ("--shop", shop.dsn(READER)), ("--data", str(one))
    first = rows_here(one)["runs"][0][1]
    for words in (
        ("list",),
        ("list", "--failed"),
        ("list", "--job", "bar"),
        ("list", "--machine", "lathe", "--limit", "3"),
        ("list", "--since", "2100-01-01"),
    ):
        here, there = said(*words, *of_lathe), said(*words, *of_shop)
        assert {run.pop("lathe") for run in there["runs"]} == ({"lathe-1"} if here["runs"] else set())
        assert there == here
    for action in ("show", "debrief"):
        there = said(action, first[:8], *of_shop)
        there.pop("lathe", None)
        assert there == said(action, first[:8], *of_lathe)
    exported = tmp_path / "exported"
    assert main(["records", "export", str(exported), "--traces", *of_shop]) == 0
    assert len((exported / "runs.jsonl").read_text().splitlines()) == 7
    assert len(list(exported.glob("*.trace*"))) == 7

    ship(two, shop.dsn(SHIPPER))
    assert len(said("list", *of_shop)["runs"]) == 14
    assert {run["lathe"] for run in said("list", *of_shop, "--lathe", "lathe-2")["runs"]} == {"lathe-2"}
    for words, code in ((("show", first), 1), (("list", "--lathe", "lathe-9"), 1)):
        assert main(["records", *words, *of_shop]) == code
    assert main(["records", "list", "--lathe", "lathe-2"]) == 2
    said_of = capsys.readouterr().err
    assert "lathe-1 | lathe-2" in said_of and "--lathe" in said_of and "Traceback" not in said_of


def test_a_followed_lathe_ends_with_ctrl_c(shop: ShopServer, tmp_path: Path) -> None:
    record_runs(tmp_path, 1)
    words = ["ship", "--shop", shop.dsn(SHIPPER), "--data", str(tmp_path), "--json"]
    with subprocess.Popen(
        [sys.executable, "-m", "console", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None and process.stderr is not None
        line = json.loads(process.stdout.readline())
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
        assert process.stderr.read() == ""
    assert line["rows"]["runs"] == 1 and line["left"] == 0
    with suppress(ProcessLookupError):
        process.kill()
