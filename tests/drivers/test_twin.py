"""The hardware of a lathe that is not new, and how far forces and friction push its loop."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.cutting.planning import Strategy, plan_cut
from drivers.pmac.settings import settings_with
from drivers.simulator.card.servo import ServoAxis
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.axis import NoisyScale
from drivers.simulator.plant.driven_mass import DrySlide, linear_motor
from drivers.simulator.plant.drives import build_drives
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.servo_gains import ServoGains
from drivers.simulator.plant.spindle import RadialError
from drivers.simulator.plant.true_parameters import TrueParameters, ideal
from drivers.simulator.plant.workshop import SimulatedWorkshop
from profiles.axis.sampled_loop import loop_of
from profiles.axis.servo import sampled_response
from profiles.axis.stiffness import compliance_um_per_n, friction_um_pp
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from profiles.traces import Trace
from tests.drivers.conftest import JobMaker, TrueBenchMaker

CYCLE_S = 3_713_707 / 8_388_608_000
COUNTS_PER_UM = 5.0
BITS_PER_V = 32_768 / 10


class Push:
    """A force beside the motor, N outwards as the cut's, at each servo cycle."""

    acts, led = True, False

    def __init__(self, forces_n: list[float], mass_kg: float = 4.74) -> None:
        self._left = list(reversed(forces_n))
        self._per_n = 5e6 / mass_kg

    def begin(self) -> None:
        pass

    def push(self, _: float) -> float:
        return self._per_n * self._left.pop()


def pushed_um(forces_n: list[float], finer: int = 1, ix33: float = 811.0) -> np.ndarray:
    """Where the published loop lets itself be pushed; sampled `finer` times as often it is Eq 9."""
    gains = ServoGains(
        ix08=96, ix09=96, ix30=528, ix31=4905 * finer, ix32=0, ix33=ix33 / finer, ix34=0, ix35=0, ix69=10_531
    )
    slide = linear_motor(
        mass_kg=4.74,
        damping_n_s_per_m=201.6,
        force_n_per_bit=624.025 / BITS_PER_V,
        peak_output_bits=10_531,
        counts_per_m=5e6,
    )
    push: Any = Push(forces_n)
    axis = ServoAxis(slide, gains, CYCLE_S / finer, load=push)
    axis.close_loop()
    return np.array(axis.follow([0.0] * len(forces_n))) / COUNTS_PER_UM


def test_a_steady_force_pushes_the_loop_until_its_integrator_takes_it_back() -> None:
    """1 / (624 N/V x 147.6 V/m) = 10.86 um/N without the integrator: 6 N are 65 um."""
    at = pushed_um([6.0] * 2000, ix33=0.0)
    assert at[-500:].mean() / 6.0 == pytest.approx(10.857, rel=0.003)
    # With the time constant Kp / Ki = 4.57 s; the first instants belong to mass and damping.
    at = pushed_um([6.0] * round(8.0 / CYCLE_S))
    first, later = (at[round(time_s / CYCLE_S)] for time_s in (2.0, 6.0))
    assert 4.0 / math.log(first / later) == pytest.approx(4.57, rel=0.03)


def test_a_force_at_50_hz_pushes_as_the_loop_of_eq_9_lets_it() -> None:
    """1.4951 um/N at -124.2 deg: the continuous loop, here sampled 20 times as often as the card does."""
    step_s = CYCLE_S / 20
    time_s = np.arange(round(0.4 / step_s)) * step_s
    at = pushed_um((6.0 * np.sin(100 * np.pi * time_s)).tolist(), finer=20)
    tail = slice(round(0.2 / step_s), None)
    found = 2j * (at[tail] * np.exp(-100j * np.pi * time_s[tail])).mean() / 6.0
    assert abs(found) == pytest.approx(1.4951, rel=0.02)
    assert math.degrees(cmath.phase(found)) == pytest.approx(-124.2, abs=2.0)


