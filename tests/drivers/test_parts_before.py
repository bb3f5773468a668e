"""A simulated lathe that is started anew goes on with the blanks, the clampings and the gauge of its seed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from profiles.store import load_job, load_machine
from profiles.traces import Trace

MACHINE = load_machine("lee-2001-lathe").machine
JOB = load_job("lee-2001-experiment-1").job


def traces(count: int, parts_before: int = 0, plant: str = "realistic") -> list[Trace]:
    """Clamp and measure blanks, one after the other; no tool comes near."""
    true = plant_named(plant, MACHINE, 6)
    lathe = SimulatedLathe(MACHINE, replace(true, parts_before=parts_before))
    found = []
    for _ in range(count):
        lathe.mount(JOB)
        found.append(lathe.measure())
    return found


@pytest.mark.parametrize("plant", ["steady", "realistic", "hard"])
def test_a_lathe_started_anew_after_three_parts_has_the_fourth_of_a_row(plant: str) -> None:
    row, (anew,) = traces(4, plant=plant), traces(1, parts_before=3, plant=plant)
    assert np.array_equal(anew.deviation_um, row[3].deviation_um)
    for other in row[:3]:
        assert not np.array_equal(anew.deviation_um, other.deviation_um)


def test_its_first_part_is_that_of_a_lathe_of_which_nothing_is_said() -> None:
    (first,), (same,) = traces(1), traces(1, parts_before=0)
    assert np.array_equal(first.deviation_um, same.deviation_um)
    assert first.meta["lathe"] == "realistic, seed 6"


def test_clamping_and_dial_are_those_of_the_part_and_the_dial_sits_where_it_did() -> None:
    true = replace(plant_named("realistic", MACHINE, 6), indicator_noise_um=0.0, indicator_graduation_um=0.0)
    one, other = SimulatedLathe(MACHINE, true), SimulatedLathe(MACHINE, replace(true, parts_before=1))
    for lathe in (one, one, other):
        lathe.mount(JOB)
    assert one.indicate() == other.indicate()


def test_the_scale_has_another_noise_on_each_part() -> None:
    true = plant_named("steady", MACHINE, 6)

    def noise(parts_before: int) -> list[float]:
        scale = SimulatedLathe(MACHINE, replace(true, parts_before=parts_before)).tool.scale
        return [float(scale.read(0.0)) for _ in range(5)]

    assert noise(0) == noise(0) != noise(1) != noise(2)
