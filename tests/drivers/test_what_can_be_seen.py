"""Looking at the chuck: what an operator sees there is the iron, whatever the controller calls zero."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from drivers.cutting.planning import Strategy, plan_cut
from drivers.lathe.snapshot import AxisName
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.true_parameters import ideal
from drivers.simulator.plant.workshop_view import WorkshopView
from profiles.roundness import evaluate

if TYPE_CHECKING:
    from profiles.job import Job
    from profiles.machine import MachineProfile
    from tests.drivers.conftest import Bench, JobMaker, TrueBenchMaker

COUNTS_PER_DEG = 10_000 / 360
TOOL_COUNTS_PER_MM = 5000
CARRIAGE_COUNTS_PER_MM = 1000
SETTLED_MM = 0.0021
"""A jog is done within 4 counts of 0.2 um; the slow integrator brings the rest later. What is seen is rounded."""

IN_THE_PART_MM = 174.0
"""Z in the middle of the cut of experiment 1: the part stands from 170 to 200 mm."""


def homed(bench: Bench) -> Bench:
    bench.lathe.enable()
    bench.lathe.home()
    return bench


def tool_at(bench: Bench, radius_mm: float, z_mm: float, home_radius_mm: float = 76.0) -> WorkshopView:
    """Jog the tool tip, carriage first, four times as fast as an operator would, and look."""
    bench.carriage_to(z_mm * CARRIAGE_COUNTS_PER_MM)
    usual = bench.lathe.machine.controller.variables["I122"]
    bench.client.request(f"I122={4 * usual}")
    bench.lathe.jog_to(AxisName.TOOL, (home_radius_mm - radius_mm) * TOOL_COUNTS_PER_MM)
    bench.client.request(f"I122={usual}")
    return bench.sim.look()


def cut(bench: Bench, job: Job, machine: MachineProfile) -> None:
    bench.cut(plan_cut(job, machine, Strategy.NONE))


def test_before_homing_the_chuck_stands_where_it_was_left(
    machine: MachineProfile, bench_with: TrueBenchMaker
) -> None:
    """The spindle was left at 0.3457 turns, 124.45 deg, and the card calls that 0."""
    bench = bench_with(replace(ideal(machine), jaw_1_deg=100.0, spindle_start_turns=0.3457))
    assert bench.number("#2P") == 0
    assert bench.sim.look() == WorkshopView(jaw_1_past_mark_deg=24.45, tool_gap_mm=None)


def test_jaw_1_meets_the_mark_at_its_true_angle(machine: MachineProfile, bench_with: TrueBenchMaker) -> None:
    bench = homed(bench_with(replace(ideal(machine), jaw_1_deg=216.54)))
    bench.lathe.jog_to(AxisName.SPINDLE, round(216.54 * COUNTS_PER_DEG))
    assert bench.sim.look().jaw_1_past_mark_deg == 0.0
    bench.lathe.jog_to(AxisName.SPINDLE, round((216.54 + 10 * 360 + 9.0) * COUNTS_PER_DEG))
    assert bench.sim.look().jaw_1_past_mark_deg == 9.0


def test_the_angle_is_the_shorter_way_round(machine: MachineProfile, bench_with: TrueBenchMaker) -> None:
    expected = {
        -180.0: 180.0,
        -90.0: -90.0,
        90.0: 90.0,
        180.0: 180.0,
        180.36: -179.64,
        270.0: -90.0,
        720.0: 0.0,
    }
    bench, seen = homed(bench_with(replace(ideal(machine), jaw_1_deg=0.0))), {}
    for spindle_deg in expected:
        bench.lathe.jog_to(AxisName.SPINDLE, round(spindle_deg * COUNTS_PER_DEG))
        seen[spindle_deg] = bench.sim.look().jaw_1_past_mark_deg
    assert seen == expected


def test_a_chuck_that_is_mounted_as_the_job_says_is_seen_there(bench: Bench, experiment: JobMaker) -> None:
    homed(bench).sim.mount(replace(experiment(1), lobe_phase_deg=36.0))
    bench.lathe.jog_to(AxisName.SPINDLE, 1000)
    assert bench.sim.look().jaw_1_past_mark_deg == 0.0


def test_the_gap_is_between_the_tip_and_the_blank(bench: Bench, experiment: JobMaker) -> None:
    homed(bench).sim.mount(experiment(1))
    assert tool_at(bench, 30.0, IN_THE_PART_MM).tool_gap_mm == pytest.approx(4.0, abs=SETTLED_MM)
    bench.lathe.jog_to(AxisName.TOOL, (76.0 - 26.0) * TOOL_COUNTS_PER_MM)
    assert bench.sim.look().tool_gap_mm == pytest.approx(0.0, abs=SETTLED_MM)
    bench.lathe.jog_to(AxisName.TOOL, (76.0 - 25.5) * TOOL_COUNTS_PER_MM)
    assert bench.sim.look().tool_gap_mm == pytest.approx(-0.5, abs=SETTLED_MM)


def test_a_tool_that_was_clamped_elsewhere_is_seen_there(
    machine: MachineProfile, bench_with: TrueBenchMaker, experiment: JobMaker
) -> None:
    bench = homed(bench_with(replace(ideal(machine), home_radius_mm=76.217)))
    bench.sim.mount(experiment(1))
    assert tool_at(bench, 26.5, IN_THE_PART_MM).tool_gap_mm == pytest.approx(0.717, abs=SETTLED_MM)


def test_a_gap_is_seen_only_in_front_of_the_part(bench: Bench, experiment: JobMaker) -> None:
    """30 mm in front of the jaw faces at 200 mm; the carriage is let go further than its limit of 199 mm."""
    homed(bench).sim.mount(experiment(1))
    bench.client.request("I313=0")
    seen = {z_mm: tool_at(bench, 30.0, z_mm).tool_gap_mm is not None for z_mm in (169.9, 170.1, 199.0, 200.1)}
    assert seen == {169.9: False, 170.1: True, 199.0: True, 200.1: False}


def test_without_a_part_there_is_no_gap(bench: Bench) -> None:
    assert tool_at(homed(bench), 30.0, IN_THE_PART_MM).tool_gap_mm is None


def test_what_is_seen_does_not_change_when_the_card_forgets_its_zeros(bench: Bench, experiment: JobMaker) -> None:
    homed(bench).sim.mount(experiment(1))
    seen = tool_at(bench, 26.3, IN_THE_PART_MM)
    bench.raw("$$$\r")
    bench.lathe.connect()
    # Killed, the tool runs out a little.
    assert bench.number("#1P") == pytest.approx(0, abs=10)
    assert bench.number("#3P") == 0
    again = bench.sim.look()
    assert again.jaw_1_past_mark_deg == seen.jaw_1_past_mark_deg
    assert again.tool_gap_mm == pytest.approx(seen.tool_gap_mm, abs=2 * SETTLED_MM)


def test_where_the_part_was_cut_the_gap_is_to_the_new_surface(
    bench: Bench, machine: MachineProfile, experiment: JobMaker
) -> None:
    """0.1 mm off, over 2 mm from the free end at 170 mm; behind that the blank still stands."""
    job = replace(experiment(1), cut_length_mm=2.0)
    homed(bench).sim.mount(job)
    cut(bench, job, machine)
    spindle_counts = bench.number("#2P")
    for z_mm in (170.3, 171.0, 171.7):
        for ahead_counts in (1234, 5678):
            bench.lathe.jog_to(AxisName.SPINDLE, spindle_counts + ahead_counts)
            assert tool_at(bench, 28.0, z_mm).tool_gap_mm == pytest.approx(2.1, abs=SETTLED_MM)
    assert tool_at(bench, 28.0, 174.0).tool_gap_mm == pytest.approx(2.0, abs=SETTLED_MM)
    bench.sim.mount(job)
    assert tool_at(bench, 28.0, 171.0).tool_gap_mm == pytest.approx(2.0, abs=SETTLED_MM)


def test_a_tool_in_a_part_that_stands_still_has_not_cut_it(bench: Bench, experiment: JobMaker) -> None:
    homed(bench).sim.mount(experiment(1))
    assert tool_at(bench, 25.8, IN_THE_PART_MM).tool_gap_mm == pytest.approx(-0.2, abs=SETTLED_MM)
    assert tool_at(bench, 27.0, IN_THE_PART_MM).tool_gap_mm == pytest.approx(1.0, abs=SETTLED_MM)


def test_a_part_is_high_where_the_jaws_really_are(
    machine: MachineProfile, bench_with: TrueBenchMaker, experiment: JobMaker
) -> None:
    bench = bench_with(replace(ideal(machine), jaw_1_deg=47.0))
    bench.sim.mount(experiment(1))
    trace = bench.sim.measure()
    result = evaluate(trace.angle_deg, trace.deviation_um, None)
    phase_deg = next(h.phase_deg for h in result.harmonics if h.n == 3)
    assert np.cos(np.radians(3 * (phase_deg - 47.0))) == pytest.approx(1)


def test_a_lathe_set_up_by_hand_is_off_in_chuck_angle_and_tool_tip_and_its_spindle_has_inertia(
    machine: MachineProfile,
) -> None:
    nominal = replace(ideal(machine), ideal_spindle=False)
    angles, tips = [], []
    for seed in range(300):
        true = plant_named("mounted", machine, seed)
        assert true.jaw_1_deg is not None
        assert None not in (true.tool_ends_mm, true.carriage_ends_mm)
        found = replace(true, jaw_1_deg=None, home_radius_mm=nominal.home_radius_mm)
        assert replace(found, tool_ends_mm=None, carriage_ends_mm=None, seed=0) == nominal
        angles.append(true.jaw_1_deg)
        tips.append(true.home_radius_mm - nominal.home_radius_mm)
    assert 0 <= min(angles) < 10
    assert 350 < max(angles) < 360
    assert -0.3001 < min(tips) < -0.27
    assert 0.27 < max(tips) < 0.3001
    assert all(value == round(value, 2) for value in angles)
    assert plant_named("mounted", machine, 7) == plant_named("mounted", machine, 7)
    assert plant_named("mounted", machine).jaw_1_deg is not None
