"""What `console metrics` serves keeps to the exposition format of Prometheus, whatever the names of jobs are."""

from __future__ import annotations

import json
import os
import re
import sqlite3
import threading
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import console.session.errors as extras
from console.session.data.record_file import FILE_NAME
from console.session.errors import SessionError
from console.session.feed.feed_state import FeedState
from console.session.feed.observed_state import ObservedState
from console.session.feed.report import report
from console.session.station.state import Activity, StationState
from console.site.cli.metrics import response
from console.site.exchange.metrics import exposition
from console.site.shop.identity import LatheIdentity, lathe_identity
from console.site.shop.outbox import RUNS, SENT, outbox
from console.text.catalogue import load
from drivers.lathe.console_role import ConsoleRole
from profiles.problem import ProblemError
from profiles.store import load_machine
from tests.console.test_run_reader import record
from tests.tui import scenes

MACHINE = load_machine("lee-2001-lathe").machine
CUTTING = replace(scenes.machine(Activity.CUTTING), cut=scenes.cut(), spindle_rpm=1000.314)

# https://prometheus.io/docs/instrumenting/exposition_formats/: the text format, version 0.0.4.
NAME, LABEL = r"[a-zA-Z_:][a-zA-Z0-9_:]*", r"[a-zA-Z_][a-zA-Z0-9_]*"
QUOTED = r'"((?:[^"\\\n]|\\["\\n])*)"'
SAMPLE = re.compile(rf"({NAME})(?:\{{((?:{LABEL}={QUOTED},?)*)\}})? (\S+)")
PAIR = re.compile(rf"({LABEL})={QUOTED}")
UNESCAPED = {r"\\": "\\", r"\"": '"', r"\n": "\n"}
Series = tuple[str, frozenset[tuple[str, str]]]


def parsed(text: str) -> dict[Series, float]:
    """The series of a text, which must keep every rule of the format."""
    assert text.endswith("\n")
    found: dict[Series, float] = {}
    helped: set[str] = set()
    typed: dict[str, str] = {}
    for line in text.split("\n")[:-1]:
        if line.startswith("# HELP "):
            name = line.split(" ", 3)[2]
            assert name not in helped  # only one for a name
            helped.add(name)
        elif line.startswith("# TYPE "):
            _, _, name, kind = line.split(" ")
            assert name not in typed and kind in ("gauge", "counter")
            assert (kind == "counter") == name.endswith("_total")
            typed[name] = kind
        else:
            match = SAMPLE.fullmatch(line)
            assert match is not None, line
            assert (
                match[1] == list(typed)[-1] and match[1] in helped
            )  # all lines of a name in one group, TYPE first
            pairs = [
                (key, re.sub(r"\\.", lambda m: UNESCAPED[m[0]], value))
                for key, value in PAIR.findall(match[2] or "")
            ]
            assert len(dict(pairs)) == len(pairs)
            series = match[1], frozenset(pairs)
            assert series not in found  # each series once
            found[series] = float(match[4])
    return found


def state(of: StationState, process: int = 7, **more: Any) -> FeedState:
    observed = ObservedState(state=of, machine=MACHINE, now_s=of.at_s, **more)
    return report(observed, process=process, operator="kim", at_utc="2026-01-01T00:00:00Z")


def of_machine(**more: str) -> frozenset[tuple[str, str]]:
    return frozenset({"machine": MACHINE.name, "simulated": "1", **more}.items())


def test_a_cut_and_its_alarms_are_counted() -> None:
    alarms, _ = scenes.alarmed()
    cutting = replace(CUTTING, alarms=alarms)
    looking_on = StationState(machine=MACHINE.name, standing=ConsoleRole.OWNER)
    found = parsed(exposition([state(cutting, parts=3), state(looking_on, 8)]))
    assert found["trilobe_consoles", frozenset()] == 2.0
    assert found["trilobe_spindle_rpm", of_machine()] == 1000.314
    assert found["trilobe_cut_turn", of_machine()] == 83.2
    assert found["trilobe_parts_total", of_machine()] == 3.0
    assert found["trilobe_activity", of_machine(activity="cutting")] == 1.0
    assert sum(value for (name, _), value in found.items() if name == "trilobe_activity") == 1.0
    counted = {labels: value for (name, labels), value in found.items() if name == "trilobe_alarms"}
    assert sum(counted.values()) == len(alarms)
    assert counted[of_machine(priority="high", state="new")] >= 1.0
    only = parsed(exposition([state(looking_on, 8)]))
    assert ("trilobe_spindle_rpm", of_machine()) not in only  # not known: no series, and no zero
    assert only["trilobe_parts_total", of_machine()] == 0.0


