"""From a job to a measured part, through the card, the servo and the workpiece: what the trace must show."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.simulator.plant.true_parameters import ideal
from profiles.axis.servo import sampled_response
from profiles.roundness import RoundnessResult, evaluate
from tests.drivers.close_together import machine as machine
from tests.drivers.conftest import connected

if TYPE_CHECKING:
    from profiles.job import Job
    from profiles.machine import MachineProfile
    from tests.drivers.conftest import Bench, JobMaker, TrueBenchMaker


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


def test_the_paper_program_improves_the_part_by_what_is_left_of_its_stroke(
    bench: Bench, machine: MachineProfile, experiment: JobMaker
) -> None:
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
