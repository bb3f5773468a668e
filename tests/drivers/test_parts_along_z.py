"""A part that springs back more towards the jaws: round at both ends only where the path grows along it, too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.cutting.planning import Strategy
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.true_parameters import ideal
from profiles.machine import MachineProfile
from profiles.roundness import evaluate
from tests.drivers.close_together import machine as machine
from tests.drivers.conftest import JobMaker
from tests.drivers.cut_floor import CutFloor, short

GROWTH_PERCENT_PER_MM = 10.0


def test_a_plant_has_a_growth_of_its_own_whatever_the_job_believes(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    """The blank itself, 55 um p-p in the middle, at 1 mm to either side of it."""
    job = replace(short(experiment), cut_length_mm=2.5, lobe_growth_percent_per_mm=5.0)
    for true, percent in ((None, 5.0), (replace(ideal(machine), lobe_growth_per_mm=0.15), 15.0)):
        sim = SimulatedLathe(machine, true)
        sim.mount(job)
        lobes_um = [float(np.ptp(sim.measure(past_mm).deviation_um)) for past_mm in (-1.0, 0.0, 1.0)]
        assert lobes_um == pytest.approx([55.0 * (1 + side * percent / 100) for side in (-1, 0, 1)], abs=1e-6)


@pytest.mark.long
def test_a_lobe_that_grows_leaves_the_ends_off_unless_the_path_grows_with_it(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    """10 % a mm, 0.4 of the cut from its middle: a path of one size leaves that share of 55 um at either end."""
    even = replace(short(experiment), cut_length_mm=2.0)
    grown = replace(even, lobe_growth_percent_per_mm=GROWTH_PERCENT_PER_MM)
    end_mm = 0.4 * even.cut_length_mm
    left_um: dict[bool, list[float]] = {}
    for follows in (False, True):
        floor = CutFloor(grown if follows else even, machine, Strategy.CAM)
        sim = floor.card.sim
        sim.mount(grown)
        floor.cut()
        traces = [sim.measure(past_mm) for past_mm in (-end_mm, 0.0, end_mm)]
        left_um[follows] = [evaluate(each.angle_deg, each.deviation_um, None).ront_um for each in traces]
        with pytest.raises(ValueError, match="sections are at"):
            sim.measure(2.0 * end_mm)
    off_um = 55.0 * GROWTH_PERCENT_PER_MM / 100.0 * end_mm
    assert left_um[False][0] == pytest.approx(off_um, abs=0.7)
    assert left_um[False][2] == pytest.approx(off_um, abs=0.7)
    assert left_um[False][1] < 0.3
    # The land of the tool, 0.4 mm, is as deep as its deepest end: 2 % of the lobe.
    assert max(left_um[True]) < 0.02 * 55.0 + 0.3