@settings(max_examples=15, deadline=None)
@given(
    speed=st.floats(6e4, 2e5),
    volts=st.floats(-0.008, 0.008),
    lag_ms=st.floats(0.05, 2.0),
    friction_n=st.sampled_from([0.0, 3.0]),
)
def test_a_lagging_current_moves_a_sliding_mass_as_its_differential_equation_says(
    speed: float, volts: float, lag_ms: float, friction_n: float
) -> None:
    """M v' = F - B v - friction with F' = (asked - F) / lag, over 20 cycles of a command that changes sign."""
    from scipy.integrate import solve_ivp

    mass = linear_motor(
        mass_kg=4.74,
        damping_n_s_per_m=201.6,
        force_n_per_bit=624.025 / BITS_PER_V,
        peak_output_bits=32_768,
        counts_per_m=5e6,
        friction_n=friction_n,
    )
    slide, x, v = DrySlide(mass, CYCLE_S, lag_ms / 1000.0), 0.0, speed
    state = np.array([0.0, speed, 0.0])
    for cycle in range(20):
        asked = volts * BITS_PER_V * (-1) ** (cycle // 5)
        x, v = slide.step(x, v, asked)

        def moves(_: float, y: np.ndarray, asked: float = asked) -> list[float]:
            driven = (asked * mass.acceleration_per_bit - y[2]) / (lag_ms / 1000.0)
            return [y[1], y[2] - 201.6 / 4.74 * y[1] - math.copysign(mass.friction, y[1]), driven]

        state = solve_ivp(moves, (0.0, CYCLE_S), state, rtol=1e-10, atol=1e-9).y[:, -1]
    assert x == pytest.approx(state[0], abs=1e-4)
    assert v == pytest.approx(state[1], abs=1e-2)


def test_the_scale_has_its_noise_and_the_host_sees_it(machine: MachineProfile) -> None:
    """0.3 um are 1.5 counts, and rounding adds a twelfth of a count squared; the iron stands still."""
    scale = NoisyScale(1.5, 7)
    readings = np.array([scale.read(0.3) for _ in range(20_000)])
    assert readings.std() == pytest.approx(math.sqrt(1.5**2 + 1 / 12), rel=0.02)
    assert readings.mean() == pytest.approx(0.3, abs=0.05)
    lathe = SimulatedLathe(machine, replace(ideal(machine), encoder_noise_um=0.3))
    seen = set()
    for _ in range(200):
        lathe.wait(0.005)
        seen.add(lathe.controller.motors[1].position)
    assert len(seen) > 4
    assert lathe.controller.motors[1].actual == 0.0


def test_the_noise_goes_through_the_derivative_into_the_current(machine: MachineProfile) -> None:
    """Kd (n_k - n_k-1) / T: 2.5 V s/m x 0.3 um x sqrt(2) / 0.4427 ms is 1.5 N rms, and hardly moves 5 kg."""
    true = replace(ideal(machine), encoder_noise_um=0.3)
    tool = build_drives(machine, true, settings_with(machine.controller.variables)).tool
    tool.close_loop()
    forces, places = [], []
    for _ in range(6000):
        places += tool.follow([0.0])
        forces.append(tool.output_bits / tool.limit_bits * 36.8 * 54.5)
    assert np.std(forces) == pytest.approx(1.5, rel=0.1)
    assert np.std(places) / COUNTS_PER_UM < 0.3


def test_the_axis_of_the_spindle_wanders_by_what_is_said() -> None:
    """Over one turn; the part of it once a turn is none, and what strays is a tenth of it."""
    wander = RadialError(1.2, Random(5))
    turns = np.arange(36_000) / 3600
    at_um = 1000.0 * np.array([wander.at_mm(turn) for turn in turns.tolist()])
    mean = at_um.reshape(10, 3600).mean(axis=0)
    assert np.ptp(mean) == pytest.approx(1.2, abs=0.08)
    assert abs(np.fft.rfft(mean)[1]) / 1800 < 0.03
    assert 0.05 < np.ptp(at_um - np.tile(mean, 10)) <= 0.13


def turned_round(machine: MachineProfile, true: TrueParameters, job: Job) -> Trace:
    """The part that a tool leaves which stands still at its depth while the middle of the cut goes by."""
    drives = build_drives(machine, true, settings_with(machine.controller.variables))
    floor = SimulatedWorkshop(machine, true, drives)
    floor.mount(job)
    middle_mm = true.jaw_face_mm - job.overhang_mm + 0.5 * job.cut_length_mm
    cycles = round(40 / (job.spindle_speed_rpm / 60 * CYCLE_S))
    turns = np.arange(cycles) * job.spindle_speed_rpm / 60 * CYCLE_S
    z = middle_mm + (turns - turns[-1] / 2) * job.feed_mm_per_rev
    tool = np.full(
        cycles, (true.home_radius_mm - job.radius_mm + job.depth_of_cut_mm) * machine.tool.counts_per_mm
    )
    tracks = {
        machine.tool.motor: tool.tolist(),
        machine.spindle.motor: (turns * machine.spindle.counts_per_rev).tolist(),
        machine.carriage.motor: (z * machine.carriage.counts_per_mm).tolist(),
    }
    floor.pass_along(tracks, 1000.0)
    return floor.measure()


def roundness_um(trace: Trace) -> float:
    angle = np.radians(trace.angle_deg)
    columns = np.column_stack([np.ones_like(angle), np.cos(angle), np.sin(angle)])
    fit = np.linalg.lstsq(columns, trace.deviation_um, rcond=None)[0]
    return float(np.ptp(trace.deviation_um - columns @ fit))


@pytest.fixture
def round_job(experiment: JobMaker) -> Job:
    """A blank that the chuck does not press out of round."""
    return replace(experiment(1), lobe_error_um_pp=0.0)


def test_a_wandering_spindle_leaves_the_floor_of_the_machine(machine: MachineProfile, round_job: Job) -> None:
    """1.2 um repeat and 0.1 um do not: 1.1 to 1.5 um are left, and nothing on a spindle that stays."""
    assert roundness_um(turned_round(machine, ideal(machine), round_job)) < 1e-6
    for seed in range(5):
        true = replace(ideal(machine), radial_error_um_pp=1.2, seed=seed)
        assert 1.1 < roundness_um(turned_round(machine, true, round_job)) < 1.5


def test_in_the_chuck_the_indicator_sees_the_spindle(machine: MachineProfile, experiment: JobMaker) -> None:
    """The wander that made the part out of round takes it past an indicator just so."""
    lathe = SimulatedLathe(machine, replace(ideal(machine), radial_error_um_pp=1.2))
    with pytest.raises(RuntimeError):
        lathe.measure_clamped()
    lathe.mount(experiment(1))
    clamped = lathe.measure_clamped()
    assert clamped.meta["state"] == "clamped"
    # The blank is round as it is clamped: what is seen is the spindle.
    assert 1.0 < roundness_um(clamped) < 1.5
    assert roundness_um(lathe.measure()) == pytest.approx(55.0, abs=0.01)


def test_the_gauge_adds_eccentricity_noise_and_its_mark(machine: MachineProfile, experiment: JobMaker) -> None:
    true = replace(ideal(machine), gauge_eccentricity_um=5.0, gauge_noise_um=0.05, seed=3)
    lathe = SimulatedLathe(machine, true)
    lathe.mount(experiment(1))
    first, second = lathe.measure(), lathe.measure()
    for trace in (first, second):
        harmonics = np.fft.rfft(trace.deviation_um) / 1800
        assert abs(harmonics[1]) == pytest.approx(5.0, abs=0.01)
        assert abs(harmonics[3]) == pytest.approx(27.5, abs=0.01)
        assert np.sqrt((np.abs(harmonics[100:]) ** 2).sum() / 2) == pytest.approx(0.05, rel=0.05)
    assert abs(first.deviation_um - second.deviation_um).max() > 0.1
    lathe = SimulatedLathe(machine, replace(ideal(machine), gauge_mark_known=False, seed=3))
    lathe.mount(experiment(1))
    blind = lathe.measure()
    assert blind.meta["start_mark"] == "unknown"
    assert abs(np.angle(np.fft.rfft(blind.deviation_um)[3] / np.fft.rfft(first.deviation_um)[3])) > 0.1


def test_the_same_seed_is_the_same_lathe_and_clamping(machine: MachineProfile, experiment: JobMaker) -> None:
    def lobes(sd_percent: float, seed: int) -> list[float]:
        lathe = SimulatedLathe(machine, plant_named("steady", machine, seed, sd_percent))
        found = []
        for _ in range(20):
            lathe.mount(experiment(1))
            found.append(abs(np.fft.rfft(lathe.measure().deviation_um)[3]) / 1800)
        return found

    assert lobes(0.0, 1) == pytest.approx([27.5] * 20, abs=0.01)
    assert lobes(5.0, 1) == lobes(5.0, 1) != lobes(5.0, 2)
    assert np.std(lobes(5.0, 1)) / 27.5 == pytest.approx(0.05, rel=0.5)


def test_the_pinned_lathe_is_off_by_what_was_pinned(machine: MachineProfile) -> None:
    nominal, true = ideal(machine), plant_named("steady", machine, 1)
    assert true.moving_mass_kg / nominal.moving_mass_kg == pytest.approx(1.05)
    assert (true.coulomb_friction_n, true.current_lag_s, true.encoder_noise_um) == (3.0, 0.0002, 0.3)
    assert true.viscous_n_s_per_m == pytest.approx(201.6 - 38.2, abs=0.05)
    assert (true.speed_ripple, true.radial_error_um_pp, true.passive_fraction) == (0.002, 1.2, 0.4)
    # What a machine run knows: where the tip is, and jaw 1.
    assert (true.home_radius_mm, true.jaw_1_deg, true.clamping_force_spread) == (76.0, None, 0.0)
    by_hand = plant_named("steady", machine, 1, mounted_by_hand=True)
    assert by_hand.jaw_1_deg is not None and by_hand.home_radius_mm != 76.0
    assert (by_hand.moving_mass_kg, by_hand.ideal_spindle) == (true.moving_mass_kg, False)


def test_the_paper_has_its_iron_whatever_the_profile_says(machine: MachineProfile) -> None:
    for name in ("ideal", "paper"):
        assert plant_named(name, machine, 0) == ideal(machine)
    # T(50 Hz) with 4.74 kg, 201.6 N s/m and 624.025 N/V, on a profile of 5.5 kg and a third more thrust.
    heavy = replace(machine, tool=replace(machine.tool, moving_mass_kg=5.5, amplifier_gain_a_per_v=15.0))
    assert swings(heavy, plant_named("paper", heavy, 0)) == pytest.approx(
        complex(sampled_response(machine, 50.0)), rel=0.005
    )
    assert swings(heavy, plant_named("ideal", heavy, 0)) == pytest.approx(
        complex(sampled_response(heavy, 50.0)), rel=0.005
    )


def swings(machine: MachineProfile, true: TrueParameters) -> complex:
    """How the tool answers in air to 5 um at 50 Hz."""
    tool = build_drives(machine, true, settings_with(machine.controller.variables)).tool
    tool.close_loop()
    time_s = np.arange(round(1.2 / CYCLE_S)) * CYCLE_S
    harmonic = np.exp(100j * np.pi * time_s)
    told = 25.0 * np.minimum(time_s / 0.2, 1.0) * harmonic.imag
    tail = slice(-round(0.4 / CYCLE_S), None)
    return complex(2j * (np.array(tool.follow(told.tolist()))[tail] / harmonic[tail]).mean() / 25.0)


@pytest.mark.parametrize(("key", "factor"), [("mass_kg", "mass_factor"), ("thrust_n_per_v", "thrust_factor")])
def test_a_value_and_a_factor_on_it_are_refused_together(
    machine: MachineProfile, tmp_path: Path, key: str, factor: str
) -> None:
    path = tmp_path / "plant.toml"
    path.write_text(f"{key} = 4.0\n{factor} = 1.0\n", encoding="utf-8")
    with pytest.raises(ProfileError) as refused:
        plant_named(str(path), machine, 1)
    (problem,) = refused.value.problems
    assert (problem.code, problem.key, problem.value) == ("key.instead_of", key, factor)


def test_a_plant_is_refused_with_those_there_are_and_damping(machine: MachineProfile, tmp_path: Path) -> None:
    """20 N s/m are 1.57 N of friction at 0.1 m/s, whatever the profile says."""
    path = tmp_path / "plant.toml"
    path.write_text("damping_n_s_per_m = 20.0\ncoulomb_friction_n = 3.0\n", encoding="utf-8")
    with pytest.raises(ProfileError, match=r"coulomb_friction_n.*actual 3 N.*<= 1.571 N"):
        plant_named(str(path), machine, 1)
    with pytest.raises(
        ProfileError, match=r"plant.unknown.*ideal \| mounted \| paper \| steady \| easy \| realistic \| hard"
    ):
        plant_named("new", machine)


@pytest.mark.parametrize(
    ("content", "code", "key"),
    [
        ("thrust_factr = 0.9", "key.unknown", "thrust_factr"),
        ("thrust_factor = -0.9", "value.out_of_range", "thrust_factor"),
        ("coulomb_friction_n = 16.0", "value.out_of_range", "coulomb_friction_n"),
        ("start_mark = 'maybe'", "value.not_choice", "start_mark"),
        ("schema = 2", "schema.unsupported", "schema"),
    ],
)
def test_a_plant_file_that_cannot_be_is_refused(
    machine: MachineProfile, tmp_path: Path, content: str, code: str, key: str
) -> None:
    path = tmp_path / "plant.toml"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(ProfileError) as refused:
        plant_named(str(path), machine, 1)
    problem = refused.value.problems[0]
    assert (problem.code, problem.key) == (code, key)
    assert problem.limit and "plant.toml" in problem.where


def test_gain_and_force_may_be_off_by_a_file(machine: MachineProfile, tmp_path: Path) -> None:
    path = tmp_path / "off.toml"
    path.write_text("[tool]\nthrust_factor = 0.9\n[chuck]\nlobe_factor = 1.05\n", encoding="utf-8")
    true, nominal = plant_named(str(path), machine, 1), ideal(machine)
    assert true.force_n_per_v == pytest.approx(0.9 * nominal.force_n_per_v)
    assert true.lobe_factor == 1.05


def test_a_lobe_is_what_it_is_in_the_file(machine: MachineProfile, experiment: JobMaker, tmp_path: Path) -> None:
    """60 um at 1314 N, 4 deg past the jaws, though the job believes in 55; at half the force, of which the 230.3 N
    that the jaws lose at 1000 rpm are a larger share, 0.394 of it."""
    path = tmp_path / "known.toml"
    path.write_text("lobe_error_um_pp = 60.0\nlobe_force_n = 1314.0\nlobe_past_jaw_deg = 4.0\n", encoding="utf-8")
    lathe = SimulatedLathe(machine, plant_named(str(path), machine, 1))
    for job, amplitude_um in ((experiment(1), 30.0), (replace(experiment(1), chucking_force_n=657.0), 11.812)):
        lathe.mount(job)
        harmonic = np.fft.rfft(lathe.measure().deviation_um)[3] / 1800
        assert abs(harmonic) == pytest.approx(amplitude_um, abs=1e-3)
        phase_deg = -math.degrees(cmath.phase(harmonic)) / 3.0
        assert math.remainder(phase_deg - job.jaw_1_deg - 4.0, 120.0) == pytest.approx(0.0, abs=1e-6)
    lathe.mount(replace(experiment(1), lobe_error_um_pp=0.0))
    assert roundness_um(lathe.measure()) < 1e-6


def test_a_realistic_lathe_positions_and_makes_a_part(
    machine: MachineProfile, experiment: JobMaker, bench_with: TrueBenchMaker
) -> None:
    """3.0 N of passive force are up to 35 um of size that a plain cut loses; the lobe is that of the clamping."""
    job = replace(experiment(1), cut_length_mm=2.0)
    bench = bench_with(plant_named("steady", machine, 2))
    bench.homed(job)
    bench.cut(plan_cut(job, machine, Strategy.NONE))
    assert bench.sim.collisions == ()
    trace = bench.sim.measure()
    assert abs(np.fft.rfft(trace.deviation_um)[3]) / 1800 == pytest.approx(27.5, abs=1.0)
    assert 15.0 < trace.deviation_um.mean() < 40.0


def learnt_um(machine: MachineProfile, true: TrueParameters, passes: int) -> list[float]:
    """Lobe error p-p of each pass in air: 27.5 um at 50 Hz by the inverse of the nominal loop, then corrected."""
    tool = build_drives(machine, true, settings_with(machine.controller.variables)).tool
    tool.close_loop()
    nominal = complex(sampled_response(machine, 50.0))
    told, left, cycles = 27.5 / nominal, [], round(1.5 / CYCLE_S)
    for number in range(passes):
        time_s = (np.arange(cycles) + number * cycles) * CYCLE_S
        harmonic = np.exp(100j * np.pi * time_s)
        grown = 1.0 if number else np.minimum(time_s / 0.2, 1.0)
        at_um = np.array(tool.follow((COUNTS_PER_UM * grown * np.imag(told * harmonic)).tolist())) / COUNTS_PER_UM
        tail = slice(cycles // 2, None)
        error = 27.5 - 2j * (at_um[tail] / harmonic[tail]).mean()
        told += error / nominal
        left.append(2.0 * abs(error))
    return left


def test_learning_on_iron_that_is_off_goes_as_was_calculated(machine: MachineProfile) -> None:
    """Simulated apart from this code: mass +10 % and gain -10 %; mass +5 %, 3 N and the noise of the scale."""
    off = replace(ideal(machine), moving_mass_kg=1.1 * 4.74, force_n_per_v=0.9 * 624.025)
    assert learnt_um(machine, off, 4) == pytest.approx([9.08, 1.51, 0.24, 0.04], abs=0.08)
    pinned = plant_named("steady", machine, 1)
    assert learnt_um(machine, replace(pinned, current_lag_s=0.0), 3) == pytest.approx([12.4, 0.31, 0.03], abs=0.6)
    # With the lag of the current, too, what is left is a tenth of the first pass, and then next to nothing.
    first, second, third = learnt_um(machine, pinned, 3)
    assert second < 0.1 * first and third < 0.3


# What dry friction is predicted to leave, against the simulated tool that has it.


@pytest.mark.parametrize("frequency_hz", [20.0, 50.0, 150.0])
def test_a_force_pushes_both_sampled_loops_as_far(machine: MachineProfile, frequency_hz: float) -> None:
    time_s = np.arange(round(1.0 / CYCLE_S)) * CYCLE_S
    at = pushed_um((2.0 * np.sin(2 * np.pi * frequency_hz * time_s)).tolist())
    tail = slice(len(at) // 2, None)
    found = 2j * (at[tail] * np.exp(-2j * np.pi * frequency_hz * time_s[tail])).mean() / 2.0
    compliance = compliance_um_per_n(loop_of(machine), machine.tool.loop_gain_n_per_v, frequency_hz)
    # The force is held for a cycle, so that it comes half a cycle late.
    late = np.exp(-1j * np.pi * frequency_hz * CYCLE_S)
    assert found == pytest.approx(complex(compliance) * late, rel=0.01)


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
