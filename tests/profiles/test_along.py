"""How the lobe and the mean change along a cut, by the shell of the prediction."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from drivers.cutting.planning import plan_cut
from drivers.cutting.strategy import Strategy
from profiles.compensations.path import AlongCut
from profiles.findings import Finding, Severity
from profiles.job import Job
from profiles.lobe.along import along_cut, holding_spread, oval_over_ring
from profiles.lobe.moving_out import moving_out_um
from profiles.lobe.prediction import predict
from profiles.problem import ProblemError
from profiles.rules import check
from profiles.store import load_job, load_machine

LATHE = load_machine("lee-2001-lathe").machine
ONE, TWO = (load_job(f"lee-2001-experiment-{number}").job for number in (1, 2))
FLANGE = replace(ONE, diameter_mm=123.0, wall_thickness_mm=3.0, overhang_mm=15.0, cut_length_mm=8.0)


@pytest.mark.parametrize("job", [ONE, TWO, FLANGE, replace(ONE, jaws=2)])
def test_the_polynomial_is_the_prediction_along_the_cut(job: Job) -> None:
    """Amplitude of order N and mean at eleven places, on the lobe that the job has mid-cut: within 0.1 um."""
    along, past_mm = along_cut(job, LATHE), np.linspace(-0.5, 0.5, 11) * job.cut_length_mm
    z_mm = np.clip(job.overhang_mm - job.cut_length_mm / 2.0 - past_mm, 0.0, job.overhang_mm)
    found = predict(replace(job, lobe_error_source="model"), LATHE, z_mm=z_mm)
    turns = np.exp(-1j * job.jaws * np.radians(found.angle_deg - job.jaw_1_deg))
    lobes = 2.0 * np.mean(found.error_um * turns, axis=1).real
    relative = lobes / lobes[5]
    assert job.lobe_amplitude_um * along.factor(job.jaws, past_mm) == pytest.approx(
        job.lobe_amplitude_um * relative, abs=0.1
    )
    assert along.further_um(past_mm) == pytest.approx(found.size_um - found.size_um[5], abs=0.1)


def test_over_the_cut_of_the_papers_parts_the_lobe_is_not_one_number() -> None:
    """Three jaws of 10 degrees that hold their sum straight: 0.386, 0.315 and 0.267 of that at the jaws."""
    ends_um = 55.0 * along_cut(ONE, LATHE).factor(3, [4.0, -4.0])
    assert ends_um[0] == pytest.approx(55.0 * 0.386 / 0.315, abs=2.0)
    assert ends_um[1] == pytest.approx(55.0 * 0.267 / 0.315, abs=2.0)


def test_there_is_no_change_where_nothing_is_known_of_it() -> None:
    bar = load_job("steel-bar-65").job
    one = replace(LATHE, chuck=replace(LATHE.chuck, lobe_along="one"))
    for job, lathe in ((bar, LATHE), (ONE, one), (replace(ONE, material="cheese"), LATHE)):
        assert along_cut(job, lathe) == AlongCut(half_length_mm=job.cut_length_mm / 2.0)
    # Where the lobe changes its sign mid-cut, any height fits what was found there: the mean alone is followed.
    changes = replace(ONE, overhang_mm=54.0)
    assert along_cut(changes, LATHE).orders == ()
    assert along_cut(changes, LATHE).mean_um != ()


LONG = replace(
    ONE,
    overhang_mm=60.0,
    cut_length_mm=56.0,
    depth_of_cut_mm=0.2,
    lobe_error_um_pp=33.0,
    lobe_error_source="model",
)


def found(job: Job, code: str) -> Finding:
    (told,) = [each for each in check(job, LATHE) if each.problem.code == code]
    return told


def broken(job: Job) -> list[str]:
    return [each.problem.code for each in check(job, LATHE) if each.severity is not Severity.OK]


def test_a_cut_whose_middle_has_no_lobe_is_told_with_the_lengths_that_pass_and_cannot_be_compensated() -> None:
    """Mid-cut the lobe of 18 mm at the end of 60 is at its change of sign: only a plain cut can be planned."""
    middle = replace(LONG, cut_length_mm=18.0)
    told = found(middle, "rule.along_middle")
    assert told.severity is Severity.WARNING
    lengths = [float(each) for each in re.findall(r"(\d+) mm", told.problem.limit)]
    assert len(lengths) == 2 and lengths[0] < 18.0 < lengths[1]
    for length_mm in lengths:
        passes = replace(middle, cut_length_mm=length_mm)
        assert "rule.along_middle" not in broken(passes)
        assert along_cut(passes, LATHE).orders != ()
    plan_cut(middle, LATHE, Strategy.NONE)
    for strategy in (Strategy.CAM, Strategy.PVT):
        with pytest.raises(ProblemError) as refused:
            plan_cut(middle, LATHE, strategy)
        assert refused.value.problems[0] == told.problem


def test_what_the_polynomial_leaves_is_told_in_um_with_a_length_that_passes() -> None:
    """By the model itself between the places of the fit, over the whole cut of 56 mm."""
    told = found(LONG, "rule.along_degree")
    assert told.severity is Severity.WARNING
    along, past_mm = along_cut(LONG, LATHE), np.linspace(-0.5, 0.5, 29) * LONG.cut_length_mm
    model = predict(LONG, LATHE, z_mm=LONG.overhang_mm - LONG.cut_length_mm / 2.0 - past_mm)
    assert told in model.findings
    turns = np.exp(-1j * LONG.jaws * np.radians(model.angle_deg - LONG.jaw_1_deg))
    lobes = 2.0 * np.mean(model.error_um * turns, axis=1).real
    off_um = LONG.lobe_amplitude_um * np.abs(along.factor(3, past_mm) - lobes / lobes[14])
    assert float(told.problem.value.removesuffix(" um")) == pytest.approx(off_um.max(), rel=0.5)
    (length,) = re.findall(r"\((\d+) mm\)", told.problem.limit)
    assert "rule.along_degree" not in broken(replace(LONG, cut_length_mm=float(length)))


def test_a_tool_that_would_trip_as_it_moves_out_is_told_with_what_passes() -> None:
    """In simulated cuts, with the limit raised, the tool was 167 um late on the table and 135 um with `pvt`."""
    told = found(LONG, "rule.moving_out")
    assert told.severity is Severity.WARNING
    assert float(told.problem.value.removesuffix(" um")) == pytest.approx(167.0, abs=10.0)
    assert float(told.problem.where.removesuffix(" um")) == pytest.approx(135.0, abs=15.0)
    limit, length = map(float, re.findall(r"([\d.]+) [um]+", told.problem.limit))
    assert limit == 150.0 > float(told.problem.where.removesuffix(" um"))
    assert "rule.moving_out" not in broken(replace(LONG, cut_length_mm=length))
    assert "rule.moving_out" in broken(replace(LONG, cut_length_mm=length + 1.0))


@pytest.mark.parametrize(
    ("name", "cut_um"),
    [
        ("lee-2001-experiment-1", 102.0),
        ("lee-2001-experiment-2", 93.0),
        ("thin-ring-3-jaws", 83.0),
        ("two-jaw-tube", 91.0),
    ],
)
def test_nothing_is_told_of_jobs_whose_tool_moves_out_below_the_limit(name: str, cut_um: float) -> None:
    """The largest following errors of simulated cuts with `cam`, a plant of 3 N of dry friction."""
    job = load_job(name).job
    assert "rule.moving_out" not in broken(job)
    assert moving_out_um(job, LATHE)[0] == pytest.approx(cut_um, abs=15.0)


def test_the_rules_judge_the_lobe_where_along_the_cut_it_is_largest() -> None:
    """4.8 times mid-cut at the jaws' side: a depth of 0.06 mm holds 16.5 um, and not 80."""
    assert found(replace(LONG, depth_of_cut_mm=0.06), "rule.depth_under_lobe").severity is Severity.REFUSAL
    fast = replace(LONG, lobe_error_um_pp=80.0, chucking_force_n=6500.0, spindle_speed_rpm=2800.0)
    limit = found(fast, "rule.tool_force").problem.limit
    (rpm,) = re.findall(r"\((\d+) rpm\)", limit)
    assert found(replace(fast, spindle_speed_rpm=float(rpm)), "rule.tool_force").severity is Severity.OK
    over = replace(fast, spindle_speed_rpm=float(rpm) + 1.0)
    assert found(over, "rule.tool_force").severity is Severity.REFUSAL


def test_an_oval_decays_more_slowly_than_the_lobe() -> None:
    """n = 2 and 3 of a shell at 26 of 30 mm: about 0.9 and 0.38 of that at the jaws."""
    assert oval_over_ring(ONE, LATHE) == pytest.approx(0.9 / 0.33, rel=0.15)
    assert oval_over_ring(replace(ONE, jaws=2), LATHE) == 1.0


def test_what_a_chuck_leaves_open_is_a_spread() -> None:
    """Straight jaws change the lobe least along the cut, even pressure most; the profile is between."""
    seen = holding_spread(ONE, LATHE)
    steep = [seen[way][0] - seen[way][1] for way in ("straight", "profile", "even")]
    assert steep == sorted(steep) and steep[2] > 2.0 * steep[0]
    assert holding_spread(load_job("steel-bar-65").job, LATHE) == {}
