"""Which stop record is believed: of this machine, with these settings, complete, and not too old."""

from __future__ import annotations

from dataclasses import replace
from datetime import date, timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.link.base import StopWay
from drivers.stop_record import (
    Origin,
    StopEntry,
    StopRecord,
    Way,
    needed_stops,
    record_problems,
    stop_key,
)
from profiles.machine import MachineProfile
from tests.drivers.commissioned import commissioned
from tests.drivers.families import machine as machine  # both families

TODAY = date(2026, 3, 1)
NEEDED = tuple((way, origin, axis) for way in Way for origin in Origin for axis in ("tool", "spindle", "carriage"))
KEY = "5" * 64


def record() -> StopRecord:
    entries = tuple(
        StopEntry(way=way, origin=origin, axis=axis, time_s=0.1, distance_mm=0.2, speed_mm_per_s=10.0)
        for way, origin, axis in NEEDED
    )
    return StopRecord(
        machine="lathe",
        kind="PMAC1",
        version="1.17",
        key=KEY,
        measured_at=TODAY,
        address="tcp:lathe:1",
        stop_way=StopWay.DIRECT,
        entries=entries,
    )


def codes(met: StopRecord | None, now: date = TODAY, key: str = KEY, way: StopWay = StopWay.DIRECT) -> list[str]:
    return [problem.code for problem in record_problems(met, now, key, NEEDED, way)]


def test_without_a_record_nothing_is_armed() -> None:
    assert codes(None) == ["stops.no_record"]


@given(st.integers(min_value=-400, max_value=400))
def test_a_record_is_believed_for_half_a_year_and_not_from_the_future(days: int) -> None:
    wanted = [] if 0 <= days <= 180 else ["stops.expired"]
    assert codes(record(), TODAY + timedelta(days=days)) == wanted


def test_everything_that_is_wrong_is_said_at_once() -> None:
    met = replace(record(), entries=record().entries[1:])
    found = record_problems(met, TODAY + timedelta(days=181), "6" * 64, NEEDED, StopWay.RESERVED)
    assert [problem.code for problem in found] == [
        "stops.expired",
        "stops.other_settings",
        "stops.other_way",
        "stops.incomplete",
    ]
    assert found[0].value == "2026-03-01"
    assert (found[2].value, found[2].limit) == ("direct", "reserved")
    assert found[3].value == "abort jog tool"


@given(st.sets(st.sampled_from(NEEDED), min_size=1))
def test_no_stop_may_be_missing(missing: set[tuple[Way, Origin, str]]) -> None:
    met = record()
    kept = tuple(e for e in met.entries if (e.way, e.origin, e.axis) not in missing)
    assert codes(replace(met, entries=kept)) == ["stops.incomplete"]


def test_stops_that_went_one_way_say_nothing_of_the_other() -> None:
    of_the_other = replace(record(), stop_way=StopWay.RESERVED)
    assert codes(record()) == codes(of_the_other, way=StopWay.RESERVED) == []
    assert codes(record(), way=StopWay.RESERVED) == codes(of_the_other) == ["stops.other_way"]


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
