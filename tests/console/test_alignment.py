"""Why an alignment is valid, or not any more."""

from __future__ import annotations

from dataclasses import replace

import pytest

from console.session.alignment import (
    Alignment,
    AlignStep,
    Clamping,
    JawAngle,
    TouchOff,
    aligned_job,
    aligned_machine,
    current_step,
    observed,
    problems,
    unclamped,
)
from profiles.problem import Problem
from profiles.store import load_job, load_machine

JOB = load_job("lee-2001-experiment-1").job
COMPLETE = Alignment(
    settings=(),
    drives_on=True,
    homed=True,
    clamping=Clamping(force_n=1314.0, diameter_mm=52.0, overhang_mm=30.0, at="08:40"),
    jaw=JawAngle(angle_deg=41.36, at="08:45"),
    touch_off=TouchOff(zero_radius_mm=75.837, at="08:47"),
)


def codes(alignment: Alignment, job: object = JOB) -> list[str]:
    return [problem.code for problem in problems(alignment, job)]  # type: ignore[arg-type]


def test_a_complete_alignment_is_valid() -> None:
    assert codes(COMPLETE) == [] and current_step(COMPLETE, JOB) is None


def test_nothing_known_begins_with_the_controller() -> None:
    assert current_step(Alignment(), JOB) is AlignStep.VERIFY


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"settings": None}, "alignment.not_verified"),
        ({"settings": (Problem(code="controller.setting"),)}, "controller.setting"),
        ({"clamping": None}, "alignment.no_clamping"),
        ({"drives_on": False}, "alignment.drives_off"),
        ({"homed": False}, "alignment.not_homed"),
        ({"jaw": None}, "alignment.no_jaw"),
        ({"touch_off": None}, "alignment.no_touch_off"),
    ],
)
def test_each_missing_stamp_is_named(change: dict[str, object], code: str) -> None:
    assert codes(replace(COMPLETE, **change)) == [code]  # type: ignore[arg-type]


def test_another_force_than_the_one_that_was_clamped_is_named() -> None:
    harder = replace(JOB, chucking_force_n=1400.0, lobe_force_n=1400.0)
    assert codes(COMPLETE, harder) == ["alignment.clamped_otherwise"]


def test_a_force_that_the_error_was_not_found_at_is_named() -> None:
    job = replace(JOB, chucking_force_n=1400.0)
    clamped = replace(COMPLETE, clamping=Clamping(force_n=1400.0, diameter_mm=52.0, overhang_mm=30.0, at="08:40"))
    assert codes(clamped, job) == ["rule.force_differs"]


def test_another_part_than_the_one_that_was_clamped_is_named() -> None:
    assert codes(COMPLETE, replace(JOB, diameter_mm=50.0)) == ["alignment.clamped_otherwise"]


def test_lost_zeros_take_jaw_and_touch_off_with_them_and_say_when() -> None:
    after = observed(COMPLETE, drives_on=True, homed=False, at="09:10")
    assert (after.jaw, after.touch_off) == (None, None)
    assert "alignment.home_lost" in codes(after)
    assert [problem.value for problem in after.lost] == ["09:10"]


def test_drives_off_loses_no_stamp() -> None:
    after = observed(COMPLETE, drives_on=False, homed=True, at="09:10")
    assert codes(after) == ["alignment.drives_off"]


def test_an_opened_chuck_keeps_jaw_and_touch_off() -> None:
    after = unclamped(COMPLETE, "09:20")
    assert codes(after) == ["alignment.unclamped", "alignment.no_clamping"]
    assert after.jaw == COMPLETE.jaw and after.touch_off == COMPLETE.touch_off


def test_what_was_found_replaces_what_was_assumed() -> None:
    machine = load_machine("lee-2001-lathe").machine
    assert aligned_job(JOB, COMPLETE).lobe_phase_deg == 41.36
    assert aligned_job(JOB, Alignment()).lobe_phase_deg == JOB.lobe_phase_deg
    assert aligned_machine(machine, COMPLETE).tool.home_radius_mm == 75.837
    assert aligned_machine(machine, Alignment()) is machine
