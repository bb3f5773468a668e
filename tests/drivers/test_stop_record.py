"""Which stop record is believed: of this machine, with these settings, complete, and not too old."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import date, timedelta
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.commissioning.stop_record import (
    Origin,
    StopEntry,
    StopRecord,
    StopsNow,
    Way,
    needed_stops,
    record_problems,
    stop_key,
)
from drivers.link.base import StopWay
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.store import load_machine
from tests.drivers.commissioned import commissioned
from tests.drivers.families import machine as machine  # both families

TODAY = date(2026, 3, 1)
LATHE = load_machine("lee-2001-lathe").machine
NEEDED = tuple((way, origin, axis) for way in Way for origin in Origin for axis in ("tool", "spindle", "carriage"))
KEY = "5" * 64
NOW = StopsNow(machine=LATHE, key=KEY, today=TODAY, stop_way=StopWay.DIRECT, address="tcp:lathe:1")


def entry(way: Way, origin: Origin, axis: str) -> StopEntry:
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
    assert [problem.code for problem in found] == [
        "stops.other_machine",
        "stops.other_address",
        "stops.expired",
        "stops.other_settings",
        "stops.other_way",
        "stops.incomplete",
    ]
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
def test_no_stop_may_be_missing(missing: set[tuple[Way, Origin, str]]) -> None:
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


def test_a_stop_that_is_there_twice_is_refused() -> None:
    entries = (*record().entries, replace(record().entries[0], time_s=0.2))
    assert codes(replace(record(), entries=entries)) == ["stops.impossible"]


def test_all_times_zero_are_refused_each() -> None:
    entries = tuple(replace(each, time_s=0.0) for each in record().entries)
    assert codes(replace(record(), entries=entries)) == ["stops.impossible"] * len(NEEDED)


def test_stops_that_went_one_way_say_nothing_of_the_other() -> None:
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


def test_another_firmware_or_another_machine_makes_another_key(
    machine: MachineProfile, monkeypatch: pytest.MonkeyPatch
) -> None:
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
