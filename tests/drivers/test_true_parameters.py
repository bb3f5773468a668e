"""What a lathe is and not its profile: parameters, scatter, and the parts before."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from drivers.cutting.planning import Strategy, plan_cut
from drivers.pmac.settings import settings_with
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.drives import build_drives
from drivers.simulator.plant.presets import BUNDLED, plant_named
from drivers.simulator.plant.true_parameters import TrueParameters, ideal, ring_overtone
from profiles.axis.servo import sampled_response
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from profiles.store import load_job, load_machine
from profiles.traces import Trace
from tests.compact import compact_machine
from tests.drivers.conftest import JobMaker, TrueBenchMaker
from tests.drivers.cut_floor import CutFloor
from tests.drivers.test_workpiece import Cutting


def harmonic(trace: Trace, per_turn: int) -> complex:
    """Amplitude in um and phase of a wave of a trace, by the DFT of its 3600 points."""
    spectrum = np.fft.rfft(trace.deviation_um) / len(trace.deviation_um) * 2
    return complex(spectrum[per_turn])


def released(machine: MachineProfile, true: TrueParameters, job_of: JobMaker, **changed: Any) -> Trace:
    """The trace of a blank that is clamped and let go again."""
    lathe = SimulatedLathe(machine, true)
    lathe.mount(replace(job_of(1), **changed))
    return lathe.measure()


def test_an_ideal_lathe_has_none_of_it_and_a_commutation_half_a_turn_off_runs_away(
    machine: MachineProfile,
) -> None:
    true = ideal(machine)
    assert true.viscous_n_s_per_m == machine.tool.damping_n_s_per_m
    assert true.thrust_n_per_v == machine.tool.loop_gain_n_per_v
    assert true.scale_wrong_mm(12.345) == 0.0
    assert true.force_factor(Random(1)) == 1.0
    assert true.belt_ratio == 1.0
    lathe = SimulatedLathe(machine, replace(ideal(machine), commutation_error_deg=180.0))
    port = lathe.connect()
    port.receive(b"#1J/\r")
    lathe.wait(0.1)
    port.receive(b"#1J:20\r")
    lathe.wait(1.0)
    assert lathe.controller.motors[1].fatal_error


def test_dry_friction_takes_its_part_of_the_damping_and_no_more(machine: MachineProfile) -> None:
    """A sine of up to 0.1 m/s loses the same energy, F |v| + B v^2 on the average.

    3 N make 38.2 of 201.6 N s/m.
    """
    true = replace(ideal(machine), coulomb_friction_n=3.0)
    v = 0.1 * np.sin(2 * np.pi * (np.arange(100_000) + 0.5) / 100_000)
    lost = 3.0 * np.abs(v).mean() + true.viscous_n_s_per_m * (v**2).mean()
    assert lost == pytest.approx(201.6 * (v**2).mean(), rel=1e-6)
    assert 201.6 - true.viscous_n_s_per_m == pytest.approx(38.2, abs=0.05)
    # 201.6 N s/m times pi / 4 at 0.1 m/s is 15.8 N.
    assert replace(ideal(machine), coulomb_friction_n=15.8).viscous_n_s_per_m > 0.0
    with pytest.raises(ValueError, match=r"coulomb_friction_n = 15.9 N; all damping is 15.83 N"):
        replace(ideal(machine), coulomb_friction_n=15.9)


@pytest.mark.parametrize(("error_deg", "share"), [(0.0, 1.0), (60.0, 0.5), (90.0, 0.0), (180.0, -1.0)])
def test_a_wrong_commutation_leaves_its_cosine(machine: MachineProfile, error_deg: float, share: float) -> None:
    true = replace(ideal(machine), commutation_error_deg=error_deg)
    tool = build_drives(machine, true, settings_with(machine.controller.variables)).tool
    track = np.array(tool.push(0.1, 4))
    force_n = 0.1 * 10_531 / 3276.8 * 11.45 * 54.5
    acceleration = np.diff(track, 2)[1] / 0.00044270837**2 / 5e6
    assert acceleration == pytest.approx(share * force_n / 4.74, rel=0.03, abs=1e-6)


def test_the_scale_is_wrong_by_half_a_micrometre_in_a_short_period(machine: MachineProfile) -> None:
    """The tool is brought to 40 places of a period of 20 um: it stands up to 0.5 um beside each."""
    true = replace(ideal(machine), scale_error_um=0.5)
    places = 5.0 + np.arange(40) * 0.0005
    wrong = np.array([true.scale_wrong_mm(mm) for mm in places])
    spectrum = np.abs(np.fft.rfft(wrong * 1000.0)) / 20
    assert spectrum[1] == pytest.approx(0.5, rel=1e-6)
    assert np.delete(spectrum, 1).max() < 1e-9


def test_the_tip_errs_with_it(machine: MachineProfile, experiment: JobMaker, bench_with: TrueBenchMaker) -> None:
    """At 43 mm of its scale, 400 um sin(2 pi 43 / 4) = -400 um: the tip is seen that much further out."""
    true = replace(ideal(machine), scale_error_um=400.0, scale_period_um=4000.0)
    bench = bench_with(true)
    bench.lathe.enable()
    bench.lathe.home()
    bench.sim.mount(experiment(1))
    bench.client.request("#3J=174000")
    bench.client.request("#1J=215000")
    bench.sim.wait(20.0)
    gap_mm = bench.sim.look().tool_gap_mm
    assert gap_mm == pytest.approx(76.0 - 43.0 - 26.0 + 0.4, abs=0.003)


def test_a_harder_jaw_makes_the_part_oval_and_eccentric(machine: MachineProfile, experiment: JobMaker) -> None:
    """Jaw 1 by 3 % over the mean, so the others by 1.5 % below: 1.03, 0.985 and 0.985 of 438 N.

    The waves of a ring under loads W_i at a_i are sum W_i exp(-j n a_i) / (n^2 - 1)^2; the lobe of three equal
    ones is 27.5 um. The whole part sits 438 x 0.045 N / 75 N/um off the axis.
    """
    trace = released(machine, replace(ideal(machine), jaw_1_deg=40.0, jaw_1_harder=0.03), experiment)
    loads, at = np.array([1.03, 0.985, 0.985]), np.radians([40.0, 160.0, 280.0])

    def bent(n: int) -> complex:
        return complex((loads * np.exp(-1j * n * at)).sum() / (n**2 - 1) ** 2)

    per_um = 27.5 / abs(bent(3))
    # The DFT gives a wave A cos n (angle - a) as A exp(-j n a).
    assert harmonic(trace, 3) == pytest.approx(bent(3) * per_um, abs=0.01)
    assert harmonic(trace, 2) == pytest.approx(bent(2) * per_um, rel=1e-6)
    assert abs(harmonic(trace, 2)) == pytest.approx(2.93, abs=0.01)
    assert harmonic(trace, 1) == pytest.approx(438 * 0.045 / 75 * np.exp(-1j * np.radians(40.0)), rel=1e-6)


def test_two_jaws_and_equal_jaws_make_their_lobe_alone(machine: MachineProfile, experiment: JobMaker) -> None:
    trace = released(machine, ideal(machine), experiment)
    assert [abs(harmonic(trace, n)) for n in (1, 2, 4)] == pytest.approx([0, 0, 0], abs=1e-9)
    true = replace(ideal(machine), jaw_1_harder=0.03)
    trace = released(machine, true, experiment, jaws=2)
    assert abs(harmonic(trace, 2)) == pytest.approx(27.5, abs=0.01)
    # One with 1.03 and the other with 0.97 of 657 N, on two springs of 50 N/um in line.
    assert abs(harmonic(trace, 1)) == pytest.approx(657 * 0.06 / 100, rel=1e-6)


def test_each_clamping_has_a_force_of_its_own(machine: MachineProfile, experiment: JobMaker) -> None:
    """5 % of 1314 N, of which 1083.7 N hold at speed, from part to part; the same parts with the same seed."""
    true = replace(ideal(machine), clamping_force_spread=0.05, seed=4)
    lathes = SimulatedLathe(machine, true), SimulatedLathe(machine, true)
    lobes = []
    for lathe in lathes:
        for _ in range(200):
            lathe.mount(experiment(1))
            lobes.append(abs(harmonic(lathe.measure(), 3)))
    assert lobes[:200] == lobes[200:]
    assert np.mean(lobes) == pytest.approx(27.5, rel=0.015)
    assert np.std(lobes[:200]) == pytest.approx(0.0606 * 27.5, rel=0.15)


def test_the_lobe_goes_with_the_force_that_holds_the_part_at_speed(experiment: JobMaker) -> None:
    """E ~ F_sp0 - F_c, three jaws of 0.2 kg at 35 mm: of 1314 N 1083.7 are left at 1000 rpm, 1256.4 at 500."""
    job = replace(experiment(1), cut_length_mm=0.6, lobe_spindle_speed_rpm=1000.0)
    lobes = []
    for rpm in (1000.0, 500.0):
        turned = replace(job, spindle_speed_rpm=rpm)
        floor = CutFloor(turned, compact_machine().machine, Strategy.NONE)
        floor.cut()
        lobes.append(floor.measured().amplitude_um(3))
    assert lobes[0] == pytest.approx(27.5, abs=0.02)
    loss_n = 3 * 0.2 * 0.035 * (2 * math.pi * np.array([1000.0, 500.0]) / 60.0) ** 2
    assert lobes[1] / lobes[0] == pytest.approx((1314.0 - loss_n[1]) / (1314.0 - loss_n[0]), abs=0.002)


@pytest.mark.parametrize(
    ("changed", "lobe_um_pp"),
    [
        ({}, 55.0),
        ({"lobe_spindle_speed_rpm": 1000.0, "lobe_force_n": 1314.0}, 55.0),
        ({"spindle_speed_rpm": 2500.0, "lobe_spindle_speed_rpm": None}, 55.0),  # nothing is said of another speed
        ({"chucking_force_n": 657.0}, 55.0 * (657.0 - 230.29) / (1314.0 - 230.29)),
        ({"chucking_force_n": 200.0}, 0.0),  # the jaws let go of it
        ({"lobe_force_n": 200.0}, 0.0),  # so they did of the part that was measured
    ],
)
def test_what_is_held_as_it_was_found_is_exactly_as_found(
    machine: MachineProfile, experiment: JobMaker, changed: dict[str, Any], lobe_um_pp: float
) -> None:
    seen = ideal(machine).blank(replace(experiment(1), **changed)).lobe_um_pp
    assert seen == (lobe_um_pp if lobe_um_pp in (0.0, 55.0) else pytest.approx(lobe_um_pp, rel=1e-4))


def test_dry_friction_costs_some_of_the_lobe(
    machine: MachineProfile, experiment: JobMaker, bench_with: TrueBenchMaker
) -> None:
    """A sine of 27.5 um at 50 Hz in air: with 3 N the loop of section 4.2 falls behind by some 10 um more."""
    left = []
    for friction_n in (0.0, 3.0):
        true = replace(ideal(machine), coulomb_friction_n=friction_n)
        tool = build_drives(machine, true, settings_with(machine.controller.variables)).tool
        tool.close_loop()
        time_s = np.arange(round(2.0 / 0.00044270837)) * 0.00044270837
        command = 137.5 * np.minimum(time_s / 0.5, 1) * np.sin(2 * np.pi * 50 * time_s)
        track = np.array(tool.follow(command.tolist()))
        tail = slice(len(track) // 2, None)
        carrier = np.exp(-2j * np.pi * 50 * time_s[tail])
        left.append(complex((track[tail] * carrier).sum() / (command[tail] * carrier).sum()))
    assert abs(left[0]) == pytest.approx(0.885, rel=0.01)
    # Harmonic balance: T = L / (1 + L) with 3 N as the damping 4 F / (pi V) of its own peak speed V.
    speed = abs(left[1]) * 27.5e-6 * 2 * math.pi * 50
    damping = replace(ideal(machine), coulomb_friction_n=3.0).viscous_n_s_per_m + 4 * 3.0 / (math.pi * speed)
    true_position = replace(machine, tool=replace(machine.tool, damping_n_s_per_m=damping))
    assert left[1] == pytest.approx(complex(sampled_response(true_position, 50.0)), abs=0.03)
    assert abs(left[1] - left[0]) > 0.1


# No two lathes alike: what a seed draws, and what chuck, blank, warm-up and gauge then do to parts.

LATHES = 300


def spread_harmonic(trace: Trace, order: int) -> complex:
    """Amplitude (um) and phase of a harmonic of a trace over one turn."""
    return complex(np.fft.rfft(trace.deviation_um)[order] / (0.5 * trace.deviation_um.size))


def drawn(machine: MachineProfile, plant: str, count: int = LATHES) -> list[TrueParameters]:
    return [plant_named(plant, machine, seed) for seed in range(count)]


@pytest.mark.parametrize(("plant", "lobe_sd", "turned_sd_deg"), [("realistic", 0.07, 3.0), ("hard", 0.14, 6.0)])
@pytest.mark.first(1)
def test_lathes_scatter_as_said(machine: MachineProfile, plant: str, lobe_sd: float, turned_sd_deg: float) -> None:
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
    assert abs(spread_harmonic(trace, 3)) == pytest.approx(27.5, abs=1e-3)
    assert abs(spread_harmonic(trace, 6)) == pytest.approx(27.5 * (8.0 / 35.0) ** 2, abs=1e-3)
    for order in (3, 6):
        high_deg = -math.degrees(np.angle(spread_harmonic(trace, order))) / order
        assert math.remainder(high_deg - job.jaw_1_deg - 4.0, 360.0 / order) == pytest.approx(0.0, abs=1e-6)


def test_the_depth_of_cut_swings_with_the_shape_of_the_blank() -> None:
    oval = Cutting()
    oval.clamp(lambda turns: 0.01 * np.cos(4.0 * np.pi * turns))
    at, forces = oval.passes(lambda _: 0.1, turns=3.0)
    turned = 4.0 * np.pi * at
    basis = np.column_stack((np.ones_like(at), np.cos(turned), np.sin(turned)))
    mean, cosine, sine = np.linalg.lstsq(basis, forces, rcond=None)[0]
    assert (cosine / mean, sine / mean) == pytest.approx((0.1, 0.0), abs=0.003)


def test_an_oval_blank_shows_so_until_it_is_cut(machine: MachineProfile, experiment: JobMaker) -> None:
    lathe = SimulatedLathe(machine, replace(ideal(machine), blank_oval_um_pp=20.0, blank_run_out_um=40.0, seed=5))
    phases = []
    for _ in range(3):
        lathe.mount(experiment(1))
        trace = lathe.measure_clamped()
        assert [abs(spread_harmonic(trace, order)) for order in (1, 2)] == pytest.approx([20.0, 10.0], abs=1e-6)
        phases.append(np.angle(spread_harmonic(trace, 2)))
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


def test_a_start_mark_is_set_by_hand_or_not_needed(machine: MachineProfile, experiment: JobMaker) -> None:
    lathe = SimulatedLathe(machine, replace(ideal(machine), gauge_mark_sd_deg=2.0, seed=3))
    lathe.mount(experiment(1))
    at_deg = [math.degrees(np.angle(spread_harmonic(lathe.measure(), 3))) / 3.0 for _ in range(200)]
    assert np.std(at_deg) == pytest.approx(2.0, rel=0.15)
    lathe = SimulatedLathe(machine, replace(ideal(machine), gauge_mark_sd_deg=2.0, blank_oval_um_pp=20.0))
    lathe.mount(experiment(1))
    clamped = [np.angle(spread_harmonic(lathe.measure_clamped(), 2)) for _ in range(5)]
    assert np.ptp(clamped) == pytest.approx(0.0, abs=1e-9)


# A simulated lathe that is started anew goes on with the blanks, the clampings and the gauge of its seed.

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


def test_clamping_and_dial_are_those_of_the_part_from_the_first_on() -> None:
    (first,), (same,) = traces(1), traces(1, parts_before=0)
    assert np.array_equal(first.deviation_um, same.deviation_um)
    assert first.meta["lathe"] == "realistic, seed 6"
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


def test_a_chuck_changes_with_the_parts_as_its_plant_says(machine: MachineProfile, experiment: JobMaker) -> None:
    """The lobe turns by 2 degrees of spindle a part; from part 3 on the harder jaw is where jaw 2 was."""
    changing = replace(ideal(machine), jaw_1_harder=0.05, lobe_turned_deg_per_part=2.0, jaws_refitted_from_part=3)
    lathe, traces = SimulatedLathe(machine, changing), []
    for _ in range(4):
        lathe.mount(experiment(1))
        traces.append(lathe.measure())
    turned = [np.angle(harmonic(traces[0], 3) / harmonic(each, 3), deg=True) / 3 for each in traces]
    assert turned == pytest.approx([0.0, 2.0, 4.0, 6.0], abs=0.01)
    ovals = [harmonic(each, 2) / harmonic(traces[0], 2) for each in traces[1:]]
    assert ovals == pytest.approx([1.0, *[np.exp(-2j * math.radians(120.0))] * 2], abs=1e-4)
