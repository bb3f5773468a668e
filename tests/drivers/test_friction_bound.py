"""What dry friction is predicted to leave, against the simulated tool that has it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.pmac.settings import settings_with
from drivers.simulator.plant.drives import build_drives
from drivers.simulator.plant.true_parameters import ideal
from profiles.axis.friction import friction_um_pp, sampled_compliance_um_per_n
from profiles.axis.servo import sampled_response
from profiles.machine import MachineProfile
from tests.drivers.test_twin import COUNTS_PER_UM, CYCLE_S, pushed_um


@pytest.mark.parametrize("frequency_hz", [20.0, 50.0, 150.0])
def test_a_force_pushes_the_sampled_loop_as_far_as_the_simulated_one(
    machine: MachineProfile, frequency_hz: float
) -> None:
    time_s = np.arange(round(1.0 / CYCLE_S)) * CYCLE_S
    at = pushed_um((2.0 * np.sin(2 * np.pi * frequency_hz * time_s)).tolist())
    tail = slice(len(at) // 2, None)
    found = 2j * (at[tail] * np.exp(-2j * np.pi * frequency_hz * time_s[tail])).mean() / 2.0
    # The force is held for a cycle, so that it comes half a cycle late.
    late = np.exp(-1j * np.pi * frequency_hz * CYCLE_S)
    assert found == pytest.approx(complex(sampled_compliance_um_per_n(machine, frequency_hz)) * late, rel=0.01)


@pytest.mark.parametrize(
    ("frequency_hz", "path_um_pp", "friction_n"),
    [(50.0, 55.0, 3.0), (50.0, 55.0, 5.0), (50.0, 33.0, 3.0), (30.0, 28.4, 3.0), (20.0, 10.4, 3.0)],
)
def test_a_dry_tool_is_off_by_no_more_than_was_predicted_and_not_by_much_less(
    machine: MachineProfile, frequency_hz: float, path_um_pp: float, friction_n: float
) -> None:
    """By the inverse of the nominal loop, in air. At 20 Hz it does not come loose: all of its path is left."""
    true = replace(ideal(machine), coulomb_friction_n=friction_n)
    tool = build_drives(machine, true, settings_with(machine.controller.variables)).tool
    tool.close_loop()
    time_s = np.arange(round(1.5 / CYCLE_S)) * CYCLE_S
    harmonic = 0.5 * path_um_pp * np.exp(2j * np.pi * frequency_hz * time_s)
    told = np.minimum(time_s / 0.2, 1.0) * np.imag(harmonic / complex(sampled_response(machine, frequency_hz)))
    at_um = np.array(tool.follow((COUNTS_PER_UM * told).tolist())) / COUNTS_PER_UM
    last = slice(-round(0.5 / CYCLE_S), None)
    off_um = at_um[last] - np.imag(harmonic[last])
    most_um = friction_um_pp(machine, frequency_hz, friction_n, path_um_pp)
    assert 0.8 * most_um < np.ptp(off_um) <= 1.02 * most_um


def test_a_tool_that_moves_nowhere_loses_nothing(machine: MachineProfile) -> None:
    assert friction_um_pp(machine, 50.0, 5.0, 0.0) == 0.0
