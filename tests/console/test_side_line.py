"""What worker threads ask of the controller between two polls: nothing moves by it, and nothing is held up."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from console.session.data.controller_backups import compare_backup, write_backup
from console.session.station.commands import DisableDrives, EnableDrives, Home, Jog, Recover
from console.session.station.state import Activity
from drivers.commissioning.verification import verify
from drivers.errors import DriverError, LinkError, RefusedError
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.requests.permitted import Kind
from drivers.requests.side_controller import SideController
from drivers.requests.side_line import CancelledError, Heard, SideLine
from drivers.requests.status_words import read_status
from profiles.problem import Problem
from tests.compact import compact_machine
from tests.console.floor import Floor, open_floor
from tests.console.with_side import served, with_side


@pytest.fixture
def floor(tmp_path: Path) -> Floor:
    return with_side(open_floor(tmp_path))


def side_of(floor: Floor) -> SideLine:
    assert floor.context.side is not None
    return floor.context.side


def codes(error: object) -> list[str]:
    assert isinstance(error, DriverError), error
    return [problem.code for problem in error.problems]


def test_a_worker_gets_its_answers_between_the_polls(floor: Floor) -> None:
    client = SideController(side_of(floor), Kind.QUERY)
    polls = len(sent(floor))
    assert served(floor, lambda: client.query("I130", "#1->")) == ("528", "X")
    assert [line for line in sent(floor)[polls:] if line == "I130 #1->"] == ["I130 #1->"]
    words = served(floor, lambda: read_status(client, compact_machine().machine, client.dialect))
    tool = {bit.name for bit in words[0].bits if bit.is_set}
    assert {"activated", "open_loop"} <= tool and "amplifier_enabled" not in tool


def sent(floor: Floor) -> list[str]:
    """The lines that went out, as the trace of the side has them."""
    spoken = side_of(floor).heard.spoken(polls=True)
    return [each.text.rstrip("\r") for each in spoken if each.mark == ">"]


@pytest.mark.parametrize("kind", Kind)
@pytest.mark.parametrize("line", ["#1J+", "&1B1R", "I130=5", "I5=0 P1", "OPEN PROG 1 CLEAR", "P1\x0b"])
def test_whatever_a_worker_asks_nothing_is_sent_that_moves_or_writes(line: str, kind: Kind, floor: Floor) -> None:
    before = len(sent(floor))
    client = SideController(side_of(floor), kind)
    assert codes(served(floor, lambda: client.request(line)))[0].startswith("terminal.")
    assert line not in sent(floor)[before:]


def test_a_configuration_is_read_as_the_command_reads_it(floor: Floor, tmp_path: Path) -> None:
    side, machine = side_of(floor), compact_machine().machine
    client = SideController(side, Kind.LISTING)

    def read() -> tuple[str, Any, Any]:
        with side.working(reading=True):
            path = tmp_path / "a.pmac"
            written = write_backup(client, client.dialect, path)
            compared = compare_backup(client, client.dialect, machine, path)
            return written.fingerprint, compared, verify(client, machine, client.dialect)

    fingerprint, compared, verified = served(floor, read)
    direct = floor.lathe._client
    dialect = client.dialect
    assert compared.checks == () and compared.sha256 == (fingerprint, fingerprint)
    assert verified.checks == verify(direct, machine, dialect).checks
    assert write_backup(direct, dialect, tmp_path / "b.pmac").fingerprint == fingerprint


def test_no_motion_begins_while_the_configuration_is_read_and_a_stop_does(floor: Floor) -> None:
    side = side_of(floor)
    with side.working(reading=True):
        for command in (EnableDrives(), Home(), DisableDrives()):
            assert not floor.station.post(command)
            assert [problem.code for problem in floor.state.refusals] == ["beside.reading"]
        floor.stop.stop("space")
        floor.station.step()
        assert floor.state.stop is not None and floor.state.stop.rest_s is not None
        assert floor.station.post(Recover())
        floor.station.step()
    floor.do(EnableDrives())


def in_a_jog(floor: Floor, act: Callable[[Snapshot], None]) -> None:
    floor.do(EnableDrives())
    floor.do(Home())
    floor.looks.append(act)
    floor.do(Jog(axis=AxisName.CARRIAGE, distance=3.0))
    floor.looks.remove(act)


def test_in_motion_one_short_query_follows_a_poll_and_a_listing_is_refused(floor: Floor) -> None:
    side, found = side_of(floor), list[object]()
    query, listing = SideController(side, Kind.QUERY), SideController(side, Kind.LISTING)
    threads: list[threading.Thread] = []

    def work(client: SideController, line: str) -> None:
        try:
            found.append(client.request(line))
        except DriverError as error:
            found.append(codes(error))

    def act(snapshot: Snapshot) -> None:
        if snapshot.moving and not threads and floor.state.activity is Activity.JOGGING:
            threads.extend(
                threading.Thread(target=work, args=each) for each in ((query, "P5"), (listing, "LIST PLC 1"))
            )
            for thread in threads:
                thread.start()
            deadline_s = time.monotonic() + 10.0
            while side.pending < 2 and time.monotonic() < deadline_s:
                time.sleep(0.001)

    in_a_jog(floor, act)
    for thread in threads:
        thread.join(10.0)
    assert sorted(found, key=str) == [("0",), ["beside.moves"]]


def test_nothing_is_asked_while_rest_is_not_proven_nor_while_an_axis_homes(floor: Floor) -> None:
    asked_in: list[str] = []
    side, client = side_of(floor), SideController(side_of(floor), Kind.QUERY)
    thread = threading.Thread(target=lambda: client.request("P77"))

    def act(snapshot: Snapshot) -> None:
        state = floor.state
        if state.activity is Activity.HOMING and not thread.ident:
            thread.start()
            while not side.pending:
                time.sleep(0.001)
        if thread.ident and not side.pending and not asked_in:
            asked_in.append(state.activity)

    floor.do(EnableDrives())
    floor.looks.append(act)
    floor.do(Home())
    floor.idle()
    floor.idle()
    thread.join(10.0)
    assert asked_in == [Activity.READY]


def test_a_worker_that_is_cancelled_ends_and_its_line_is_not_sent(floor: Floor) -> None:
    client = SideController(side_of(floor), Kind.QUERY)
    client.cancel()
    before = len(sent(floor))
    assert isinstance(served(floor, lambda: client.request("P66"), step=False), CancelledError)
    floor.idle()
    assert "P66" not in sent(floor)[before:]


def broken(data: bytes) -> None:
    raise LinkError(Problem(code="link.lost", where="memory"))


def test_a_lost_link_ends_the_wait_with_its_reason(floor: Floor, monkeypatch: pytest.MonkeyPatch) -> None:
    client = SideController(side_of(floor), Kind.QUERY)
    monkeypatch.setattr(floor.link, "send", broken)
    found = served(floor, lambda: client.request("P1"))
    assert isinstance(found, LinkError) and not isinstance(found, RefusedError)
    assert floor.state.activity is Activity.LOST
    assert codes(served(floor, lambda: client.request("P1"))) == ["beside.silent"]


def test_the_trace_keeps_polls_apart_and_joins_what_belongs_together() -> None:
    heard = Heard(lambda: 1.0)
    heard.poll_line = b"#1P F ?"
    for mark, data in ((">", b"P10=3 #1P F ?\r"), ("<", b"1\r2\r"), ("!", b"\x01"), ("<", b"3\r\x06")):
        heard.tap(mark, data)
    heard.tap(">", b"#1J")
    heard.tap(">", b"+\r")
    heard.tap("<", b"\x07ERR003\r")
    spoken = heard.spoken(polls=False)
    assert [(each.mark, each.text) for each in spoken] == [("!", "\x01"), (">", "#1J+\r"), ("<", "\x07ERR003\r")]
    whole = heard.spoken(polls=True)
    assert [each.text for each in whole if each.poll] == ["P10=3 #1P F ?\r", "1\r2\r", "3\r\x06"]
