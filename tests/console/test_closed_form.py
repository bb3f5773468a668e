"""What is shown before a program is there: the same that the program says afterwards, by arithmetic alone."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest

from drivers.cutting.planning import Strategy
from drivers.cutting.strategy import INVERTING
from drivers.identification.nominal import path_response
from drivers.preview.outlook import outlook
from drivers.preview.preview import closed_form, preview
from profiles.axis.servo import sampled_response
from profiles.compensations.path import CutPath, PathHarmonic
from profiles.problem import ProblemError
from profiles.store import load_job, load_machine

MACHINE = load_machine("lee-2001-lathe").machine
JOB = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=1.0)

# A lathe that is not as its profile says: 10 % more mass and 10 % less thrust.
TRUE = replace(
    MACHINE,
    tool=replace(
        MACHINE.tool,
        moving_mass_kg=1.1 * MACHINE.tool.moving_mass_kg,
        amplifier_gain_a_per_v=0.9 * MACHINE.tool.amplifier_gain_a_per_v,
    ),
)


@pytest.mark.parametrize("strategy", [*INVERTING, Strategy.NONE])
def test_the_closed_form_says_what_the_program_says_afterwards(strategy: Strategy) -> None:
    """The second method: the program, walked through move by move, and its spectrum through the sampled loop."""
    seen = preview(JOB, MACHINE, strategy)
    early, made = closed_form(outlook(JOB, MACHINE, strategy), strategy), seen.predictions[strategy]
    assert early is not None
    assert float(np.ptp(early.residual_um)) == pytest.approx(made.ront_um, abs=0.05)
    assert early.stroke_um == pytest.approx(made.stroke_um, abs=0.05)
    command_um = np.interp(early.angle_deg, made.angle_deg, made.command_um, period=360.0)
    # Both know the late servo cycle, 4.3 um; what is left are chords of the table and a time base in whole parts.
    assert np.abs(early.command_um - command_um).max() < 0.5
    assert early.lobe_frequency_hz == pytest.approx(made.lobe_frequency_hz)
    assert early.response.gain == pytest.approx(made.response.gain)
    assert early.demands["force_n"].percent == pytest.approx(made.demands["force_n"].percent, rel=0.01)


def test_an_inverse_of_another_axis_leaves_what_the_two_responses_are_apart() -> None:
    """E |1 - T / T_hat|: 9.1 um of 55 for a lathe with 10 % more mass and 10 % less thrust."""
    true, known = (complex(sampled_response(machine, 50.0)) for machine in (TRUE, MACHINE))
    seen = outlook(JOB, TRUE, Strategy.PVT, path_response(Strategy.PVT, MACHINE))
    early = closed_form(seen, Strategy.PVT)
    assert early is not None
    assert float(np.ptp(early.residual_um)) == pytest.approx(55.0 * abs(1.0 - true / known), abs=0.05)
    assert float(np.ptp(early.residual_um)) == pytest.approx(9.1, abs=0.2)


def test_what_only_a_program_can_say_is_not_guessed() -> None:
    seen = outlook(JOB, MACHINE, Strategy.CAM)
    assert closed_form(seen, Strategy.PAPER) is None
    # Its command would be another one than that of the strategy that was chosen.
    assert closed_form(seen, Strategy.PVT) is None


def test_a_learned_path_is_what_everything_is_of() -> None:
    """One wave more in the command, of 2 um: what it leaves is that wave as the loop answers to it."""
    model = outlook(JOB, MACHINE, Strategy.CAM)
    path = CutPath(target=model.target, command=model.command.plus({6: 2.0 + 0.0j}))
    seen = preview(JOB, MACHINE, Strategy.CAM, path=path)
    early = closed_form(outlook(JOB, MACHINE, Strategy.CAM, path=path), Strategy.CAM)
    assert early is not None
    assert seen.command == path.command
    delay_s = MACHINE.controller.servo_period_ms / 1000.0
    answer = complex(sampled_response(MACHINE, 100.0)) * cmath.exp(-2j * math.pi * 100.0 * delay_s)
    extra = PathHarmonic.of(6, -2.0 * answer).at_um(early.angle_deg)
    assert early.residual_um == pytest.approx(extra, abs=1e-6)
    assert seen.predictions[Strategy.CAM].ront_um == pytest.approx(float(np.ptp(extra)), abs=0.1)
    # The others are of the model, as they were.
    assert seen.predictions[Strategy.TIMEBASE].ront_um < 0.1
    with pytest.raises(ProblemError) as refused:
        raise preview(JOB, MACHINE, Strategy.PVT, path=path).strategies[Strategy.PVT]  # type: ignore[misc]
    assert [problem.code for problem in refused.value.problems] == ["program.no_overtones"]


@pytest.mark.parametrize(("depth_mm", "error_um"), [(0.02, 55.0), (0.1, 300.0)])
def test_a_tool_that_leaves_the_part_leaves_what_it_does_not_reach(depth_mm: float, error_um: float) -> None:
    """Round where it is clamped, the part keeps all of the lobe where the path is out of it: A - depth of A."""
    job = replace(JOB, depth_of_cut_mm=depth_mm, lobe_error_um_pp=error_um)
    out_um = error_um / 2 - 1000 * depth_mm
    early = closed_form(outlook(job, MACHINE), Strategy.PVT)
    made = preview(job, MACHINE).predictions[Strategy.PVT]
    assert early is not None
    for left_um in (early.residual_um, made.residual_um):
        assert float(np.ptp(left_um)) == pytest.approx(out_um, abs=0.1)
        assert abs(float(np.mean(left_um))) < 1e-9
