"""Jogs and home searches: how far, how fast and how long, against closed forms."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench, Recorder

SLOW_CYCLES = 3
"""Servo cycles that starting and sampling may cost."""


def moving_ms(bench: Bench, recorder: Recorder) -> float:
    """Return the time between the first and the last command that differs from its neighbour."""
    changes = np.flatnonzero(np.diff(recorder.commands))
    return float(changes[-1] - changes[0] + 1) * bench.cycle_ms


def velocities(bench: Bench, recorder: Recorder) -> np.ndarray:
    """Commanded velocity in counts/ms."""
    return np.diff(recorder.commands) / bench.cycle_ms


def test_a_jog_to_a_position_takes_distance_over_speed_and_one_acceleration_time(closed: Bench) -> None:
    """Ix22 = 10, Ix20 = 100: 5000 counts take 500 + 100 ms."""
    recorder = closed.record(3)
    closed.client.request("#3J=5000")
    closed.settle()
    assert recorder.commands[-1] == 5000
    assert moving_ms(closed, recorder) == pytest.approx(600, abs=SLOW_CYCLES * closed.cycle_ms)
    assert velocities(closed, recorder).max() == pytest.approx(10, rel=1e-6)


def test_two_s_curves_longer_than_the_jog_acceleration_time_set_it(closed: Bench) -> None:
    closed.client.request("I320=40 I321=60 I319=0")
    recorder = closed.record(3)
    closed.client.request("#3J=-5000")
    closed.settle()
    assert moving_ms(closed, recorder) == pytest.approx(620, abs=SLOW_CYCLES * closed.cycle_ms)


def test_factory_rates_take_two_seconds_to_stop_a_jog(closed: Bench) -> None:
    """32 counts/ms at 0.015625 counts/ms2 is 2048 ms and, without S-curves, 32768 counts."""
    closed.client.request("I319=0.015625 I320=0 I321=0 I322=32")
    recorder = closed.record(3)
    closed.client.request("#3J+")
    closed.sim.wait(3.0)
    before = recorder.commands[-1]
    start = len(recorder.commands)
    closed.client.request("#3J/")
    closed.settle()
    recorder.commands = recorder.commands[start:]
    assert moving_ms(closed, recorder) == pytest.approx(2048, abs=12)
    assert recorder.commands[-1] - before == pytest.approx(0.5 * 32 * 2048, abs=32 * 12)


def test_a_jog_goes_on_for_ever_in_its_direction(closed: Bench) -> None:
    for line, direction in (("#3J+", 1), ("#3J-", -1)):
        closed.client.request(line)
        closed.sim.wait(1.0)
        first = closed.number("#3P")
        closed.sim.wait(1.0)
        assert closed.number("#3P") - first == pytest.approx(direction * 10_000, abs=150)
        assert closed.number("#3V") == pytest.approx(direction * 10 * closed.cycle_ms, abs=1)
    closed.client.request("#3J/")
    closed.settle()


def test_a_speed_of_the_other_sign_is_still_a_speed(closed: Bench) -> None:
    closed.client.request("I322=-10 #3J=1000")
    closed.settle()
    assert closed.number("#3P") == 1000


def test_a_relative_jog_counts_from_where_the_encoder_is(closed: Bench) -> None:
    closed.client.request("#3J=300")
    closed.settle()
    closed.client.request("#3J^-120.5")
    closed.settle()
    assert closed.sim.controller.motors[3].desired == pytest.approx(179.5)


def test_a_jog_back_returns_to_the_position_before_the_jog(closed: Bench) -> None:
    closed.client.request("#3J=2000")
    closed.settle()
    closed.client.request("#3J+")
    closed.sim.wait(0.5)
    closed.client.request("#3J/")
    closed.settle()
    assert closed.number("#3P") > 5000
    closed.client.request("#3J=")
    closed.settle()
    assert closed.number("#3P") == 2000


def test_a_new_jog_in_mid_motion_stops_first_and_never_jumps(closed: Bench) -> None:
    recorder = closed.record(3)
    closed.client.request("#3J=20000")
    closed.sim.wait(0.7)
    closed.client.request("#3J=-1000")
    closed.settle()
    assert recorder.commands[-1] == -1000
    steps = np.diff(velocities(closed, recorder))
    assert np.abs(steps).max() <= 0.5 * closed.cycle_ms * 1.001  # Ix19 = 0.5 counts/ms2


def test_a_jog_to_where_the_motor_stands_is_done_at_once(closed: Bench) -> None:
    closed.client.request("#3J=0")
    closed.sim.wait(0.03)
    assert "in_position" in closed.lathe.snapshot().carriage.flags


def test_jog_times_of_nothing_stop_neither_the_card_nor_the_jog(closed: Bench) -> None:
    closed.client.request("I319=0 I320=0 I321=0 #3J=500")
    closed.settle()
    assert closed.number("#3P") == 500


def test_a_stop_closes_the_loop_of_a_killed_motor_where_it_stands(bench: Bench) -> None:
    before = bench.client.numbers("#1P", "#2P", "#3P")
    bench.client.request("#1J/ #2J/ #3J/")
    bench.sim.wait(0.2)
    assert bench.lathe.snapshot().loops_closed
    assert bench.client.numbers("#1P", "#2P", "#3P") == before


@pytest.mark.parametrize(("motor", "seconds"), [(1, 5000 / 10 / 1000), (3, 2000 / 5 / 1000)])
def test_homing_finds_the_flag_at_the_end_of_travel(closed: Bench, motor: int, seconds: float) -> None:
    """The machine stands 1 mm (tool) and 2 mm (carriage) from its flag; Ix23 is 2 and 5 mm/s."""
    true_position = closed.sim.controller.motors[motor]
    start = true_position.actual + true_position.axis.origin
    began = closed.sim.now_s()
    closed.client.request(f"#{motor}HM")
    while not {"home_complete", "in_position"} <= closed.lathe.snapshot().axes[{1: 0, 3: 2}[motor]].flags:
        closed.sim.wait(0.005)
    assert start > 0
    assert closed.sim.now_s() - began == pytest.approx(seconds, abs=0.6)
    assert closed.number(f"#{motor}P") == pytest.approx(0, abs=10)
    assert true_position.axis.origin == pytest.approx(0, abs=1)
    assert "home_complete" in closed.lathe.snapshot().axes[{1: 0, 3: 2}[motor]].flags


@pytest.mark.parametrize("speed", [5, -5])
def test_homing_finds_the_index_of_the_spindle_from_either_side(closed: Bench, speed: int) -> None:
    closed.client.request(f"I223={speed} #2HM")
    closed.sim.wait(5.0)
    spindle = closed.sim.controller.motors[2]
    assert spindle.home_complete
    assert closed.number("#2P") == 0
    turns = (spindle.actual + spindle.axis.origin) / 10_000
    assert turns == pytest.approx(round(turns), abs=1e-6)


def test_a_home_offset_is_in_sixteenths_of_a_count(closed: Bench) -> None:
    """The motor ends there, and the position there is what it is called (Ix26)."""
    closed.client.request("I326=1600 #3HM")
    closed.sim.wait(3.0)
    assert closed.sim.controller.motors[3].home_complete
    true_position = closed.sim.controller.motors[3]
    assert true_position.actual + true_position.axis.origin == pytest.approx(100)


def test_homing_never_jumps(closed: Bench) -> None:
    recorder = closed.record(3)
    closed.client.request("#3HM")
    closed.sim.wait(3.0)
    machine_steps = np.diff(recorder.commands)
    jumps = np.flatnonzero(np.abs(np.diff(machine_steps)) > 0.6 * closed.cycle_ms)
    # The one jump is that of the zero itself, by the 2000 counts less the way to the flag and back.
    assert len(jumps) <= 2


def test_the_end_of_a_jog_is_an_open_loop_only_when_killed(closed: Bench) -> None:
    closed.client.request("#3J+")
    closed.sim.wait(0.5)
    closed.client.request("#3K")
    snapshot = closed.lathe.snapshot()
    assert "open_loop" in snapshot.carriage.flags
    assert "open_loop" not in snapshot.tool.flags