def test_neither_a_part_nor_a_console_makes_a_series_of_its_own() -> None:
    """Each series is kept for months: a hundred consoles, each for a part, have those of one."""
    made = set[Series]()
    for process in range(1, 101):
        for of in (CUTTING, replace(scenes.machine(Activity.MEASURING), spindle_rpm=0.0)):
            made |= parsed(
                exposition([state(of, process, job="ring", parts=process, run_id=f"{process:032x}")])
            ).keys()
    assert len(made) == len(parsed(exposition([state(CUTTING, job="ring")])))


def test_without_a_console_there_is_their_number() -> None:
    assert parsed(exposition([])) == {("trilobe_consoles", frozenset()): 0.0}


@given(st.text(alphabet=st.characters(exclude_categories=["Cs"]), max_size=20))
def test_any_name_of_a_job_comes_through(job: str) -> None:
    found = parsed(exposition([state(CUTTING, job=job)]))
    (labels,) = (dict(labels) for name, labels in found if name == "trilobe_job_info")
    assert labels["job"] == job


@pytest.mark.parametrize("job", ['a"b', "a\\nb", "a\nb", "가공"])
def test_quotes_and_lines_in_a_name_are_escaped(job: str) -> None:
    test_any_name_of_a_job_comes_through.hypothesis.inner_test(job)  # type: ignore[attr-defined]


# Which requests `console metrics` answers, and for which Host.


TEXT = load("en")
HERE = "HTTP/1.1\r\nHost: 127.0.0.1:9301\r\n\r\n"


def status(request: str, *hosts: str) -> int:
    answer = response(request.encode("latin-1"), hosts, [], TEXT)
    head, _, body = answer.partition(b"\r\n\r\n")
    assert f"Content-Length: {len(body)}".encode() in head
    return int(answer.split(b" ", 2)[1])


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost:9301", "LOCALHOST", "[::1]:9301", "127.8.0.1:1"])
def test_requests_for_loopback_are_answered(host: str) -> None:
    assert status(f"GET /metrics HTTP/1.1\r\nHost: {host}\r\n\r\n") == 200


@pytest.mark.parametrize(
    "fields",
    [
        "Host: lathe.evil.example:9301\r\n",
        "Host: 192.168.1.7\r\n",
        "Host: localhost.evil.example\r\n",
        "Host: 127.0.0.1\r\nHost: evil.example\r\n",
        "Host: [::1\r\n",
        "Host:\r\n",
        "",
        "X: y\r\n" * 500,
    ],
)
def test_a_page_whose_name_was_led_to_this_computer_gets_nothing(fields: str) -> None:
    assert status(f"GET /metrics HTTP/1.1\r\n{fields}\r\n") == 421


def test_a_name_of_this_computer_that_was_given_is_answered() -> None:
    request = "GET /metrics HTTP/1.1\r\nHost: Lathe-3.shop:9301\r\n\r\n"
    assert (status(request), status(request, "lathe-3.shop")) == (421, 200)
    assert b"--host lathe-3.shop" in response(request.encode(), (), [], TEXT)


@pytest.mark.parametrize(
    ("line", "found"),
    [("GET /metrics?a=b", 200), ("GET /", 404), ("POST /metrics", 404), ("", 404), ("\xff", 404)],
)
def test_only_the_metrics_are_served(line: str, found: int) -> None:
    assert status(f"{line} {HERE}") == found


# The outbox of a lathe: what is on its disk, in the order in which it was written; read, and never changed.


