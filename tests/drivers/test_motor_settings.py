"""The settings of a motor in millimetres, degrees and seconds."""

import math
from dataclasses import replace

import pytest

from drivers.pmac.motor_settings import MotorSettings
from profiles.machine import MachineProfile
from profiles.store import load_machine

MACHINE = load_machine("lee-2001-lathe").machine
TOOL, SPINDLE, CARRIAGE = (MotorSettings(MACHINE, number) for number in (1, 2, 3))


def with_variable(name: str, value: float) -> MachineProfile:
    variables = {**MACHINE.controller.variables, name: value}
    return replace(MACHINE, controller=replace(MACHINE.controller, variables=variables))


def test_counts_a_millisecond_become_millimetres_a_second() -> None:
    # 50 counts/ms of 0.2 um; 40 counts/ms2; 16.667 counts/ms of 10,000 counts a turn.
    assert TOOL.jog_speed == pytest.approx(10.0)
    assert TOOL.abort_rate == pytest.approx(8000.0)
    assert SPINDLE.jog_speed == pytest.approx(600.0, rel=1e-4)
    assert SPINDLE.counts_per_unit == pytest.approx(27.7778, rel=1e-5)


def test_a_limit_of_zero_is_none() -> None:
    assert (SPINDLE.highest_counts, SPINDLE.lowest_counts) == (None, None)
    assert CARRIAGE.highest_counts is not None


def test_a_sixteenth_of_a_count_is_no_count() -> None:
    assert MotorSettings(with_variable("I111", 16_000.0), 1).error_limit_counts == 1000.0


def test_a_stop_goes_on_until_it_is_obeyed_and_then_brakes() -> None:
    # 10 mm/s for 55 ms, then 10^2 / (2 * 8000) mm.
    assert TOOL.stopping_distance(10.0, 0.055) == pytest.approx(0.55 + 0.00625)
    assert TOOL.stop_s(10.0) == pytest.approx(0.00125)
    assert MotorSettings(with_variable("I115", 0.0), 1).stopping_distance(10.0, 0.055) == math.inf
