"""What a program leaves is predicted over the whole part: its checked motion against the lobe of a shell."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from drivers.cutting.planning import plan_cut
from drivers.cutting.strategy import Strategy
from drivers.preview.preview import predict_whole, with_lobe
from drivers.preview.program_prediction import SurfacePrediction
from profiles.axis.servo import sampled_response
from profiles.compensations.path import AxialTerm, CutPath, PathHarmonic, free_state_lobe, target_path
from profiles.machine import ONE_LOBE, MachineProfile
from profiles.store import load_job, load_machine

JOB, LATHE = load_job("lee-2001-experiment-1").job, load_machine("lee-2001-lathe").machine
SECOND = load_job("lee-2001-experiment-2").job
# f of a shell by an independent solution, held straight, at sixths of 30 mm; the cut begins at 22 mm.
SIXTHS_MM, STRAIGHT_F = (15.0, 20.0, 25.0, 30.0), (0.595, 0.477, 0.387, 0.332)


def held(straight: float) -> MachineProfile:
    return replace(LATHE, chuck=replace(LATHE.chuck, jaw_straight_fraction=straight))


@cache
def left(strategy: Strategy, number: int = 1, straight: float | None = None) -> SurfacePrediction:
    job, machine = (JOB, SECOND)[number - 1], LATHE if straight is None else held(straight)
    surface = predict_whole(job, machine, plan_cut(job, machine, strategy)).surface
    assert surface is not None
    return surface


def test_a_plain_cut_leaves_the_lobe_of_the_shell_at_each_place() -> None:
    surface = left(Strategy.NONE, straight=1.0)
    shell = np.interp(surface.z_mm, SIXTHS_MM, STRAIGHT_F) / np.interp(26.0, SIXTHS_MM, STRAIGHT_F)
    assert surface.ront_um == pytest.approx(55.0 * shell, abs=1.5)
    assert (surface.z_mm[0], surface.z_mm[-1]) == pytest.approx((22.2, 29.8))
    assert surface.z_mm[surface.worst] == surface.z_mm[0]


@pytest.mark.parametrize("strategy", [Strategy.PVT, Strategy.CAM, Strategy.TIMEBASE])
@pytest.mark.parametrize(("number", "most_um"), [(1, 0.6), (2, 1.5)])
def test_a_path_that_follows_the_lobe_along_leaves_little_anywhere(
    strategy: Strategy, number: int, most_um: float
) -> None:
    """What is left is the land: over its 0.4 mm the amplitude changes by 1.4 um (experiment 2, 2.2)."""
    surface = left(strategy, number)
    assert surface.ront_um.max() < most_um
    assert np.abs(surface.mean_um).max() < 0.2


def test_one_amplitude_leaves_the_change_of_the_lobe_at_the_ends() -> None:
    """The printed program keeps 0.65702 of its stroke, through the loop at 25 Hz; at each Z from another lobe."""
    surface, made = left(Strategy.PAPER), 0.65702 * complex(sampled_response(LATHE, 25.0))
    factor = left(Strategy.NONE).ront_um / 55.0
    assert surface.ront_um == pytest.approx(55.0 * np.abs(factor - made), rel=0.02)
    assert surface.ront_um.max() - surface.ront_um.min() > 15.0


def test_the_path_is_that_of_the_program_and_the_lobe_that_of_the_part() -> None:
    """Planned for straight jaws and cut in even ones, it leaves at each place what the two shells are apart."""
    surface = predict_whole(JOB, held(0.0), plan_cut(JOB, held(1.0), Strategy.PVT)).surface
    assert surface is not None
    apart_um = left(Strategy.NONE, straight=0.0).ront_um - left(Strategy.NONE, straight=1.0).ront_um
    assert surface.ront_um == pytest.approx(np.abs(apart_um), abs=0.8)
    assert surface.ront_um.max() > 15.0


def test_where_the_chuck_presses_one_lobe_all_sections_are_alike() -> None:
    even = replace(LATHE, chuck=replace(LATHE.chuck, lobe_along=ONE_LOBE))
    for strategy, left_um in ((Strategy.PVT, 0.05), (Strategy.PAPER, 28.1), (Strategy.NONE, 55.0)):
        made = predict_whole(JOB, even, plan_cut(JOB, even, strategy))
        assert made.surface is not None
        assert made.surface.ront_um == pytest.approx(left_um, abs=0.1)
        assert made.surface.ront_um == pytest.approx(made.ront_um, abs=0.1)


def test_the_push_of_the_cut_and_the_path_against_it_cancel() -> None:
    pushed = replace(LATHE, tool=replace(LATHE.tool, passive_force_fraction=0.5))
    plan = plan_cut(JOB, pushed, Strategy.PVT)
    assert plan.command.push_um > 1.0
    surface, plain = predict_whole(JOB, pushed, plan).surface, left(Strategy.PVT)
    assert surface is not None
    assert surface.mean_um == pytest.approx(plain.mean_um, abs=0.05 * plan.command.push_um)
    assert surface.ront_um == pytest.approx(plain.ront_um, abs=0.05 * plan.command.push_um)


def test_the_lobe_of_a_measured_part_takes_the_place_of_that_of_the_job() -> None:
    """Of a part whose lobe is 4 um more, a path without that leaves 8 um p-p mid-cut, more towards the jaws."""
    found = free_state_lobe(JOB).plus({3: PathHarmonic(lobes=3, amplitude_um=4.0, phase_deg=90.0).coefficient})
    surface = with_lobe(left(Strategy.PVT), found, JOB)
    factor = left(Strategy.NONE).ront_um / 55.0
    assert surface.ront_um == pytest.approx(8.0 * factor, abs=0.5)


def test_a_part_that_taught_a_slope_is_left_round_by_the_path_that_has_it() -> None:
    """4 um of slope in the lobe and 3 in the mean, learned: planned into the path, and the part has them."""
    slope = (AxialTerm(lobes=0, power=1, cos_um=3.0), AxialTerm(lobes=3, power=1, cos_um=4.0))
    model = plan_cut(JOB, LATHE, Strategy.CAM)
    target = replace(model.target, axial=slope)
    gain = 1.0 / complex(sampled_response(LATHE, 50.0))
    turned = 4.0 * gain
    command = replace(
        model.command,
        axial=(slope[0], AxialTerm(lobes=3, power=1, cos_um=turned.real, sin_um=-turned.imag)),
    )
    made = plan_cut(JOB, LATHE, Strategy.CAM, path=CutPath(target=target, command=command))
    of_model = predict_whole(JOB, LATHE, made).surface
    assert of_model is not None
    assert of_model.ront_um.max() > 6.0
    surface = with_lobe(of_model, target, JOB)
    assert surface.ront_um.max() < 1.5
    assert np.abs(surface.mean_um).max() < 0.3


def test_half_of_a_path_leaves_half_of_the_lobe_everywhere() -> None:
    target, whole = target_path(JOB), plan_cut(JOB, LATHE, Strategy.PVT)
    half = CutPath(
        target=replace(target, amplitude_um=0.5 * target.amplitude_um),
        command=replace(whole.command, amplitude_um=0.5 * whole.command.amplitude_um),
    )
    surface = predict_whole(JOB, LATHE, plan_cut(JOB, LATHE, Strategy.PVT, path=half)).surface
    assert surface is not None
    assert surface.ront_um == pytest.approx(0.5 * left(Strategy.NONE).ront_um, abs=0.8)


def test_a_cut_in_air_has_no_surface() -> None:
    made = predict_whole(JOB, LATHE, plan_cut(JOB, LATHE, Strategy.NONE, air_mm=2.0))
    assert made.surface is None
