"""No two lathes alike: what a seed draws, and what chuck, blank, warm-up and gauge then do to parts."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.cutting.planning import Strategy, plan_cut
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import BUNDLED, plant_named
from drivers.simulator.plant.true_parameters import TrueParameters, ideal, ring_overtone
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from profiles.traces import Trace
from tests.drivers.conftest import JobMaker, TrueBenchMaker
from tests.drivers.test_tip_load import Cutting

LATHES = 300


def harmonic(trace: Trace, order: int) -> complex:
    """Amplitude (um) and phase of a harmonic of a trace over one turn."""
    return complex(np.fft.rfft(trace.deviation_um)[order] / (0.5 * trace.deviation_um.size))


def drawn(machine: MachineProfile, plant: str, count: int = LATHES) -> list[TrueParameters]:
    return [plant_named(plant, machine, seed) for seed in range(count)]


@pytest.mark.parametrize(("plant", "lobe_sd", "turned_sd_deg"), [("realistic", 0.07, 3.0), ("hard", 0.14, 6.0)])
@pytest.mark.first(1)
def test_lathes_scatter_as_their_file_says(
    machine: MachineProfile, plant: str, lobe_sd: float, turned_sd_deg: float
) -> None:
    lathes = drawn(machine, plant)
    factors = np.array([lathe.lobe_factor for lathe in lathes])
    turned_deg = np.array([lathe.lobe_turned_deg for lathe in lathes])
    # Three standard errors of a mean and of a standard deviation of so many.
    within = 3.0 / math.sqrt(LATHES)
    assert factors.mean() == pytest.approx(1.0, abs=within * lobe_sd)
    assert factors.std() == pytest.approx(lobe_sd, rel=within)
    assert turned_deg.std() == pytest.approx(turned_sd_deg, rel=within)
    assert abs(factors - 1.0).max() <= 3.0 * lobe_sd and abs(turned_deg).max() <= 3.0 * turned_sd_deg
    assert abs(np.corrcoef(factors, turned_deg)[0, 1]) < within
    assert min(lathe.blank_oval_um_pp for lathe in lathes) >= 0.0
    assert lathes == drawn(machine, plant)


def test_every_bundled_lathe_can_be_drawn_a_hundred_times(machine: MachineProfile) -> None:
    for plant in BUNDLED:
        drawn(machine, plant, 100)


def test_another_scatter_in_the_file_leaves_what_was_drawn_before(machine: MachineProfile, tmp_path: Path) -> None:
    one, two = tmp_path / "one.toml", tmp_path / "two.toml"
    one.write_text("[spread]\nlobe_factor = 0.1\n", encoding="utf-8")
    two.write_text("[spread]\nthrust_factor = 0.05\nlobe_factor = 0.1\n", encoding="utf-8")
    first, second = plant_named(str(one), machine, 4), plant_named(str(two), machine, 4)
    assert first.lobe_factor == second.lobe_factor != 1.0
    assert first.force_n_per_v == ideal(machine).force_n_per_v != second.force_n_per_v


def test_an_own_lathe_may_begin_from_a_bundled_one(machine: MachineProfile, tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text('like = "steady"\nmass_kg = 6.0\ncurrent_lag_ms = 0.0\n', encoding="utf-8")
    own, steady = plant_named(str(path), machine, 1), plant_named("steady", machine, 1)
    assert (own.moving_mass_kg, own.current_lag_s) == (6.0, 0.0)
    assert own == replace(steady, moving_mass_kg=6.0, current_lag_s=0.0)


@pytest.mark.parametrize(
    ("content", "code", "key"),
    [
        ("[spread]\nlobe_factr = 0.1", "key.unknown", "spread.lobe_factr"),
        ("[spread]\nlobe_factor = -0.1", "value.out_of_range", "spread.lobe_factor"),
        ("[spread]\nlobe_factor = '7 %'", "value.not_number", "spread.lobe_factor"),
        ("[spread]\nmass_kg = 0.1", "plant.spread_of_nothing", "spread.mass_kg"),
        ("[spread]\nstart_mark = 0.1", "key.unknown", "spread.start_mark"),
        ("spread = 0.1", "key.unknown", "spread.spread"),
        ("like = 'mine'", "value.not_choice", "like"),
        ("like = 'hard'\n[spread]\nlobe_facto = 0.1", "key.unknown", "spread.lobe_facto"),
    ],
)
def test_a_scatter_that_cannot_be_is_refused(
    machine: MachineProfile, tmp_path: Path, content: str, code: str, key: str
) -> None:
    path = tmp_path / "plant.toml"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(ProfileError) as refused:
        plant_named(str(path), machine, 1)
    assert (refused.value.problems[0].code, refused.value.problems[0].key) == (code, key)


def test_the_plant_says_how_clampings_scatter_unless_the_command_does(machine: MachineProfile) -> None:
    assert plant_named("hard", machine, 1).clamping_force_spread == pytest.approx(0.05)
    assert plant_named("hard", machine, 1, 0.0).clamping_force_spread == 0.0


@pytest.mark.parametrize("jaws", [2, 3, 4, 6])
def test_the_second_harmonic_of_the_lobe_is_that_of_a_ring(jaws: int) -> None:
    """Timoshenko, N equal radial forces: inwards under one, outwards between two, in P R^3 / (E I)."""
    half = math.pi / jaws
    sine, cosine = math.sin(half), math.cos(half)
    inwards = 0.5 * ((0.5 * half + 0.5 * sine * cosine) / sine**2 - 1.0 / half)
    outwards = 0.25 * (2.0 / half - 1.0 / sine - half * cosine / sine**2)
    # Under a force all harmonics add up, between two the even multiples of N have the other sign.
    even_over_odd = (inwards - outwards) / (inwards + outwards)
    assert even_over_odd == pytest.approx(ring_overtone(jaws), rel=0.12)


def test_a_lobe_that_is_turned_and_is_no_sine(machine: MachineProfile, experiment: JobMaker) -> None:
    job = experiment(1)
    lathe = SimulatedLathe(machine, replace(ideal(machine), overtone_factor=1.0, lobe_turned_deg=4.0))
    lathe.mount(job)
    trace = lathe.measure()
    assert abs(harmonic(trace, 3)) == pytest.approx(27.5, abs=1e-3)
    assert abs(harmonic(trace, 6)) == pytest.approx(27.5 * (8.0 / 35.0) ** 2, abs=1e-3)
    for order in (3, 6):
        high_deg = -math.degrees(np.angle(harmonic(trace, order))) / order
        assert math.remainder(high_deg - job.jaw_1_deg - 4.0, 360.0 / order) == pytest.approx(0.0, abs=1e-6)


def test_the_depth_of_cut_swings_with_the_shape_of_the_blank() -> None:
    oval = Cutting()
    oval.clamp(lambda turns: 0.01 * np.cos(4.0 * np.pi * turns))
    at, forces = oval.passes(lambda _: 0.1, turns=3.0)
    turned = 4.0 * np.pi * at
    basis = np.column_stack((np.ones_like(at), np.cos(turned), np.sin(turned)))
    mean, cosine, sine = np.linalg.lstsq(basis, forces, rcond=None)[0]
    assert (cosine / mean, sine / mean) == pytest.approx((0.1, 0.0), abs=0.003)


def test_a_blank_that_is_oval_and_runs_out_shows_both_until_it_is_cut(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    lathe = SimulatedLathe(machine, replace(ideal(machine), blank_oval_um_pp=20.0, blank_run_out_um=40.0, seed=5))
    phases = []
    for _ in range(3):
        lathe.mount(experiment(1))
        trace = lathe.measure_clamped()
        assert [abs(harmonic(trace, order)) for order in (1, 2)] == pytest.approx([20.0, 10.0], abs=1e-6)
        phases.append(np.angle(harmonic(trace, 2)))
    assert len({round(phase, 3) for phase in phases}) == 3


def test_parts_become_smaller_while_the_machine_warms_up(
    machine: MachineProfile, experiment: JobMaker, bench_with: TrueBenchMaker
) -> None:
    """12 um of the tip in the end, 63 % of it after two parts: the third is smaller, to two counts of the tool."""
    job = replace(experiment(1), cut_length_mm=0.5)
    bench = bench_with(replace(ideal(machine), drift_um=12.0, drift_parts=2.0))
    bench.homed(job)
    plan = plan_cut(job, machine, Strategy.NONE)
    bench.cut(plan)
    first_um = bench.sim.measure().deviation_um.mean()
    bench.sim.mount(job)
    bench.sim.mount(job)
    bench.cut(plan)
    assert first_um - bench.sim.measure().deviation_um.mean() == pytest.approx(12.0 * (1 - math.exp(-1)), abs=0.4)


def test_a_start_mark_is_set_by_hand_and_an_indicator_on_the_lathe_needs_none(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    lathe = SimulatedLathe(machine, replace(ideal(machine), gauge_mark_sd_deg=2.0, seed=3))
    lathe.mount(experiment(1))
    at_deg = [math.degrees(np.angle(harmonic(lathe.measure(), 3))) / 3.0 for _ in range(200)]
    assert np.std(at_deg) == pytest.approx(2.0, rel=0.15)
    lathe = SimulatedLathe(machine, replace(ideal(machine), gauge_mark_sd_deg=2.0, blank_oval_um_pp=20.0))
    lathe.mount(experiment(1))
    clamped = [np.angle(harmonic(lathe.measure_clamped(), 2)) for _ in range(5)]
    assert np.ptp(clamped) == pytest.approx(0.0, abs=1e-9)
