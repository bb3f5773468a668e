"""An axis whose encoder has stopped counting, and one that is jammed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.pmac.settings import settings_with
from drivers.simulator.plant.drives import Drives, build_drives
from drivers.simulator.plant.true_parameters import ideal
from profiles.machine import MachineProfile
from tests.drivers.test_spindle_drives import inverter

AXES = ("tool", "spindle", "carriage")


def drives(machine: MachineProfile) -> Drives:
    true = replace(ideal(machine), ideal_spindle=False)
    return build_drives(machine, true, settings_with(machine.controller.variables))


@pytest.mark.parametrize("name", ["spindle", "carriage"])
def test_an_ideal_axis_closes_its_loop_on_the_last_reading_and_stands(machine: MachineProfile, name: str) -> None:
    """As a servo does: the iron has run out by so much that nobody has seen, and stays where it is."""
    axis = getattr(build_drives(machine, ideal(machine), settings_with(machine.controller.variables)), name)
    axis.close_loop()
    axis.follow([50.0] * 100)
    axis.encoder_lost = True
    there = axis.push(0.05, 200)[-1]
    assert there > 60.0
    assert axis.close_loop() == 50.0
    assert axis.follow([50.0, 60.0]) == pytest.approx([there, there + 10.0])
    axis.encoder_lost = False
    axis.rebase(there - 50.0)
    assert axis.follow([60.0]) == [60.0]
    assert axis.close_loop() == 60.0


def test_a_spindle_on_an_inverter_is_held_where_it_was_last_read() -> None:
    spindle = inverter()
    spindle.set_rpm(600.0)
    spindle.coast(2000)
    seen = spindle.close_loop()
    spindle.encoder_lost = True
    spindle.coast(2000)
    assert spindle.close_loop() == seen
    spindle.encoder_lost = False
    assert spindle.close_loop() > seen + 1000


@pytest.mark.parametrize("name", AXES)
def test_a_new_axis_has_nothing_the_matter(machine: MachineProfile, name: str) -> None:
    axis = getattr(drives(machine), name)
    assert (axis.encoder_lost, axis.jammed) == (False, False)


@pytest.mark.parametrize("name", AXES)
def test_what_is_jammed_stands_whatever_it_is_told(machine: MachineProfile, name: str) -> None:
    axis = getattr(drives(machine), name)
    here = axis.close_loop()
    there = axis.follow([here + 2.0 * n for n in range(200)])[-1]
    axis.jammed = True
    held = axis.follow([there + 2.0 * n for n in range(200)]) + axis.push(1.0, 50) + axis.coast(50)
    # A position is that at the beginning of the cycle, so the first may be one cycle on.
    assert np.ptp(held[1:]) == 0.0
    assert held[1] == pytest.approx(there, abs=3.0)


def test_a_jammed_tool_pushes_with_all_that_it_has_and_goes_on_when_it_is_free(machine: MachineProfile) -> None:
    tool = drives(machine).tool
    tool.close_loop()
    tool.jammed = True
    tool.follow([200_000.0] * 5)
    assert tool.output_bits / tool.limit_bits == 1.0
    tool.jammed = False
    assert tool.follow([200_000.0] * 50)[-1] > 100.0


def test_a_loop_that_sees_only_its_last_reading_runs_away(machine: MachineProfile) -> None:
    """The error of 20 counts stays: the force of 20 x 9.28 bits/5 counts accelerates the slide until it drags."""
    tool = drives(machine).tool
    tool.close_loop()
    tool.follow([0.0] * 10)
    tool.encoder_lost = True
    track = np.array(tool.follow([20.0] * round(0.5 / 0.000442)))
    force_n = 147.6 * 20 / 5e6 * 11.45 * 54.5
    # The end of v = F / B (1 - exp(-t B / M)), whose time constant is 23.5 ms; the integrator adds a little.
    speed = (track[-1] - track[-2]) / 0.00044270837 / 5e6
    assert speed == pytest.approx(force_n / 201.6, rel=0.15)
    assert track[-1] > 50 * 20


def test_a_reading_that_has_stopped_is_what_a_closed_loop_begins_with(machine: MachineProfile) -> None:
    tool = drives(machine).tool
    tool.close_loop()
    tool.follow([50.0] * 4000)
    tool.encoder_lost = True
    tool.push(0.05, 200)
    assert tool.close_loop() == pytest.approx(50.0, abs=1.0)


def test_an_encoder_that_counts_again_goes_on_from_where_it_stopped(machine: MachineProfile) -> None:
    """The zero has moved by what was lost; what is read has not, so nothing jumps."""
    tool = drives(machine).tool
    tool.close_loop()
    tool.follow([0.0] * 10)
    tool.encoder_lost = True
    drifted = tool.follow([20.0] * 200)[-1]
    tool.encoder_lost = False
    origin = tool.origin
    tool.rebase(drifted)
    assert tool.origin == origin + drifted
    track = np.array(tool.follow([20.0] * 6000))
    # It was on its way at some speed, and comes back to the error of 20 counts that it can see.
    assert np.abs(np.diff(track)).max() < 20.0
    assert track[-1] == pytest.approx(20.0, abs=1.5)
