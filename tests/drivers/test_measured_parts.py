"""From a job to a measured part, through the card, the servo and the workpiece: what the trace must show."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from drivers.cut import CutPlan, Strategy, plan_cut
from drivers.lathe import AxisName
from profiles.roundness import RoundnessResult, evaluate

if TYPE_CHECKING:
    from profiles.job import Job
    from profiles.machine import MachineProfile
    from tests.drivers.conftest import Bench, JobMaker


def cut(bench: Bench, job: Job, machine: MachineProfile, strategy: Strategy, ts_ms: int = 10) -> CutPlan:
    """Home, align, cut and withdraw, as the console does it."""
    plan = plan_cut(job, machine, strategy, ts_ms)
    lathe = bench.lathe
    lathe.enable()
    lathe.home()
    bench.sim.mount(job)
    lathe.load(plan.program)
    lathe.jog_to(AxisName.TOOL, plan.setup.retracted)
    lathe.jog_to(AxisName.CARRIAGE, plan.carriage_start)
    lathe.jog_to(AxisName.SPINDLE, plan.spindle_start)
    lathe.jog_to(AxisName.TOOL, plan.tool_start)
    lathe.start(plan.program.number)
    lathe.follow(lambda snapshot: None, timeout_s=2 * plan.duration_s)
    return plan


def measured(bench: Bench) -> RoundnessResult:
    trace = bench.sim.measure()
    return evaluate(trace.angle_deg, trace.deviation_um, None)


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


def test_another_chuck_lobe_phase_and_speed_do_what_they_say(
    bench: Bench, machine: MachineProfile, experiment: JobMaker
) -> None:
    job = replace(experiment(1), jaws=4, lobe_error_um_pp=21.0, lobe_phase_deg=33.0, spindle_speed_rpm=640.0)
    cut(bench, job, machine, Strategy.NONE)
    result = measured(bench)
    assert result.ront_um == pytest.approx(21.0, abs=0.3)
    assert result.amplitude_um(4) == pytest.approx(10.5, abs=0.02)
    assert result.amplitude_um(3) == pytest.approx(0, abs=0.02)
    assert next(h.phase_deg for h in result.harmonics if h.n == 4) == pytest.approx(33.0, abs=0.1)


@pytest.mark.parametrize(
    ("jaws", "phase_deg", "rpm"), [(3, 0.0, 1000.0), (3, 47.0, 1000.0), (4, 33.0, 640.0), (6, -100.0, 377.0)]
)
def test_the_inverse_leaves_less_than_a_micrometre_whatever_the_chuck(
    bench: Bench, machine: MachineProfile, experiment: JobMaker, jaws: int, phase_deg: float, rpm: float
) -> None:
    job = replace(experiment(1), jaws=jaws, lobe_phase_deg=phase_deg, spindle_speed_rpm=rpm)
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
