"""A machine that stands on a travel limit: it is stopped and told, and may be jogged off it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from console.session.cut.retracting import retracted_by_distance
from console.session.station.commands import Acknowledge, DisableDrives, EnableDrives, Home, Jog, Recover
from console.session.station.state import Activity
from drivers.lathe.snapshot import AxisName, AxisState
from tests.console.floor import Floor, open_floor
from tests.drivers.test_limits_of_a_cut import polled
from tests.system.lathe_sites import compact

OFF = Jog(axis=AxisName.CARRIAGE, distance=-1.0)


@pytest.fixture
def standing(tmp_path: Path) -> Floor:
    """The carriage is homed, and stands on its positive limit switch."""
    floor = open_floor(tmp_path)
    floor.do(DisableDrives())
    floor.do(EnableDrives())
    floor.do(Home())
    floor.do(Jog(axis=AxisName.CARRIAGE, distance=10.0))
    floor.sim.faults.ask("limit", {"motor": "carriage", "direction": "positive"})
    floor.idle()
    return floor


def test_a_limit_that_is_met_stops_the_machine_and_is_told(standing: Floor) -> None:
    assert standing.state.stop is not None
    assert [alarm.problem.value for alarm in standing.state.alarms] == ["carriage: positive_limit"]


def test_the_operator_goes_on_and_jogs_off_it(standing: Floor) -> None:
    standing.idle()
    standing.do(Recover())
    before = standing.lathe.snapshot().carriage.position
    state = standing.do(OFF)
    assert state.stop is None and state.activity is Activity.READY, state.alarms
    assert standing.lathe.snapshot().carriage.position == pytest.approx(before - 1000.0, abs=2.0)


def test_a_limit_that_was_left_and_is_met_again_stops_again(standing: Floor) -> None:
    standing.idle()
    standing.do(Recover())
    standing.sim.faults.clear()
    assert standing.idle().stop is None
    standing.sim.faults.ask("limit", {"motor": "carriage", "direction": "positive"})
    assert standing.idle().stop is not None


def told(floor: Floor) -> list[tuple[str, str, int, bool]]:
    """The alarms: key, value, how often raised, whether acknowledged."""
    return [(a.problem.key, a.problem.value, a.count, a.acknowledged) for a in floor.state.alarms]


def test_a_limit_that_was_acknowledged_stays_so_until_it_is_left(standing: Floor) -> None:
    """The way back from the stop makes no new alarm of it: the machine still stands on the switch."""
    assert standing.station.post(Acknowledge())
    known = [("poll", "carriage: positive_limit", 1, True)]
    assert told(standing) == known
    standing.do(Recover())
    for _ in range(3):
        standing.idle()
        assert told(standing) == known
    standing.sim.faults.clear()
    standing.do(OFF)
    assert standing.idle().alarms == ()


@pytest.mark.parametrize("axis", ["tool", "carriage"])
def test_a_fault_of_an_amplifier_is_one_alarm_until_the_drives_are_on_again(tmp_path: Path, axis: str) -> None:
    """It ends a jog: the motion, the stop and the look behind it tell of one and the same thing."""
    floor = open_floor(tmp_path)
    floor.do(DisableDrives())
    floor.do(EnableDrives())
    floor.do(Home())

    def trip() -> None:
        floor.sim.faults.ask("amplifier-fault", {"motor": axis})

    floor.when(lambda look: "desired_velocity_zero" not in look.carriage.flags, trip)
    floor.do(Jog(axis=AxisName.CARRIAGE, distance=10.0))
    fault = f"{axis}: amplifier_fault"
    floor.idle()
    assert told(floor) == [("jog carriage", fault, 1, False)]
    assert floor.station.post(Acknowledge())
    floor.do(Recover())
    floor.idle()
    assert told(floor) == [("jog carriage", fault, 1, True)]
    floor.sim.faults.clear()
    floor.do(EnableDrives())
    assert floor.idle().alarms == ()


@pytest.mark.parametrize(
    ("homed", "at_mm", "target_mm"),
    [
        (True, 55.0, 35.0),  # by the retract distance
        (True, 5.0, 0.0),  # no further than its home
        (True, -0.5, -0.5),  # nor in again
        (False, 55.0, 35.0),
        (False, 5.0, -1.9),  # 0.1 mm short of the end of its travel
        (False, -1.95, -1.95),
    ],
)
def test_where_no_part_is_known_the_tool_retracts_by_its_distance_and_onto_no_limit(
    homed: bool, at_mm: float, target_mm: float
) -> None:
    machine = compact("pmac")
    machine = replace(machine, tool=replace(machine.tool, travel_min_mm=-2.0, retract_mm=20.0))
    counts = at_mm * machine.tool.counts_per_mm
    tool = AxisState(position=counts, following_error=0.0, flags=frozenset({"home_complete"} if homed else ()))
    found = retracted_by_distance(machine, polled(tool=tool))
    assert found / machine.tool.counts_per_mm == pytest.approx(target_mm)