def test_only_rows_that_are_on_the_disk_are_sent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that is recorded while the journal is brought to the disk may not be there yet: it has to wait."""
    first = record(tmp_path, 2.0)
    synchronised: list[str] = []

    def fsync(descriptor: int) -> None:
        synchronised.append(Path(os.readlink(f"/proc/self/fd/{descriptor}")).name)
        monkeypatch.undo()
        record(tmp_path, 3.0)

    with closing(sqlite3.connect(tmp_path / FILE_NAME)):  # somebody has it open: the journal stays
        journal = tmp_path / f"{FILE_NAME}-wal"
        journal.touch()
        monkeypatch.setattr("console.site.shop.outbox.os.fsync", fsync)
        with outbox(tmp_path) as box:
            assert box is not None and synchronised == [journal.name]
            assert [row[1] for row in box.rows(RUNS, 0, 10)] == [first]
            assert box.file_id == first
    with outbox(tmp_path) as box:
        assert box is not None and len(list(box.rows(RUNS, 0, 10))) == 2 and box.file_id == first
        assert list(box.rows(RUNS, 1, 1)) == list(box.rows(RUNS, 1, 10))


def test_every_column_of_every_table_is_sent(tmp_path: Path) -> None:
    record(tmp_path, 2.0)
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as database:
        (names,) = zip(*database.execute("SELECT name FROM sqlite_schema WHERE type = 'table'"), strict=True)
        assert sorted(names) == sorted(table.name for table in SENT)
        for table in SENT:
            columns = tuple(row[1] for row in database.execute(f"PRAGMA table_info({table.name})"))
            assert sorted(table.columns) == sorted(columns)
        for number, table in enumerate(SENT):
            refers_to = {row[2] for row in database.execute(f"PRAGMA foreign_key_list({table.name})")}
            assert refers_to <= {other.name for other in SENT[:number]}, "sent before what it refers to"


def test_what_has_no_records_yet_or_those_of_another_console(tmp_path: Path) -> None:
    with outbox(tmp_path) as box:
        assert box is None
    (tmp_path / FILE_NAME).touch()
    with pytest.raises(SessionError) as refused, outbox(tmp_path):
        pass
    assert refused.value.problems[0].code == "record.empty"
    (tmp_path / FILE_NAME).unlink()
    record(tmp_path, 2.0)
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as database:
        database.execute("PRAGMA user_version = 99")
    with pytest.raises(SessionError) as refused, outbox(tmp_path):
        pass
    assert refused.value.problems[0].code == "record.other_schema"
    (tmp_path / FILE_NAME).write_bytes(b"no database at all" * 1000)
    with pytest.raises(SessionError) as refused, outbox(tmp_path):
        pass
    assert refused.value.problems[0].code == "record.damaged"


# A lathe has one identity, made once; what needs an optional part says which one.


Console = Callable[..., Any]


def test_it_is_made_once_also_by_consoles_that_start_together(tmp_path: Path) -> None:
    found: list[LatheIdentity] = []
    threads = [threading.Thread(target=lambda: found.append(lathe_identity(tmp_path))) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(found)) == 1 and len(found) == 8
    assert lathe_identity(tmp_path) == found[0]
    other = tmp_path / "other"
    other.mkdir()
    assert lathe_identity(other).lathe_id != found[0].lathe_id


def test_the_name_may_be_edited_and_the_id_stays(tmp_path: Path) -> None:
    first = lathe_identity(tmp_path)
    path = tmp_path / "lathe.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "name": "선반 3"}), encoding="utf-8")
    assert lathe_identity(tmp_path) == LatheIdentity(first.lathe_id, "선반 3")


@pytest.mark.parametrize(
    "content",
    [
        "",
        "{}",
        "[]",
        '{"schema": 2}',
        '{"schema": 1, "id": "x", "name": "a"}',
        '{"schema": 1, "id": 3, "name": "a"}',
        f'{{"schema": 1, "id": "{"0" * 32}", "name": " "}}',
        f'{{"schema": 1, "id": "{"0" * 32}", "name": "a\\u001b"}}',
    ],
)
def test_a_file_that_is_none_is_refused_and_not_replaced(content: str, tmp_path: Path) -> None:
    path = tmp_path / "lathe.json"
    path.write_text(content)
    with pytest.raises(ProblemError) as error:
        lathe_identity(tmp_path)
    assert error.value.problems[0].code == "ship.identity"
    assert path.read_text() == content


def test_a_folder_that_is_not_there_is_not_made(tmp_path: Path) -> None:
    with pytest.raises(SessionError) as error:
        lathe_identity(tmp_path / "typo")
    assert error.value.problems[0].code == "ship.no_folder"
    assert not (tmp_path / "typo").exists()


def test_without_the_optional_part_it_says_which_to_install(
    console: Console, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record(tmp_path / "lathe", 2.0)
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    for words in (
        ("ship", "--data", str(tmp_path / "lathe")),
        ("ship", "--once", "--data", str(tmp_path / "lathe")),
        ("records", "list", "--shop", "dbname=shop"),
    ):
        said = console(*words)
        assert (said.code, said.out) == (1, "")
        assert "pip install 'trilobe[shop]'" in said.err and "psycopg" in said.err
    said = console("records", "list", "--data", str(tmp_path / "lathe"), "--lang", "ko")
    assert said.code == 0 and "2.00" in said.out
