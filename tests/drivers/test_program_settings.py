"""Programs are written by the controller's own rules: segment times, I10, the settings of a machine."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from drivers.pmac.dialect import TURBO
from drivers.pmac.programs.paper import segment_ms
from drivers.pmac.settings import servo_cycle_ms, settings_with

if TYPE_CHECKING:
    from profiles.machine import MachineProfile
    from tests.drivers.conftest import Bench, JobMaker


@pytest.mark.parametrize(("ts_ms", "used_ms"), [(0, 10), (5, 10), (7, 14), (10, 20)])
def test_a_segment_takes_what_the_ramp_needs(
    machine: MachineProfile, experiment: JobMaker, ts_ms: int, used_ms: float
) -> None:
    """50 Hz asks for 10 ms; rule 1 makes 2 TS of it. Ix17 does not bind: 27.5 to -27.5 counts/ms at 422."""
    assert segment_ms(experiment(1), machine, ts_ms) == used_ms


def test_a_weak_motor_stretches_the_segment_by_the_change_into_it(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    """275 counts with TA 2 x 10 ms: v = 13.75 counts/ms after 275/t of the move before, at 2 counts/ms^2.

    Ix17: t = (13.75 + 275/t)/2 + TS, so t^2 - 16.875 t - 137.5 = 0.
    """
    variables = {**machine.controller.variables, f"I{machine.tool.motor}17": 2.0}
    weak = replace(machine, controller=replace(machine.controller, variables=variables))
    expected_ms = (16.875 + math.sqrt(16.875**2 + 4 * 137.5)) / 2
    assert segment_ms(experiment(1), weak, 10) == pytest.approx(expected_ms, rel=1e-9)


@pytest.mark.parametrize(
    ("i10", "cycle_ms"), [(8_388_607, 1.0), (4_194_304, 0.5), (8_388_608 + 4_194_304, 0.5), (0, 2**-23)]
)
def test_i10_is_servo_time_in_23_bits(i10: float, cycle_ms: float) -> None:
    assert servo_cycle_ms(i10) == pytest.approx(cycle_ms, rel=2e-7)


def test_a_loop_without_motion_waits_in_the_time_that_wrapped_too(closed: Bench) -> None:
    """I10 = 2^23 + 3713707 is the 443 us of 3713707, so a look every third cycle: 752 looks a second."""
    closed.program("P1=0", "WHILE(1=1)", "P1=P1+1", "ENDWHILE")
    closed.client.request(f"I10={8_388_608 + 3_713_707}")
    closed.client.request("&1R")
    closed.sim.wait(1.0)
    # A look ends at the second backward jump.
    assert closed.number("P1") == pytest.approx(2 * 1000 / (3 * 0.442708), rel=0.02)


def test_settings_that_are_not_named_are_those_of_the_factory() -> None:
    """Ix16 = 32, Ix88 = 50 from the factory (Quick Reference)."""
    settings = settings_with({"I116": 500.0})
    assert (settings[116], settings[216], settings[388]) == (500.0, 32, 50)


def test_the_names_of_a_profile_are_the_papers_or_the_familys_own() -> None:
    """Ix87 of coordinate system 1 is I187 on a PMAC and I5187 on a Turbo; what a fault kills, I125 and I124."""
    for named in ({"I187": 7.0, "I125": 4.0, "I13": 5.0}, {"I5187": 7.0, "I124": 4.0, "I5113": 5.0}):
        settings = settings_with(named, TURBO)
        assert (settings[5187], settings[124], settings[5113]) == (7.0, 4.0, 5.0)
        assert max(settings) <= TURBO.highest_index
