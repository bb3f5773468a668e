"""What another host does to a machine at rest is seen at the next poll, and nothing is cut on it."""

from __future__ import annotations

from pathlib import Path

import pytest

from console.session.station.commands import EnableDrives, Home, Jog, Recover, Start
from console.session.station.state import Activity
from drivers.cutting.strategy import Strategy
from drivers.lathe.snapshot import AxisName
from tests.console.floor import Floor, experiment_1, open_floor

POLL_S = 0.1


@pytest.fixture
def floor(tmp_path: Path) -> Floor:
    """A machine that is aligned, at rest."""
    floor = open_floor(tmp_path)
    floor.set_up(experiment_1(1.5))
    looks(floor)
    return floor


def looks(floor: Floor, count: int = 5) -> None:
    for _ in range(count):
        floor.idle(POLL_S)


def another_sends(floor: Floor, line: bytes) -> None:
    floor.sim.connect().receive(line + b"\r")
    looks(floor)


def codes(floor: Floor) -> set[str]:
    return {alarm.problem.code for alarm in floor.state.alarms if alarm.active}


@pytest.mark.parametrize("line", [b"#1HMZ", b"#3HMZ", b"#2HMZ"])
def test_a_zero_that_another_host_sets_voids_home_jaw_1_and_touch_off(floor: Floor, line: bytes) -> None:
    floor.lathe.jog_by(AxisName.SPINDLE, 1234.0)
    looks(floor)
    another_sends(floor, line)
    alignment = floor.state.alignment
    assert "controller.zero_shifted" in codes(floor)
    assert (alignment.homed, alignment.jaw, alignment.touch_off) == (False, None, None)
    for _ in range(2):  # and it stays so, however often it is tried
        floor.arm(experiment_1(1.5), Strategy.CAM)
        assert floor.state.armed is None
    floor.do(Home())
    looks(floor, 1)
    assert floor.state.alignment.homed
    assert "controller.zero_shifted" not in codes(floor)


def test_a_zero_that_is_set_while_a_cut_is_armed_starts_nothing_ever(floor: Floor) -> None:
    floor.arm(experiment_1(1.5), Strategy.CAM)
    assert floor.state.armed is not None
    another_sends(floor, b"#1HMZ")
    for _ in range(2):
        floor.do(Start())
        assert floor.state.cut is None
    assert not floor.state.alignment.homed


def test_a_zero_that_is_set_with_the_drives_off_is_seen(floor: Floor) -> None:
    another_sends(floor, b"#1K#2K#3K")
    another_sends(floor, b"#3HMZ")
    assert "controller.zero_shifted" in codes(floor)
    floor.do(EnableDrives())
    assert not floor.state.alignment.homed


@pytest.mark.parametrize(("line", "axis"), [(b"#3J^-8000", "carriage"), (b"#1J-", "tool"), (b"#2J+", "spindle")])
def test_an_axis_that_another_host_moves_is_stopped_and_has_no_home(floor: Floor, line: bytes, axis: str) -> None:
    another_sends(floor, line)
    looks(floor, 30)
    alarm = next(alarm for alarm in floor.state.alarms if alarm.problem.code == "machine.moves_unasked")
    assert axis in alarm.problem.key
    assert floor.state.activity is Activity.STOPPED
    assert floor.state.stop is not None and floor.state.stop.rest_s is not None
    floor.do(Recover())
    assert not floor.state.alignment.homed


def test_a_drive_that_another_host_switches_off_is_an_alarm_until_all_are(floor: Floor) -> None:
    another_sends(floor, b"#1K")
    alarm = next(alarm for alarm in floor.state.alarms if alarm.problem.code == "machine.opened_unasked")
    assert alarm.problem.key == "tool"
    another_sends(floor, b"#2K#3K")
    assert "machine.opened_unasked" not in codes(floor)


@pytest.mark.parametrize(("line", "axis"), [(b"I322=50", AxisName.CARRIAGE), (b"I121=5", AxisName.TOOL)])
def test_a_jog_that_another_host_has_made_faster_is_refused_with_the_setting(
    floor: Floor, line: bytes, axis: AxisName
) -> None:
    another_sends(floor, line)
    floor.do(Jog(axis=axis, distance=-0.5))
    (refused,) = floor.state.refusals
    assert (refused.code, refused.key) == ("controller.setting", line.partition(b"=")[0].decode())
    snapshot = floor.state.snapshot
    assert snapshot is not None and snapshot.at_rest


def test_own_jogs_and_own_switching_are_no_deeds_of_another(floor: Floor) -> None:
    for axis, counts in ((AxisName.TOOL, -20.0), (AxisName.CARRIAGE, 3.0), (AxisName.SPINDLE, 500.0)):
        floor.lathe.jog_by(axis, counts)
        looks(floor)
    assert floor.state.alignment.homed
    assert codes(floor) == set()
