"""The lobe of a part becomes the error of its job: where it stands on the spindle, and under which conditions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from profiles.calibration.lobe import FoundLobe, find_lobe, with_lobe
from profiles.chucking.diagnosis import Mechanism
from profiles.job import Job
from profiles.lobe.lobe_conditions import unstated
from profiles.store import load_job
from profiles.traces import Trace

ASSUMED = load_job("lee-2001-experiment-1").job
"""Its jaw 1 stands at 90 deg, which is assumed."""
JOB = replace(ASSUMED, assumed=())
ANGLE = np.arange(720) / 2.0
INDEX = {"direction": "spindle", "start_mark": "spindle index"}
ROUND = {**INDEX, "units_checked": "yes"}  # as round as no lathe turns
SIMULATED = {**INDEX, "simulated": "yes", "strategy": "none"}


def found(phase_deg: float, meta: dict[str, str], job: Job = JOB, amplitude: float = 27.5) -> FoundLobe:
    deviation = amplitude * np.cos(3 * np.radians(ANGLE - phase_deg)) + 3.0 * np.cos(np.radians(ANGLE))
    noise = np.random.default_rng(1).normal(0.0, 0.02, ANGLE.size)
    return find_lobe(Trace(angle_deg=ANGLE, deviation_um=deviation + noise, meta=meta), job)


def codes(lobe: FoundLobe) -> list[str]:
    return [problem.code for problem in lobe.reasons]


@pytest.mark.parametrize(
    ("phase_deg", "meta", "expected", "past"),
    [
        (92.0, INDEX, 92.0, 2.0),
        (212.0, INDEX, 92.0, 2.0),
        (33.0, INDEX, 33.0, -57.0),
        (268.0, {**INDEX, "direction": "ccw"}, 92.0, 2.0),
        (2.0, {"direction": "cw", "jaw_1_deg": "0"}, 92.0, 2.0),
        (15.0, {"direction": "ccw", "jaw_1_deg": "20"}, 95.0, 5.0),
        (72.0, {**INDEX, "jaw_1_deg": "70"}, 72.0, 2.0),
    ],
)
def test_the_phase_is_brought_to_the_spindle(
    phase_deg: float, meta: dict[str, str], expected: float, past: float
) -> None:
    lobe = found(phase_deg, meta)
    assert (lobe.phase_deg, lobe.past_jaw_deg) == pytest.approx((expected, past), abs=0.01)
    assert codes(lobe) == []


def test_sizes_are_told_to_what_a_gauge_resolves() -> None:
    """A trace without any scatter has a confidence limit of some nanometres, and digits of those mean nothing."""
    (problem,) = found(92.0, ROUND, amplitude=0.0).reasons
    assert (problem.code, problem.limit) == ("lobe.not_significant", "< 0.01 um")


def test_a_trace_of_unknown_phase_has_an_amplitude_only() -> None:
    direction = "# direction: spindle | cw | ccw"
    mark = "# start_mark: spindle index | jaw 1 (or # jaw_1_deg: NUMBER)"
    metas: tuple[tuple[dict[str, str], str], ...] = (
        ({}, f"{direction}, {mark}"),
        ({"direction": "cw"}, mark),
        ({"direction": "cw", "start_mark": "unknown"}, mark),
        ({"jaw_1_deg": "0"}, direction),
        ({"start_mark": "jaw 1"}, direction),
        ({"start_mark": "spindle index"}, direction),
    )
    for meta, missing in metas:
        lobe = found(92.0, meta)
        assert (codes(lobe), lobe.phase_deg) == (["lobe.phase_unknown"], None)
        assert lobe.reasons[0].limit == missing
        assert lobe.fit.error_um_pp == pytest.approx(55.0, abs=0.02)
        with pytest.raises(ValueError):
            with_lobe(JOB, lobe, chuck="", tool="")


@pytest.mark.parametrize(("radius_mm", "size"), [(17.4, "absolute"), (51.8, "absolute"), (17.4, "relative")])
def test_a_trace_of_a_part_of_another_size_is_not_of_this_job(radius_mm: float, size: str) -> None:
    """A smaller part, or a diameter in place of a radius."""
    (told,) = found(92.0, {**INDEX, "radius_mm": str(radius_mm), "size": size}).reasons
    code = "lobe.diameter_stated" if radius_mm == 51.8 else "lobe.other_size"
    assert (told.code, told.key) == (code, "radius_mm")
    assert told.limit == f"{JOB.finished_radius_mm:.3f} mm"


def test_its_own_size_is_no_reason_against_it() -> None:
    assert codes(found(92.0, {**INDEX, "radius_mm": f"{JOB.finished_radius_mm + 0.4}"})) == []


def test_other_reasons_against_it() -> None:
    assert codes(found(92.0, {**INDEX, "state": "clamped"})) == ["lobe.not_free"]
    assert codes(found(92.0, {**INDEX, "method": "v_block"})) == ["lobe.method"]
    assert codes(found(92.0, ROUND, amplitude=0.0)) == ["lobe.not_significant"]
    filtered = found(92.0, {**INDEX, "filter_upr": "15"})
    assert [(problem.code, problem.value) for problem in filtered.warnings] == [("lobe.filtered", "2.7 %")]


@pytest.mark.parametrize(
    ("said", "code"),
    [
        ({"strategy": "none", "compensation": "none", "stage": "full"}, None),
        ({"strategy": "cam", "compensation": "none", "stage": "full"}, "lobe.compensated"),
        ({"compensation": "3"}, "lobe.compensated"),
        ({"simulated": "yes", "strategy": "none"}, "lobe.simulated"),
    ],
)
def test_only_an_uncompensated_part_that_somebody_cut_has_the_lobe(said: dict[str, str], code: str | None) -> None:
    lobe = found(92.0, {**INDEX, **said})
    assert codes(lobe) == ([code] if code else [])
    assert lobe.fit.error_um_pp == pytest.approx(55.0, abs=0.02)


def test_the_source_of_a_job_says_that_its_lobe_is_for_practice() -> None:
    simulated = Trace(angle_deg=ANGLE, deviation_um=27.5 * np.cos(3 * np.radians(ANGLE)), meta=SIMULATED)
    job = replace(JOB, source="Table 6; Fig 14")
    practice = find_lobe(simulated, job, practice=True)
    for _ in range(2):
        job = with_lobe(job, practice, chuck="", tool="")
        assert job.source == "Table 6; Fig 14; lobe of a simulated part, for practice"
    assert with_lobe(job, found(92.0, INDEX), chuck="", tool="").source == "Table 6; Fig 14"


@pytest.mark.parametrize(
    ("past_deg", "wall_mm", "mechanism"),
    [
        (5.0, 2.5, Mechanism.SPRING_BACK),
        (60.0, 2.5, Mechanism.WALL),
        (30.0, 2.5, None),
        (0.0, 26.0, Mechanism.CONTACT),
    ],
)
def test_where_the_part_is_high_says_what_has_made_the_lobe(
    past_deg: float, wall_mm: float, mechanism: Mechanism | None
) -> None:
    seen = found(90.0 + past_deg, INDEX, replace(JOB, wall_thickness_mm=wall_mm)).diagnosis
    assert seen is not None and seen.mechanism is mechanism
    assert found(90.0, INDEX, ASSUMED).diagnosis is None  # nobody knows where jaw 1 was


def test_the_job_gets_the_lobe_with_the_conditions_of_its_cut() -> None:
    job = with_lobe(JOB, found(92.0, INDEX), chuck="3-jaw 160", tool="")
    assert (job.lobe_error_um_pp, job.lobe_phase_deg) == pytest.approx((55.0, 92.0), abs=0.02)
    assert (job.lobe_error_source, job.lobe_chuck, job.lobe_tool) == ("fitted", "3-jaw 160", None)
    assert job.jaw_1_deg == pytest.approx(90.0)
    assert unstated(job) == ("lobe_tool",)  # the machine has no name for its tool
    again = with_lobe(job, found(92.0, INDEX, job), chuck="3-jaw 160", tool="")
    assert again.jaw_1_deg == pytest.approx(90.0)  # calibrated twice, jaw 1 has not moved


def test_what_was_assumed_stays_assumed() -> None:
    by_index = with_lobe(ASSUMED, found(92.0, INDEX, ASSUMED), chuck="", tool="")
    assert {"lobe_force_n", "chucking_force_n"} <= set(by_index.assumed)
    assert not {"lobe_phase_deg", "lobe_spindle_speed_rpm", "lobe_error_um_pp"} & set(by_index.assumed)
    assert by_index.lobe_past_jaw_deg is None  # nobody knows where jaw 1 was
    later = found(92.0, INDEX, by_index)
    assert later.past_jaw_deg is None
    by_jaw = with_lobe(ASSUMED, found(2.0, {"direction": "cw", "jaw_1_deg": "0"}, ASSUMED), chuck="", tool="")
    assert "lobe_phase_deg" in by_jaw.assumed and by_jaw.lobe_past_jaw_deg == pytest.approx(2.0, abs=0.01)


def test_where_a_part_sits_is_told_of_two_jaws() -> None:
    """Off the axis by 500 um a ring of 52 mm shows two waves a turn of 4.8 um, which is no lobe of two jaws."""
    job = replace(JOB, jaws=2)
    for e, told in ((500.0, ["lobe.off_axis"]), (50.0, [])):
        deviation = 27.5 * np.cos(2 * np.radians(ANGLE)) + e * np.cos(np.radians(ANGLE))
        off_axis = find_lobe(Trace(angle_deg=ANGLE, deviation_um=deviation, meta=INDEX), job)
        assert [problem.code for problem in off_axis.warnings] == told
