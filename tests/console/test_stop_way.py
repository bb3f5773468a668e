"""A connection for stops that is lost: told once, disarmed, no cut begun; and told to be there again."""

from __future__ import annotations

from datetime import date
from pathlib import Path

import pytest

from console.cli.machine.card_access import Card
from console.cli.machine.doctor_checks import keep_stops, stop_checks
from console.session.data.stop_records import load
from console.session.station.commands import Start
from drivers.commissioning.proofs.proving import Proven
from drivers.commissioning.stop_record import Origin, StopEntry, Way, needed_stops
from drivers.link.base import StopWay
from profiles.findings import Severity
from profiles.store import load_machine
from tests.console.floor import Floor, experiment_1, set_up_once
from tests.drivers.commissioned import commissioned

TODAY = date(2026, 3, 1)
MACHINE = load_machine("lee-2001-lathe").machine


@pytest.fixture
def floor(tmp_path: Path, in_copies: None) -> Floor:
    return set_up_once(tmp_path)


def alarms(floor: Floor) -> list[str]:
    return [alarm.problem.code for alarm in floor.state.alarms if alarm.active]


def test_an_armed_cut_is_disarmed_and_the_operator_is_told_once(floor: Floor) -> None:
    job = experiment_1()
    floor.link.stop_way = StopWay.RESERVED
    assert floor.arm(job).armed is not None
    assert alarms(floor) == []
    floor.link.stop_way = StopWay.LOST
    floor.idle()
    assert (floor.idle().armed, alarms(floor)) == (None, ["stops.connection_lost"])
    assert [alarm.count for alarm in floor.state.alarms] == [1]
    floor.link.stop_way = StopWay.RESERVED
    floor.idle()
    assert alarms(floor) == []


def test_a_cut_that_was_armed_before_is_not_begun(floor: Floor) -> None:
    job = experiment_1()
    floor.arm(job)
    before = floor.state.snapshot
    floor.link.stop_way = StopWay.LOST
    floor.do(Start())
    assert [problem.code for problem in floor.state.refusals] == ["stops.connection_lost"]
    assert before is not None and floor.state.snapshot is not None
    assert [axis.commanded for axis in floor.state.snapshot.axes] == [axis.commanded for axis in before.axes]


@pytest.mark.parametrize("way", StopWay)
def test_a_record_is_kept_with_the_way_of_its_stops_and_taken_away_with_a_lost_one(
    tmp_path: Path, way: StopWay
) -> None:
    made = commissioned(MACHINE)
    version, kind = made.client.query("VERSION", "TYPE")
    card = Card(
        client=made.client,
        stop=made.stop,
        clock=made.sim,
        machine=MACHINE,
        address="ethernet:lathe",
        simulated=False,
        version=version,
        kind=kind,
        data=tmp_path,
    )
    stops = tuple(_stop(*each) for each in needed_stops(MACHINE))
    proven = Proven(checks=(), stops=stops)
    keep_stops(card, proven, TODAY)
    made.link.stop_way = way
    keep_stops(card, proven, TODAY)
    kept = load(tmp_path, MACHINE)
    assert (None if kept is None else kept.stop_way) == (None if way is StopWay.LOST else way)
    told = {check.code: check.severity for check in stop_checks(card, TODAY)}
    target = {
        StopWay.DIRECT: {"stop_record": Severity.OK},
        StopWay.RESERVED: {"stop_connection": Severity.OK, "stop_record": Severity.OK},
        StopWay.LOST: {"stop_connection": Severity.REFUSAL, "stops_no_record": Severity.WARNING},
    }
    assert told == target[way]


def _stop(way: Way, origin: Origin, axis: str) -> StopEntry:
    if axis == "spindle":
        return StopEntry(way=way, origin=origin, axis=axis, time_s=0.1, distance_deg=30.0, speed_rpm=100.0)
    return StopEntry(way=way, origin=origin, axis=axis, time_s=0.1, distance_mm=0.2, speed_mm_per_s=10.0)
