"""The lathe behind its controller, and the record of how it stops."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import replace
from datetime import date, timedelta
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.commissioning.stop_record import (
    PriorMotion,
    StopEntry,
    StopMethod,
    StopRecord,
    StopsNow,
    needed_stops,
    record_problems,
    stop_key,
)
from drivers.errors import ControllerError, DriverError, LinkError
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.lathe.stop import StopPath, StoppedError
from drivers.link.base import StopWay
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.program_text import read_program
from drivers.simulator.hosts.port import Port
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.store import load_machine
from tests.drivers.commissioned import commissioned
from tests.drivers.conftest import Bench
from tests.drivers.families import machine as machine

SLOW = "OPEN PROG 3\nCLEAR\nINC\nTA100 TS0 TM60000\nZ60000\nCLOSE\n"


class NoisyLink(MemoryLink):
    """A wire that changes what is sent over it."""

    def __init__(self, port: Port, sim: SimulatedLathe, spoil: Callable[[bytes], bytes]) -> None:
        super().__init__(port, sim)
        self._spoil = spoil

    def send(self, data: bytes) -> None:
        super().send(self._spoil(data))


def over(bench: Bench, machine: MachineProfile, spoil: Callable[[bytes], bytes]) -> Lathe:
    link = NoisyLink(bench.port, bench.sim, spoil)
    return Lathe(PmacClient(link, bench.sim), machine, bench.sim, StopPath(link))


def stands_still(bench: Bench, seconds: float = 2.0) -> bool:
    before = [axis.position for axis in bench.lathe.snapshot().axes]
    bench.sim.wait(seconds)
    after = [axis.position for axis in bench.lathe.snapshot().axes]
    # A killed axis may still creep by the counts that are below what the proof of rest can see.
    return all(abs(a - b) <= 10 for a, b in zip(before, after, strict=True)) and not bench.moving


def test_a_machine_that_is_set_as_its_profile_says_has_nothing_to_report(bench: Bench) -> None:
    assert bench.lathe.verify() == ()
    bench.client.request("I115=0.25 #3->0")
    assert bench.lathe.verify() == bench.lathe.verify()
    assert bench.number("I115") == 0.25
    bench.lathe.program.load(read_program(SLOW))
    assert bench.client.request("LIST PROG 3") == ("INC", "TA100TS0TM60000", "Z60000", "RET")


@pytest.mark.parametrize(
    ("line", "key", "value", "limit"),
    [
        ("I115=0.25", "I115", "0.25", "40"),
        ("I217=39.8", "I217", "39.8", "39.79"),
        ("I10=3713706", "I10", "3713706", "3713707"),
        ("I138=0.25", "I138", "0.25", "0"),  # of a notch filter, of which the profile says nothing
        ("#1->-X", "#1->", "-1X", "X"),
        ("#3->0", "#3->", "0", "Z"),
        ("#2->Y+1", "#2->", "Y+1", "Y"),
    ],
)
def test_a_setting_that_was_changed_is_found(bench: Bench, line: str, key: str, value: str, limit: str) -> None:
    bench.client.request(line)
    (problem,) = bench.lathe.verify()
    assert (problem.code, problem.key, problem.value, problem.limit) == ("controller.setting", key, value, limit)


@pytest.mark.parametrize(
    ("before", "after", "place"),
    [(b"Z60000", b"Z61000", "line 3"), (b"INC", b"", "line 1"), (b"Z60000", b"Z60000\rX1", "line 4")],
)
def test_a_program_that_arrives_changed_is_refused(
    bench: Bench, machine: MachineProfile, before: bytes, after: bytes, place: str
) -> None:
    lathe = over(bench, machine, lambda data: data.replace(before, after))
    with pytest.raises(DriverError) as refused:
        lathe.program.load(read_program(SLOW))
    assert refused.value.problems[0].code in ("controller.program_differs", "link.out_of_step")
    if b"\r" not in after:
        assert refused.value.problems[0].key == place


def test_a_line_that_the_controller_refuses_is_named(bench: Bench, machine: MachineProfile) -> None:
    lathe = over(bench, machine, lambda data: data.replace(b"Z60000", b"?Z60000 <="))
    with pytest.raises(ControllerError) as refused:
        lathe.program.load(read_program(SLOW))
    assert (refused.value.error_number, refused.value.problems[0].value) == (3, "Z60000")
    assert bench.sim.controller.open_buffer is None


def test_a_snapshot_shows_positions_errors_and_flags_of_one_instant(bench: Bench) -> None:
    snapshot = bench.lathe.snapshot()
    assert not snapshot.loops_closed
    assert snapshot.at_rest
    assert not snapshot.in_position
    assert snapshot.faults == ()
    bench.lathe.enable()
    bench.client.request("#3J+")
    bench.sim.wait(1.0)
    snapshot = bench.lathe.snapshot()
    assert snapshot.loops_closed
    assert not snapshot.at_rest
    assert snapshot.carriage.position == pytest.approx(10 * (1000 - 50), abs=200)
    assert snapshot.at_s == pytest.approx(bench.sim.now_s())


def test_homing_and_jogging_arrive_before_they_return(closed: Bench) -> None:
    closed.lathe.home()
    assert closed.lathe.snapshot().homed
    closed.lathe.jog_to(AxisName.TOOL, 12_345.0)
    closed.lathe.jog_to(AxisName.SPINDLE, -2_500.0)
    snapshot = closed.lathe.snapshot()
    assert snapshot.at_rest
    assert snapshot.tool.position == pytest.approx(12_345, abs=10)
    assert snapshot.spindle.position == -2_500


def test_an_axis_that_does_not_close_is_told(bench: Bench, machine: MachineProfile) -> None:
    lathe = over(bench, machine, lambda data: data.replace(b"#2J/", b"#2K"))
    with pytest.raises(DriverError) as refused:
        lathe.enable()
    assert refused.value.problems[0].code == "machine.not_enabled"


def test_a_program_is_followed_to_its_end_and_every_look_is_shown(closed: Bench) -> None:
    closed.lathe.program.load(read_program("OPEN PROG 3\nCLEAR\nINC\nTA100 TS0 TM1000\nZ1000\nZ1000\nCLOSE\n"))
    seen: list[Snapshot] = []
    closed.lathe.program.start(3, 0.0)
    began = closed.sim.now_s()
    last = closed.lathe.program.follow(seen.append, timeout_s=10.0)
    assert last.in_position
    assert last.carriage.position == pytest.approx(2000)
    assert closed.sim.now_s() - began == pytest.approx(2.1, abs=0.1)
    times = [snapshot.at_s for snapshot in seen]
    assert len(times) > 50
    assert times == sorted(times)


def test_a_program_that_takes_too_long_is_stopped(closed: Bench) -> None:
    closed.lathe.program.load(read_program(SLOW))
    closed.lathe.program.start(3, 0.0)
    began = closed.sim.now_s()
    with pytest.raises(DriverError) as late:
        closed.lathe.program.follow(lambda snapshot: None, timeout_s=1.0)
    assert late.value.problems[0].code == "machine.timeout"
    assert closed.sim.now_s() - began == pytest.approx(1.0, abs=0.1)
    closed.lathe.wait_for_rest()
    assert stands_still(closed)
    with pytest.raises(StoppedError):
        closed.lathe.program.start(3, 0.0)


def test_a_fault_under_way_stops_the_machine_and_is_named(closed: Bench) -> None:
    closed.client.request("I111=160 I117=0")
    closed.lathe.program.load(read_program("OPEN PROG 3\nCLEAR\nINC\nTA1 TS0 TM100\nX40000\nZ1000\nCLOSE\n"))
    closed.lathe.program.start(3, 0.0)
    with pytest.raises(DriverError) as fault:
        closed.lathe.program.follow(lambda snapshot: None, timeout_s=10.0)
    assert fault.value.problems[0].code == "machine.fault"
    assert "tool: fatal_following_error" in fault.value.problems[0].value
    assert [problem.code for problem in fault.value.problems[1:]] == ["machine.tool_left_behind"]
    closed.lathe.wait_for_rest()
    assert not any(motor.enabled for motor in closed.sim.controller.motors.values()), "nothing is energised again"


def test_a_run_time_error_is_a_fault(closed: Bench) -> None:
    closed.lathe.program.load(read_program("OPEN PROG 3\nCLEAR\nINC\nTA1 TS0 TM100\nZ10\nP(0-1)=1\nCLOSE\n"))
    closed.lathe.program.start(3, 0.0)
    with pytest.raises(DriverError) as fault:
        closed.lathe.program.follow(lambda snapshot: None, timeout_s=10.0)
    assert "program: runtime_error" in fault.value.problems[0].value


def test_a_stop_inside_the_watch_ends_the_wait_and_nothing_moves_afterwards(closed: Bench) -> None:
    closed.lathe.program.load(read_program(SLOW))
    closed.lathe.program.start(3, 0.0)
    closed.sim.wait(0.5)
    with pytest.raises(StoppedError) as stopped:
        closed.lathe.program.follow(lambda snapshot: closed.stop.stop("operator"), timeout_s=10.0)
    assert stopped.value.problems[0].value == "operator"
    snapshot = closed.lathe.wait_for_rest()
    assert snapshot.at_rest
    assert stands_still(closed)
    assert snapshot.loops_closed, "an abort, because every loop was closed"


@pytest.mark.parametrize("kill", [False, True])
def test_a_stop_from_another_thread_ends_a_jog(closed: Bench, kill: bool) -> None:
    """The thread presses while the first one waits inside the simulated machine."""
    waits = 0
    original = closed.sim.wait

    def wait(seconds: float) -> None:
        nonlocal waits
        waits += 1
        if waits == 20:
            press = closed.stop.kill if kill else closed.stop.stop
            thread = threading.Thread(target=press, args=("emergency",))
            thread.start()
            thread.join()
        original(seconds)

    closed.sim.wait = wait  # type: ignore[method-assign]
    with pytest.raises(StoppedError):
        closed.lathe.jog_to(AxisName.CARRIAGE, 100_000.0)
    closed.sim.wait = original  # type: ignore[method-assign]
    closed.lathe.wait_for_rest()
    assert stands_still(closed)
    assert closed.lathe.snapshot().loops_closed is not kill


@pytest.mark.parametrize(
    "act",
    [
        lambda lathe: lathe.enable(),
        lambda lathe: lathe.home(),
        lambda lathe: lathe.jog_to(AxisName.TOOL, 100.0),
        lambda lathe: lathe.program.load(read_program(SLOW)),
        lambda lathe: lathe.program.start(3, 0.0),
    ],
)
def test_after_a_stop_nothing_that_moves_is_sent(closed: Bench, act: Callable[[Lathe], None]) -> None:
    closed.stop.stop("operator")
    closed.sim.wait(0.1)
    before = [axis.position for axis in closed.lathe.snapshot().axes]
    with pytest.raises(StoppedError):
        act(closed.lathe)
    closed.sim.wait(1.0)
    assert [axis.position for axis in closed.lathe.snapshot().axes] == before


def test_waiting_for_rest_repeats_the_stop_until_it_is_proven(closed: Bench) -> None:
    closed.client.request("#2J+")
    closed.sim.wait(1.0)
    closed.lathe.snapshot()
    snapshot = closed.lathe.wait_for_rest()
    assert snapshot.loops_closed
    assert snapshot.at_rest
    assert stands_still(closed)


def test_a_machine_that_does_not_come_to_rest_is_told(closed: Bench) -> None:
    closed.client.request("I315=0 #3J+")
    closed.sim.wait(1.0)
    closed.lathe.snapshot()
    with pytest.raises(DriverError) as moving:
        closed.lathe.wait_for_rest()
    assert moving.value.problems[0].code == "machine.not_at_rest"


@pytest.mark.parametrize("reply", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n", b"\x00", b"\xff\x06", b"1.17\r"])
def test_something_that_is_no_controller_is_told(bench: Bench, machine: MachineProfile, reply: bytes) -> None:
    """Whatever it is, it chatters without end; the console gives up within seconds."""

    class Chatter(MemoryLink):
        def receive(self, timeout_s: float) -> bytes:
            bench.sim.wait(0.01)
            return reply

    link = Chatter(bench.port, bench.sim)
    lathe = Lathe(PmacClient(link, bench.sim), machine, bench.sim, StopPath(link))
    with pytest.raises(LinkError):
        lathe.connect()
    assert bench.sim.now_s() < 30


# Which stop record is believed: of this machine, with these settings, complete, and not too old.

TODAY = date(2026, 3, 1)
LATHE = load_machine("lee-2001-lathe").machine
NEEDED = tuple(
    (way, origin, axis) for way in StopMethod for origin in PriorMotion for axis in ("tool", "spindle", "carriage")
)
KEY = "5" * 64
NOW = StopsNow(machine=LATHE, key=KEY, today=TODAY, stop_way=StopWay.DIRECT, address="tcp:lathe:1")


def entry(way: StopMethod, origin: PriorMotion, axis: str) -> StopEntry:
    """A tenth of a second from 10 mm/s or 100 rpm: less than 1 mm, less than 60 deg."""
    if axis == "spindle":
        return StopEntry(way=way, origin=origin, axis=axis, time_s=0.1, distance_deg=30.0, speed_rpm=100.0)
    return StopEntry(way=way, origin=origin, axis=axis, time_s=0.1, distance_mm=0.2, speed_mm_per_s=10.0)


def record() -> StopRecord:
    return StopRecord(
        machine=LATHE.name,
        kind="PMAC1",
        version="1.17",
        key=KEY,
        measured_at=TODAY,
        address="tcp:lathe:1",
        stop_way=StopWay.DIRECT,
        entries=tuple(entry(*each) for each in NEEDED),
    )


def codes(met: StopRecord | None, **now: Any) -> list[str]:
    return [problem.code for problem in record_problems(met, replace(NOW, **now))]


def test_without_a_record_nothing_is_armed() -> None:
    assert codes(None) == ["stops.no_record"]


@given(st.integers(min_value=-400, max_value=400))
def test_a_record_is_believed_for_half_a_year_and_not_from_the_future(days: int) -> None:
    target = ["stops.in_future"] if days < 0 else ["stops.expired"] if days > 180 else []
    assert codes(record(), today=TODAY + timedelta(days=days)) == target


def test_everything_that_is_wrong_is_said_at_once() -> None:
    met = replace(record(), machine="its sister", address="tcp:other:1", entries=record().entries[1:])
    later = TODAY + timedelta(days=181)
    found = record_problems(met, replace(NOW, today=later, key="6" * 64, stop_way=StopWay.RESERVED))
    assert [problem.code for problem in found] == (
        "stops.other_machine stops.other_address stops.expired stops.other_settings stops.other_way "
        "stops.incomplete"
    ).split()
    assert (found[0].value, found[0].limit) == ("its sister", LATHE.name)
    assert (found[1].value, found[1].limit) == ("tcp:other:1", "tcp:lathe:1")
    assert found[2].value == "2026-03-01"
    assert (found[4].value, found[4].limit) == ("direct", "reserved")
    assert found[5].value == "abort jog tool"


def test_another_link_may_lead_to_another_machine_and_a_connection_for_stops_does_not() -> None:
    board = replace(record(), address="ethernet:lathe")
    assert codes(board, address="ethernet:lathe?stop=reserved") == []
    assert codes(board, address="ethernet:its-sister") == ["stops.other_address"]
    assert codes(board, address=None) == []  # a copy of a simulated machine has no link


@given(st.sets(st.sampled_from(NEEDED), min_size=1))
def test_no_stop_may_be_missing(missing: set[tuple[StopMethod, PriorMotion, str]]) -> None:
    met = record()
    kept = tuple(e for e in met.entries if (e.way, e.origin, e.axis) not in missing)
    assert codes(replace(met, entries=kept)) == ["stops.incomplete"]


def judged(place: int, **change: Any) -> list[Problem]:
    """What is said of a record of which one entry is changed: 0 is the tool in a jog, 1 the spindle."""
    entries = list(record().entries)
    entries[place] = replace(entries[place], **change)
    return list(record_problems(replace(record(), entries=tuple(entries)), NOW))


@pytest.mark.parametrize("number", [0.0, -0.1, math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("key", ["time_s", "distance_mm", "speed_mm_per_s"])
def test_a_number_that_nobody_can_have_measured_is_refused(key: str, number: float) -> None:
    (problem,) = judged(0, **{key: number})
    assert problem.code == "stops.impossible"
    assert problem.value.startswith("abort jog tool: ")


@pytest.mark.parametrize(
    ("place", "change"),
    [
        (0, {"distance_mm": 7.0}),  # 10 mm/s for 0.1 s and half a second before it are 6 mm
        (1, {"distance_deg": 400.0}),  # 600 deg/s for as long are 360 deg
        (0, {"time_s": 100.0}),  # nobody waits so long for a control-A
        (0, {"speed_mm_per_s": 200.0}),  # I116 is 100 mm/s
        (1, {"speed_rpm": 4000.0}),  # the spindle turns at 3000 rpm at most
        (0, {"distance_mm": None, "distance_deg": 1.0}),
        (1, {"speed_rpm": None}),
        (0, {"speed_rpm": 1.0}),
    ],
)
def test_a_stop_that_no_axis_can_have_made_is_refused(place: int, change: dict[str, float | None]) -> None:
    assert [problem.code for problem in judged(place, **change)] == ["stops.impossible"]


def test_stops_that_are_there_twice_without_times_or_one_way_are_refused() -> None:
    entries = (*record().entries, replace(record().entries[0], time_s=0.2))
    assert codes(replace(record(), entries=entries)) == ["stops.impossible"]
    entries = tuple(replace(each, time_s=0.0) for each in record().entries)
    assert codes(replace(record(), entries=entries)) == ["stops.impossible"] * len(NEEDED)
    of_the_other = replace(record(), stop_way=StopWay.RESERVED)
    assert codes(record()) == codes(of_the_other, stop_way=StopWay.RESERVED) == []
    assert codes(record(), stop_way=StopWay.RESERVED) == codes(of_the_other) == ["stops.other_way"]


# Firmware, gains and Ix15 to Ix22 are what a record expires with; the flags hold the kill mode.
@pytest.mark.parametrize(
    "line", ["I115=20", "I219=0.2", "I322=5", "I130=600", "I235=100", "I169=9000", "I10=3700000"]
)
def test_a_change_of_what_stops_a_motor_makes_another_key(machine: MachineProfile, line: str) -> None:
    card = commissioned(machine)
    before = stop_key(card.client, machine, card.dialect)
    assert stop_key(card.client, machine, card.dialect) == before
    card.tell(line)
    assert stop_key(card.client, machine, card.dialect) != before


@pytest.mark.parametrize("line", ["I111=4000", "I113=300000", "I5=3", "I51=1", "P1=3", "I415=2"])
def test_a_change_of_anything_else_does_not(machine: MachineProfile, line: str) -> None:
    card = commissioned(machine)
    before = stop_key(card.client, machine, card.dialect)
    card.tell(line)
    assert stop_key(card.client, machine, card.dialect) == before


def test_another_firmware_makes_another_key(machine: MachineProfile, monkeypatch: pytest.MonkeyPatch) -> None:
    card = commissioned(machine)
    before = stop_key(card.client, machine, card.dialect)
    assert stop_key(card.client, replace(machine, name="its sister"), card.dialect) != before
    card.update_firmware(monkeypatch)
    assert stop_key(card.client, machine, card.dialect) != before


def test_reading_the_key_changes_nothing(machine: MachineProfile) -> None:
    card = commissioned(machine)
    stop_key(card.client, machine, card.dialect)
    assert not any("=" in line for line in card.lines)
    assert len(needed_stops(machine)) == 18
