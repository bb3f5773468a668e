"""Parts as they are measured, with an override, and along their length."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from drivers.cutting.bounds import Adjustable, Bounds
from drivers.cutting.override import FeedOverride, PaceLedger, bounds_of
from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.identification.nominal import nominal_response, path_response
from drivers.lathe.snapshot import Snapshot
from drivers.pmac.dialect import PMAC
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.true_parameters import TrueParameters, ideal
from profiles.axis.response import identified_response
from profiles.axis.servo import sampled_response
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.roundness import RoundnessResult, evaluate
from tests.drivers import families
from tests.drivers.conftest import Bench, JobMaker, TrueBenchMaker, connected
from tests.drivers.cut_floor import CutFloor, with_inverter
from tests.drivers.plc_bench import SURFACE, TOOL, TURN_MS, begin_cut, cut_program, host_of, leased_loop, values
from tests.drivers.test_path_seen import seen, state

machine = families.close_machine
"""Everything close together."""


def cut(bench: Bench, job: Job, machine: MachineProfile, strategy: Strategy, ts_ms: int = 10) -> CutPlan:
    """Home, align, cut and withdraw, as the console does it."""
    plan = plan_cut(job, machine, strategy, ts_ms)
    bench.homed(job)
    bench.cut(plan)
    return plan


def found_at(job: Job, rpm: float) -> Job:
    """Return the job at another speed, at which its error was found, too: none of it is lost to rotation."""
    return replace(job, spindle_speed_rpm=rpm, lobe_spindle_speed_rpm=rpm)


def measured(bench: Bench) -> RoundnessResult:
    trace = bench.sim.measure()
    return evaluate(trace.angle_deg, trace.deviation_um, None)


@pytest.fixture(scope="session")
def experiment(experiment: JobMaker) -> JobMaker:
    """The trace is of one turn in the middle: a short cut shows the same."""
    return lambda number: replace(experiment(number), cut_length_mm=1.5)


@pytest.mark.parametrize(("number", "ront"), [(1, 55.0), (2, 33.0)])
def test_uncompensated_the_experiments_measure_what_the_paper_measured(
    bench: Bench, machine: MachineProfile, experiment: JobMaker, number: int, ront: float
) -> None:
    cut(bench, experiment(number), machine, Strategy.NONE)
    result = measured(bench)
    assert result.ront_um == pytest.approx(ront, abs=0.1)
    assert result.amplitude_um(3) == pytest.approx(ront / 2, abs=0.02)
    # The integrator, slow with its 4.6 s, still holds a part of the force that the approach needed.
    assert result.mean_deviation_um == pytest.approx(0, abs=1.0)


@pytest.mark.parametrize("rpm", [1000.0, 2000.0])
def test_a_feed_of_just_the_land_changes_nothing(
    bench: Bench, machine: MachineProfile, experiment: JobMaker, rpm: float
) -> None:
    job = replace(found_at(experiment(1), rpm), feed_mm_per_rev=machine.tool.wiper_land_mm)
    cut(bench, job, machine, Strategy.NONE)
    assert measured(bench).ront_um == pytest.approx(55.0, abs=0.3)


def test_another_chuck_lobe_phase_and_speed_do_what_they_say(
    bench: Bench, machine: MachineProfile, experiment: JobMaker
) -> None:
    job = replace(found_at(experiment(1), 640.0), jaws=4, lobe_error_um_pp=21.0, lobe_phase_deg=33.0)
    cut(bench, job, machine, Strategy.NONE)
    result = measured(bench)
    assert result.ront_um == pytest.approx(21.0, abs=0.3)
    assert result.amplitude_um(4) == pytest.approx(10.5, abs=0.02)
    assert result.amplitude_um(3) == pytest.approx(0, abs=0.02)
    assert next(h.phase_deg for h in result.harmonics if h.n == 4) == pytest.approx(33.0, abs=0.1)


@pytest.mark.first(1)
@pytest.mark.parametrize(("jaws", "phase_deg", "rpm"), [(3, 47.0, 1000.0), (4, 33.0, 640.0), (6, -100.0, 377.0)])
def test_the_inverse_leaves_less_than_a_micrometre_whatever_the_chuck(
    bench: Bench, machine: MachineProfile, experiment: JobMaker, jaws: int, phase_deg: float, rpm: float
) -> None:
    job = replace(found_at(experiment(1), rpm), jaws=jaws, lobe_phase_deg=phase_deg)
    cut(bench, job, machine, Strategy.PVT)
    result = measured(bench)
    assert result.amplitude_um(jaws) < 0.15
    assert result.ront_um < 1.0


def test_the_paper_program_improves_the_part(bench: Bench, machine: MachineProfile, experiment: JobMaker) -> None:
    """25 Hz, TA = TM with full S-curves: the fundamental of the path is 0.657 of the lobe, and the sampled loop
    at 25 Hz turns and scales it. What is left of 27.5 um is |1 - 0.657 T(25 Hz)|."""
    job = experiment(1)
    cut(bench, job, machine, Strategy.PAPER)
    result = measured(bench)
    # T(25 Hz) between the tabulated 10 and 30 Hz: 0.995 at -0.46 rad.
    left = abs(1 - 0.657 * 0.9965 * complex(0.8942, -0.4477))
    assert result.amplitude_um(3) == pytest.approx(27.5 * left, rel=0.04)
    assert result.ront_um < 55


def measured_after(bench: Bench, job: Job, machine: MachineProfile, strategy: Strategy) -> RoundnessResult:
    cut(bench, job, machine, strategy)
    return measured(bench)


@pytest.fixture(scope="module")
def nominal_left_um(machine: MachineProfile, experiment: JobMaker) -> float:
    """What the inverse leaves of experiment 1 where the servo is the nominal one, RONt."""
    return measured_after(connected(machine, true=ideal(machine)), experiment(1), machine, Strategy.PVT).ront_um


def test_by_default_the_machine_is_what_its_profile_says(machine: MachineProfile) -> None:
    """Tables 2 to 4 of the paper: 4.74 kg, 201.6 N s/m, 11.45 A/V times 54.5 N/A, 36.8 A."""
    true = ideal(machine)
    assert true.moving_mass_kg == 4.74
    assert true.damping_n_s_per_m == 201.6
    assert true.force_n_per_v == pytest.approx(11.45 * 54.5)
    assert true.peak_command_v == pytest.approx(36.8 / 11.45)


@pytest.mark.parametrize(("mass", "damping", "force"), [(1.0, 1.0, 0.95), (0.9, 1.5, 1.0)])
def test_an_inverse_of_the_nominal_servo_leaves_what_the_true_one_does_differently(
    bench_with: TrueBenchMaker,
    machine: MachineProfile,
    experiment: JobMaker,
    nominal_left_um: float,
    mass: float,
    damping: float,
    force: float,
) -> None:
    """The path is T_true / T_nominal times the wanted one: |1 - T_true/T_nominal| of the lobe stays."""
    job, nominal = experiment(1), ideal(machine)
    true = replace(
        nominal,
        moving_mass_kg=mass * nominal.moving_mass_kg,
        damping_n_s_per_m=damping * nominal.damping_n_s_per_m,
        force_n_per_v=force * nominal.force_n_per_v,
    )
    true_position = replace(
        machine.tool,
        moving_mass_kg=mass * machine.tool.moving_mass_kg,
        damping_n_s_per_m=damping * machine.tool.damping_n_s_per_m,
        thrust_constant_n_per_a=force * machine.tool.thrust_constant_n_per_a,
    )
    t_true = complex(sampled_response(replace(machine, tool=true_position), 50.0))
    left = abs(1 - t_true / complex(sampled_response(machine, 50.0)))
    result = measured_after(bench_with(true), job, machine, Strategy.PVT)
    assert result.ront_um == pytest.approx(left * 55.0, abs=0.3)
    assert result.amplitude_um(3) == pytest.approx(left * 27.5, abs=0.1)
    assert 3 * nominal_left_um < result.ront_um < 55.0 / 3


def test_a_part_that_springs_back_otherwise_than_its_job_says_shows_it(
    bench_with: TrueBenchMaker, machine: MachineProfile, experiment: JobMaker
) -> None:
    """Uncompensated: the true lobe. Compensated: 55 at 0 deg from 66 at 10 deg, 30 deg of the lobe apart."""
    true = replace(ideal(machine), lobe_factor=1.2, jaw_offset_deg=10.0)
    job = experiment(1)
    plain = measured_after(bench_with(true), job, machine, Strategy.NONE)
    assert plain.ront_um == pytest.approx(66.0, abs=0.3)
    phase_deg = next(h.phase_deg for h in plain.harmonics if h.n == 3)
    assert phase_deg == pytest.approx(job.lobe_phase_deg + 10.0, abs=0.1)
    left = abs(66.0 * complex(0.8660254, -0.5) - 55.0)
    assert measured_after(bench_with(true), job, machine, Strategy.PVT).ront_um == pytest.approx(left, abs=0.5)


def test_a_tool_that_stands_off_its_nominal_radius_makes_another_size(
    bench_with: TrueBenchMaker, machine: MachineProfile, experiment: JobMaker
) -> None:
    job, nominal = experiment(1), ideal(machine)
    off = replace(nominal, home_radius_mm=nominal.home_radius_mm + 0.02)
    sizes = [
        measured_after(bench_with(true), job, machine, Strategy.NONE).mean_deviation_um for true in (nominal, off)
    ]
    assert sizes[1] - sizes[0] == pytest.approx(20.0, abs=0.01)


# The override of a cut: its band by what the inverse leaves, and the polls by the time of the program.


def bounds(experiment: JobMaker, machine: MachineProfile, strategy: Strategy, tolerance_um: float = 5.0) -> Bounds:
    job = replace(experiment(1), cut_length_mm=1.0, roundness_tolerance_um=tolerance_um)
    return bounds_of(plan_cut(job, machine, strategy), job, machine, path_response(strategy, machine))


@pytest.mark.parametrize("tolerance_um", [2.0, 5.0, 8.0])
def test_the_band_ends_where_the_inverse_leaves_half_the_tolerance(
    machine: MachineProfile, experiment: JobMaker, tolerance_um: float
) -> None:
    """55 um |T(k f) / T(f) - 1| at a lobe frequency of 50 Hz."""

    def left_um(percent: float) -> float:
        there = nominal_response(Strategy.PVT, machine, 0.5 * percent)
        return 55.0 * abs(there / nominal_response(Strategy.PVT, machine, 50.0) - 1.0)

    band = bounds(experiment, machine, Strategy.PVT, tolerance_um)
    assert left_um(band.low_percent) <= 0.5 * tolerance_um < left_um(band.low_percent - 1)
    assert left_um(band.high_percent) <= 0.5 * tolerance_um < left_um(band.high_percent + 1)
    assert (band.low_by, band.high_by) == ("inverse", "inverse")


def test_an_identified_response_ends_the_band_at_its_own(machine: MachineProfile, experiment: JobMaker) -> None:
    points = {hz: nominal_response(Strategy.PVT, machine, hz) for hz in (49.2, 50.0, 51.2)}
    response = identified_response(
        frequency_hz=list(points),
        gain=[abs(point) for point in points.values()],
        phase_deg=[math.degrees(cmath.phase(point)) for point in points.values()],
        gain_ci=[0.0] * 3,
        phase_ci_deg=[0.0] * 3,
        amplitude_um=25.0,
        name="there",
    )
    job = replace(experiment(1), cut_length_mm=1.0)
    band = bounds_of(plan_cut(job, machine, Strategy.PVT), job, machine, response)
    assert (band.low_percent, band.high_percent) == (99, 102)
    assert (band.low_by, band.high_by) == ("response", "response")


def test_the_band_of_an_override_ends_at_limits_of_the_machine(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    slow = replace(machine, spindle=replace(machine.spindle, max_speed_rpm=1035.0))
    band = bounds(experiment, slow, Strategy.PVT)
    assert (band.high_percent, band.high_by) == (103, "spindle")
    assert band.low_percent == bounds(experiment, machine, Strategy.PVT).low_percent
    # I116, the most that a program may command the tool, 5.5 % above the peak of this program: 105 %.
    job = replace(experiment(1), cut_length_mm=1.0)
    peak = plan_cut(job, machine, Strategy.NONE).checked.peak_velocity[1]
    variables = {**machine.controller.variables, "I116": 1.055 * peak}
    limited = replace(machine, controller=replace(machine.controller, variables=variables))
    band = bounds(experiment, limited, Strategy.NONE)
    assert (band.high_percent, band.high_by) == (105, "program_speed")


def test_without_an_inverse_the_band_is_widest_and_without_an_axis_there_is_none(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    band = bounds(experiment, machine, Strategy.NONE)
    assert (band.low_percent, band.low_by) == (80, "widest")
    for strategy, lathe in ((Strategy.TIMEBASE, machine), (Strategy.CAM, with_inverter(machine))):
        assert bounds(experiment, lathe, strategy).refusal_code(Adjustable.OVERRIDE) == "cut.no_override"


def polls(*percents: float) -> list[Snapshot]:
    """One poll a second, with the carriage at the part from the second on."""
    return [
        seen(float(number), percent=percent, carriage=state(100.0 * number))
        for number, percent in enumerate(percents)
    ]


def test_the_time_of_the_program_is_that_of_the_override() -> None:
    """A second at 100 %, one on the way to 80 %, two at 80 %: 1 + 0.9 + 0.8 + 0.8 s of the program."""
    ledger = PaceLedger(face_counts=50.0)
    times = [ledger.see(poll).at_s for poll in polls(100.0, 100.0, 80.0, 80.0, 80.0)]
    assert times == pytest.approx([0.0, 1.0, 1.9, 2.7, 3.5])
    assert ledger.mean == pytest.approx(3.5 / 4.0)
    ledger = PaceLedger(face_counts=50.0)
    assert all(ledger.see(poll) is poll for poll in polls(100.0, 100.0, 100.0))
    assert ledger.mean == 1.0


def test_the_slowest_cut_ends_within_the_promise_of_the_heartbeat(machine: MachineProfile) -> None:
    """Its program takes 1.25 times as long for the turn and the way out; the timers of the controller do not."""
    host = host_of(machine, PMAC)
    begin_cut(host, cut_program(leased_loop(PMAC)))
    host.card.tell("&1%80")
    out_s = host.until(lambda: host.place(TOOL) < SURFACE + 500)
    assert out_s <= 0.3 + 1.25 * (TURN_MS + 10 + 5 + 200 + 195 - 88) / 1000.0 + 0.005
    assert host.until(host.still) <= 2.0
    assert host.place(TOOL) == pytest.approx(SURFACE, abs=20)
    assert values(host.card, "M26 P1003 P1004") == [1, 0, 2]


def test_an_override_that_was_commanded_has_two_seconds_to_arrive() -> None:
    """On its way it may be anywhere between; what is elsewhere, or not there by then, is not of this console."""
    free = SimpleNamespace(check=lambda: None, refuse_unless_owner=lambda: None, request=lambda *_: [])
    override = FeedOverride(cast(Any, free), cast(Any, free), cast(Any, free))

    def expected(at_s: float, percent: float) -> tuple[float, float]:
        return override.expected_range(seen(at_s, percent=percent))

    assert expected(0.0, 100.0) == (100.0, 100.0)
    override.command(80)
    assert expected(0.1, 97.0) == expected(1.9, 97.0) == (80.0, 100.0)
    assert expected(2.1, 97.0) == (80.0, 80.0)
    override.command(110)
    assert expected(2.2, 97.0) == (97.0, 110.0)
    assert expected(2.5, 110.0) == expected(2.6, 100.0) == (110.0, 110.0), "it has arrived"


# A part that is a shell: its lobe is that of its own jaws, and round along the cut only where the path follows.


def shell(machine: MachineProfile) -> TrueParameters:
    return replace(ideal(machine), jaw_stiffness=300.0, jaw_open_fraction=0.05)


def test_a_shell_has_its_lobe_along_the_part_from_its_own_jaws(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    """Over mid-cut 1.17 to 1.22 at 22 mm, 0.83 to 0.89 at 30: by a solid, and by three jaws that hold."""
    sim = SimulatedLathe(machine, shell(machine))
    sim.mount(replace(experiment(1), cut_length_mm=8.0))
    lobes_um = [float(np.ptp(sim.measure(past_mm).deviation_um)) for past_mm in (-3.6, -1.0, 0.0, 1.0, 3.6)]
    assert lobes_um[2] == pytest.approx(55.0, abs=1e-6)
    assert 0.80 < lobes_um[0] / 55.0 < 0.91
    assert 1.13 < lobes_um[4] / 55.0 < 1.24
    assert np.diff(lobes_um).min() > 0.0
    with pytest.raises(ValueError, match=r"the surface is kept from -3\.6 to 3\.6 mm"):
        sim.measure(3.7)


def test_a_lathe_of_one_lobe_keeps_it_along_the_part(machine: MachineProfile, experiment: JobMaker) -> None:
    sim = SimulatedLathe(machine)
    sim.mount(replace(experiment(1), cut_length_mm=8.0))
    for past_mm in (-3.6, 0.0, 3.6):
        assert float(np.ptp(sim.measure(past_mm).deviation_um)) == pytest.approx(55.0, abs=1e-6)


def test_the_mean_of_a_part_that_bends_is_larger_at_its_free_end(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    """P a^3 / (3 E I) of the tube 52 x 2.5 under 3 N, 30 mm from the jaws."""
    true = shell(machine)
    job = experiment(1)
    second_mm4 = np.pi / 64.0 * (52.0**4 - 47.0**4)
    assert true.beam_per_n_mm2(job) == pytest.approx(1.0 / (3.0 * 70_000.0 * second_mm4))
    process = replace(true.process(job, true.blank(job), 30.0), jaw_face_mm=30.0)
    turns, depth_mm = np.array([0.0]), np.array([0.1])
    at_end, at_jaws = (float(process.left_mm(turns, depth_mm, z)[0]) for z in (0.0, 30.0))
    assert at_jaws == 0.0
    assert at_end == pytest.approx(3.0 * 30.0**3 * true.beam_per_n_mm2(job), rel=0.02)


@pytest.mark.long
@pytest.mark.parametrize("strategy", [Strategy.CAM, Strategy.PVT])
def test_a_path_of_one_height_leaves_the_ends_off(
    machine: MachineProfile, experiment: JobMaker, strategy: Strategy
) -> None:
    """0.4 of the cut from its middle: some um p-p remain without, and 2 um of model error with it."""
    left_um: dict[str, list[float]] = {}
    for along in ("one", "shell"):
        lathe = replace(machine, chuck=replace(machine.chuck, lobe_along=along))
        floor = CutFloor(replace(experiment(1), cut_length_mm=8.0), lathe, strategy, shell(machine))
        floor.cut()
        traces = [floor.card.sim.measure(past_mm) for past_mm in (-3.2, 0.0, 3.2)]
        left_um[along] = [evaluate(each.angle_deg, each.deviation_um, None).ront_um for each in traces]
    assert min(left_um["one"][0], left_um["one"][2]) > 6.0
    assert max(left_um["shell"][0], left_um["shell"][2]) < 2.0
    assert max(left_um["one"][1], left_um["shell"][1]) < 0.5


def test_sections_are_of_one_placement_on_the_gauge(machine: MachineProfile, experiment: JobMaker) -> None:
    """The same eccentricity and the same turn of the part in all; the middle one is what `measure` shows."""
    true = replace(shell(machine), gauge_eccentricity_um=5.0, gauge_mark_sd_deg=2.0, seed=3)
    sim = SimulatedLathe(machine, true)
    sim.mount(replace(experiment(1), cut_length_mm=8.0))
    with pytest.raises(RuntimeError):
        sim.sections()
    trace, sections = sim.measure(), sim.sections()
    assert [each.z_mm for each in sections] == pytest.approx([22.8, 24.4, 26.0, 27.6, 29.2])
    assert sections[2].deviation_um == pytest.approx(trace.deviation_um, abs=1e-9)
    once = [np.fft.rfft(each.deviation_um)[1] / 1800.0 for each in sections]
    assert np.abs(once) == pytest.approx(np.full(5, 5.0), abs=1e-6)
    assert np.angle(once) == pytest.approx(np.full(5, np.angle(once[0])), abs=1e-6)
    lobes = np.array([abs(np.fft.rfft(each.deviation_um)[3]) / 1800.0 for each in sections])
    assert (np.diff(lobes) < 0.0).all(), "from the jaws to the free end"
