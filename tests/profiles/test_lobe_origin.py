"""Where the lobe of a job comes from: none yet, the model, or the part that its file states."""

from __future__ import annotations

from dataclasses import replace

import pytest

from profiles.job import Job
from profiles.lobe.lobe_origin import with_lobe_of, with_modelled_lobe, without_lobe
from profiles.lobe.prediction import predict
from profiles.problem import ProfileError
from profiles.store import load_job, load_machine

ONE = load_job("lee-2001-experiment-1").job
LATHE = load_machine("lee-2001-lathe").machine


def test_a_job_without_a_lobe_keeps_its_part_its_cut_and_jaw_1() -> None:
    bare = without_lobe(replace(ONE, lobe_past_jaw_deg=3.0))
    assert (bare.lobe_error_um_pp, bare.lobe_error_source, bare.jaw_1_deg) == (0.0, "none", 87.0)
    assert (bare.lobe_force_n, bare.lobe_chuck, bare.lobe_past_jaw_deg) == (None, None, None)
    assert (bare.diameter_mm, bare.chucking_force_n) == (ONE.diameter_mm, ONE.chucking_force_n)
    assert "lobe_phase_deg" in bare.assumed and "lobe_force_n" not in bare.assumed


def test_the_lobe_by_the_model_is_what_the_prediction_of_the_same_part_says() -> None:
    for overhang_mm in (12.0, 30.0, 60.0):
        job = replace(ONE, overhang_mm=overhang_mm)
        found = with_modelled_lobe(job, LATHE)
        said = predict(without_lobe(job), LATHE).cut
        assert found.lobe_error_um_pp == pytest.approx(said.um_pp, abs=0.0006)
        assert said.phase_deg is not None
        off_deg = (found.lobe_phase_deg - said.phase_deg + 60.0) % 120.0 - 60.0
        assert off_deg == pytest.approx(0.0, abs=0.001)
        assert (found.jaw_1_deg, found.lobe_error_source) == (job.jaw_1_deg, "model")


def test_a_bundled_lobe_by_the_model_is_that_of_the_model() -> None:
    for name in ("thin-ring-3-jaws", "thin-ring-6-jaws", "two-jaw-tube"):
        job = load_job(name).job
        assert with_modelled_lobe(job, LATHE).lobe_error_um_pp == pytest.approx(job.lobe_error_um_pp, abs=0.06)


@pytest.mark.parametrize(
    ("changed", "code"),
    [
        ({"material": "kryptonite"}, "rule.material_unknown"),
        ({"wall_thickness_mm": 40.0}, "rule.wall_over_radius"),
    ],
)
def test_a_part_that_the_model_does_not_know_has_no_lobe_by_it(changed: dict[str, object], code: str) -> None:
    job: Job = replace(ONE, **changed)  # type: ignore[arg-type]
    with pytest.raises(ProfileError) as raised:
        with_modelled_lobe(job, LATHE)
    assert code in [problem.code for problem in raised.value.problems]


def test_the_lobe_of_the_file_comes_back_with_its_conditions() -> None:
    changed = without_lobe(replace(ONE, chucking_force_n=900.0, assumed=("feed_mm_per_rev",)))
    again = with_lobe_of(changed, ONE)
    assert (again.lobe_error_um_pp, again.lobe_force_n, again.chucking_force_n) == (55.0, 1314.0, 900.0)
    assert "lobe_force_n" in again.assumed and "chucking_force_n" not in again.assumed
    unstated = replace(ONE, lobe_force_n=None)
    assert with_lobe_of(without_lobe(replace(unstated, chucking_force_n=900.0)), unstated).lobe_force_n == 1314.0
