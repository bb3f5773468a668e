"""What worker threads ask between two polls, and the scope: nothing is taken from anybody."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.session.data.controller_backups import compare_backup, write_backup
from console.session.station import jogging
from console.session.station.commands import DisableDrives, EnableDrives, Home, Jog, Recover, Start
from console.session.station.state import Activity
from console.tui.further.scope import ScopeWork
from drivers.commissioning.verification import verify
from drivers.errors import DriverError, LinkError, RefusedError
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.link.memory import MemoryLink
from drivers.link.passing import TappedLink
from drivers.pmac.client import PmacClient
from drivers.requests.permitted_lines import RequestKind
from drivers.requests.scope_gather import (
    ANGLE,
    Channel,
    MotorRegister,
    ScopeRecord,
    ScopeSetup,
    ScopeTrigger,
)
from drivers.requests.side_controller import SideController
from drivers.requests.side_line import CancelledError, LineTraffic, SideLine
from drivers.requests.status_words import read_status
from profiles.problem import Problem
from tests.compact import compact_machine
from tests.console.floor import Floor, experiment_1, open_floor
from tests.drivers.families import of_family

MOST_STEPS = 20_000


def with_side(floor: Floor) -> Floor:
    """Give a station its side line, with all that goes over the link from now on."""
    client: Any = floor.lathe._client
    heard = LineTraffic(floor.sim.now_s)
    heard.poll_line = floor.lathe.poll_line.encode("ascii")
    client.link = client._exchange.link = TappedLink(client.link, heard.tap)
    floor.context.side = SideLine(client, floor.sim, heard, lambda: floor.stop.reason is not None)
    return floor


def served(floor: Floor, work: Callable[[], Any], *, step: bool = True, idle_s: float = 0.05) -> Any:
    """Return what some work in a thread returns or raises, while the station polls."""
    found: list[Any] = []

    def run() -> None:
        try:
            found.append(work())
        except BaseException as error:
            found.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    for _ in range(MOST_STEPS):
        if not thread.is_alive():
            break
        if step:
            floor.idle(idle_s)
        time.sleep(0.0005)
    thread.join(5.0)
    assert found, "the work has not ended"
    return found[0]


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
    client = SideController(side_of(floor), RequestKind.QUERY)
    polls = len(sent(floor))
    assert served(floor, lambda: client.query("I130", "#1->")) == ("528", "X")
    assert [line for line in sent(floor)[polls:] if line == "I130 #1->"] == ["I130 #1->"]
    words = served(floor, lambda: read_status(client, compact_machine().machine, client.dialect))
    tool = {bit.name for bit in words[0].bits if bit.is_set}
    assert {"activated", "open_loop"} <= tool and "amplifier_enabled" not in tool


def sent(floor: Floor) -> list[str]:
    """The lines that went out, as the trace of the side has them."""
    spoken = side_of(floor).heard.list_traffic(polls=True)
    return [each.text.rstrip("\r") for each in spoken if each.mark == ">"]


@pytest.mark.parametrize("kind", RequestKind)
@pytest.mark.parametrize("line", ["#1J+", "&1B1R", "I130=5", "I5=0 P1", "OPEN PROG 1 CLEAR", "P1\x0b"])
def test_whatever_a_worker_asks_nothing_is_sent_that_moves_or_writes(
    line: str, kind: RequestKind, floor: Floor
) -> None:
    before = len(sent(floor))
    client = SideController(side_of(floor), kind)
    assert codes(served(floor, lambda: client.request(line)))[0].startswith("terminal.")
    assert line not in sent(floor)[before:]


def test_a_configuration_is_read_as_the_command_reads_it(floor: Floor, tmp_path: Path) -> None:
    side, machine = side_of(floor), compact_machine().machine
    client = SideController(side, RequestKind.LISTING)

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
    floor.do(EnableDrives(), Home())
    floor.looks.append(act)
    floor.do(Jog(axis=AxisName.CARRIAGE, distance=3.0))
    floor.looks.remove(act)


def test_in_motion_one_short_query_follows_a_poll_and_a_listing_is_refused(floor: Floor) -> None:
    side, found = side_of(floor), list[object]()
    query, listing = SideController(side, RequestKind.QUERY), SideController(side, RequestKind.LISTING)
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
    side, client = side_of(floor), SideController(side_of(floor), RequestKind.QUERY)
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
    client = SideController(side_of(floor), RequestKind.QUERY)
    client.cancel()
    before = len(sent(floor))
    assert isinstance(served(floor, lambda: client.request("P66"), step=False), CancelledError)
    floor.idle()
    assert "P66" not in sent(floor)[before:]


def broken(data: bytes) -> None:
    raise LinkError(Problem(code="link.lost", where="memory"))


def test_a_lost_link_ends_the_wait_with_its_reason(floor: Floor, monkeypatch: pytest.MonkeyPatch) -> None:
    client = SideController(side_of(floor), RequestKind.QUERY)
    monkeypatch.setattr(floor.link, "send", broken)
    found = served(floor, lambda: client.request("P1"))
    assert isinstance(found, LinkError) and not isinstance(found, RefusedError)
    assert floor.state.activity is Activity.LOST
    assert codes(served(floor, lambda: client.request("P1"))) == ["beside.silent"]


def test_the_trace_keeps_polls_apart_and_joins_what_belongs_together() -> None:
    heard = LineTraffic(lambda: 1.0)
    heard.poll_line = b"#1P F ?"
    for mark, data in ((">", b"P10=3 #1P F ?\r"), ("<", b"1\r2\r"), ("!", b"\x01"), ("<", b"3\r\x06")):
        heard.tap(mark, data)
    heard.tap(">", b"#1J")
    heard.tap(">", b"+\r")
    heard.tap("<", b"\x07ERR003\r")
    spoken = heard.list_traffic(polls=False)
    assert [(each.mark, each.text) for each in spoken] == [("!", "\x01"), (">", "#1J+\r"), ("<", "\x07ERR003\r")]
    whole = heard.list_traffic(polls=True)
    assert [each.text for each in whole if each.poll] == ["P10=3 #1P F ?\r", "1\r2\r", "3\r\x06"]


CARRIAGE = Channel(AxisName.CARRIAGE, MotorRegister.ACTUAL)
SPEED = Channel(AxisName.CARRIAGE, MotorRegister.VELOCITY)
TOOL = Channel(AxisName.TOOL, MotorRegister.COMMANDED)


@pytest.fixture(params=["pmac", "turbo"])
def families(request: pytest.FixtureRequest, tmp_path: Path) -> Floor:
    loaded = compact_machine()
    machine = of_family(loaded.machine, request.param)
    return with_side(open_floor(tmp_path, machine=replace(loaded, machine=machine)))


def work_of(floor: Floor) -> ScopeWork:
    class Control:
        """What the work of the page sees of a station."""

        state = property(lambda _: floor.state)
        now_s = staticmethod(floor.sim.now_s)

    control: Any = Control()
    return ScopeWork(side_of(floor), floor.context.loaded_machine.machine, control)


def gathered(floor: Floor, setup: ScopeSetup, act: Callable[[ScopeWork], object] = lambda work: None) -> Any:
    """Gather at rest, and do something when samples are being taken."""
    work, done = work_of(floor), list[object]()

    def look(snapshot: Snapshot) -> None:
        if work.progress.stage in ("gathering", "waiting") and not done:
            done.append(None)
            act(work)

    floor.looks.append(look)
    return served(floor, lambda: work.record(setup, "now"))


def status(floor: Floor) -> tuple[str, ...]:
    client: Any = floor.lathe._client
    found: tuple[str, ...] = client.request("SIZE")
    return found


SHORT = ScopeSetup(channels=(CARRIAGE, SPEED), period_cycles=10, length_s=0.2)


def test_at_rest_the_positions_stand_and_the_buffer_is_given_back(families: Floor) -> None:
    before = status(families)
    record = gathered(families, SHORT)
    assert isinstance(record, ScopeRecord), record
    cycle_s = families.context.machine.controller.servo_period_ms / 1000.0
    assert np.allclose(np.diff(record.times_s), 10 * cycle_s) and abs(record.times_s[-1] - 0.2) < 0.01
    assert np.ptp(record.values[CARRIAGE]) < 1e-6 and np.allclose(record.values[SPEED], 0.0, atol=1e-4)
    assert status(families) == before


def jog(floor: Floor, work: ScopeWork, setup: ScopeSetup, distance_mm: float) -> Any:
    """Jog the carriage while a thread gathers."""
    floor.do(EnableDrives(), Home())
    begun: list[bool] = []

    def look(snapshot: Snapshot) -> None:
        if not begun and work.progress.stage == "gathering":
            begun.append(True)
            assert floor.station.post(Jog(axis=AxisName.CARRIAGE, distance=distance_mm))
        time.sleep(0.001)  # the worker has the time between two polls, as it has at a machine

    floor.looks.append(look)
    found = served(floor, lambda: work.record(setup, "now"))
    assert begun
    return found


def test_a_jog_is_seen_with_its_length_and_its_speed(families: Floor) -> None:
    record = jog(families, work_of(families), replace(SHORT, length_s=1.0), 2.0)
    assert isinstance(record, ScopeRecord), record
    moved_mm = 1000.0 * (record.values[CARRIAGE][-1] - record.values[CARRIAGE][0])
    assert abs(moved_mm) == pytest.approx(2.0, abs=0.02)
    times, speed = record.times_s, record.values[SPEED]
    # Each sample is the whole counts of one servo cycle in ten, 2.26 mm/s apart: 3 sd of some fifty are 0.09 mm.
    assert np.trapezoid(speed, times) == pytest.approx(moved_mm / 1000.0, abs=9e-5)
    assert families.state.alarms == ()


def test_a_level_is_found_in_the_samples_and_time_counts_from_there(families: Floor) -> None:
    ahead = jogging.counts_per_unit(families.context.machine, AxisName.CARRIAGE) > 0.0
    setup = replace(SHORT, length_s=0.5, trigger=ScopeTrigger.RISING, level_of=SPEED, level=1.0)
    record = jog(families, work_of(families), setup, 2.0 if ahead else -2.0)
    assert isinstance(record, ScopeRecord), record
    (place,) = np.flatnonzero(record.times_s == 0.0)
    shown_mm_s = record.values[SPEED] * 1e3
    assert shown_mm_s[place] > 1.0 >= shown_mm_s[place - 1] and record.times_s[0] < 0.0


@pytest.mark.first(1)
def test_a_cut_starts_the_record_and_is_not_disturbed_by_it(families: Floor) -> None:
    job = experiment_1()
    families.set_up(job)
    families.arm(job)
    setup = ScopeSetup(channels=(TOOL, ANGLE), period_cycles=5, length_s=1.0, trigger=ScopeTrigger.CUT)
    work = work_of(families)

    def look(snapshot: Snapshot) -> None:
        time.sleep(0.0005)
        if work.progress.stage == "waiting" and families.state.armed and not started:
            started.append(True)
            assert families.station.post(Start())

    started: list[bool] = []
    families.looks.append(look)
    record = served(families, lambda: work.record(setup, "now"))
    assert isinstance(record, ScopeRecord), record
    turns = abs(record.values[ANGLE][-1] - record.values[ANGLE][0]) / (2.0 * np.pi)
    assert turns > 1.0 and started
    for _ in range(2000):
        if families.state.activity is Activity.READY:
            break
        families.idle()
    assert families.state.cut_done and families.state.alarms == ()


def another_host(floor: Floor) -> PmacClient:
    other = PmacClient(MemoryLink(floor.sim.connect(), floor.sim), floor.sim)
    other.connect()
    return other


def test_another_host_that_gathers_is_left_alone(families: Floor) -> None:
    other = another_host(families)
    gather = other.dialect.gathering
    other.request(f"I{gather.period}=1 I{gather.masks[0]}=1 I{gather.first_source}=$800028")
    other.request("DEFINE GATHER 20000")
    other.request("GATHER")
    assert codes(gathered(families, SHORT)) == ["scope.in_use"]
    assert len(other.request("LIST GATHER 0,16")[0].split()) == 16


@pytest.mark.parametrize("what", ["period", "buffer"])
def test_another_host_that_changes_the_set_up_meanwhile_is_noticed(what: str, families: Floor) -> None:
    other = another_host(families)
    period = other.dialect.gathering.period

    def act(work: ScopeWork) -> None:
        if what == "period":
            other.request(f"I{period}=3")
        else:
            other.request("ENDGATHER")
            other.request("DELETE GATHER")

    assert codes(gathered(families, SHORT, act)) == ["scope.changed"]
    assert other.numbers(f"I{period}") == ((3.0,) if what == "period" else (10.0,))


def test_a_link_lost_while_gathering_ends_it_with_the_reason(families: Floor) -> None:
    def act(work: ScopeWork) -> None:
        families.link.send = broken  # type: ignore[method-assign]

    found = gathered(families, replace(SHORT, length_s=0.5), act)
    assert codes(found)[0] in ("link.lost", "beside.silent")
    assert families.state.activity is Activity.LOST


def test_a_record_is_ended_by_its_operator_and_the_buffer_is_given_back(families: Floor) -> None:
    before = status(families)
    found = gathered(families, replace(SHORT, length_s=5.0), lambda work: work.client.cancel())
    assert isinstance(found, CancelledError)
    families.idle()
    assert status(families) == before
