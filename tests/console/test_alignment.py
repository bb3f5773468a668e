"""Why an alignment is valid, or not any more."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from console.session.cut.alignment import (
    Alignment,
    AlignStep,
    JawAngle,
    TouchOff,
    aligned_job,
    aligned_machine,
    clamped,
    clamping_of,
    current_step,
    handed_over,
    jaw_found,
    observed,
    problems,
    step_problems,
    tables_told,
    unclamped,
)
from profiles.problem import Problem
from profiles.store import load_job, load_machine

JOB = load_job("lee-2001-experiment-1").job
COMPLETE = Alignment(
    settings=(),
    drives_on=True,
    homed=True,
    clamping=clamping_of(JOB, at="08:40"),
    jaw=JawAngle(angle_deg=41.36, jaws=3, at="08:45"),
    touch_off=TouchOff(zero_radius_mm=75.837, diameter_mm=52.0, at="08:47"),
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
    harder = replace(COMPLETE, clamping=clamping_of(job, at="08:40"))
    assert codes(harder, job) == ["rule.force_differs"]


OTHER_BLANKS = {"jaws": 2, "material": "S45C", "diameter_mm": 60.0, "wall_thickness_mm": 3.0, "overhang_mm": 25.0}


@pytest.mark.parametrize("key", OTHER_BLANKS)
def test_another_part_than_the_one_that_was_clamped_is_named(key: str) -> None:
    changed: dict[str, Any] = {key: OTHER_BLANKS[key]}
    found = step_problems(COMPLETE, AlignStep.CLAMP, replace(JOB, **changed))
    assert [(problem.code, problem.key) for problem in found] == [("alignment.clamped_otherwise", key)]


TWO_JAWS = replace(JOB, jaws=2)
LARGER = replace(JOB, diameter_mm=60.0)


def test_jaw_1_holds_for_the_jaws_that_it_was_found_with() -> None:
    (problem,) = step_problems(COMPLETE, AlignStep.JAW, TWO_JAWS)
    assert (problem.code, problem.value, problem.limit) == ("alignment.jaw_of_others", "3", "2")
    assert step_problems(COMPLETE, AlignStep.JAW, LARGER) == ()
    assert aligned_job(TWO_JAWS, COMPLETE).lobe_phase_deg == JOB.lobe_phase_deg


def test_the_touch_off_holds_for_the_diameter_that_it_was_taken_on() -> None:
    (problem,) = step_problems(COMPLETE, AlignStep.TOUCH_OFF, LARGER)
    assert (problem.code, problem.value) == ("alignment.touched_otherwise", "D 52.000 mm")
    assert problem.limit == "D 60.000 mm"
    assert step_problems(COMPLETE, AlignStep.TOUCH_OFF, TWO_JAWS) == ()
    # Where the tip is does not change with what is clamped.
    machine = load_machine("lee-2001-lathe").machine
    larger = clamped(COMPLETE, LARGER, "09:00")
    assert aligned_machine(machine, larger).tool.home_radius_mm == 75.837


@pytest.mark.parametrize(
    ("other", "steps"),
    [
        ({"machine": "its sister"}, [AlignStep.JAW, AlignStep.TOUCH_OFF]),
        ({"chuck": "soft jaws"}, [AlignStep.JAW]),
        ({"tool": "insert 2"}, [AlignStep.TOUCH_OFF]),
    ],
)
def test_another_chuck_tool_or_machine_takes_what_rests_on_it(
    other: dict[str, str], steps: list[AlignStep]
) -> None:
    now = replace(COMPLETE, on=replace(COMPLETE.on, **other))
    found = {step: [problem.code for problem in step_problems(now, step, JOB)] for step in AlignStep}
    assert {step: codes for step, codes in found.items() if codes} == {
        step: ["alignment.mounted_otherwise"] for step in steps
    }


def test_clamping_in_other_jaws_takes_jaw_1_for_good() -> None:
    """Another number of jaws is another mounting: with the first jaws back, jaw 1 is somewhere else."""
    there = clamped(COMPLETE, TWO_JAWS, "09:00")
    assert step_problems(there, AlignStep.CLAMP, TWO_JAWS) == ()
    back = clamped(there, JOB, "09:30")
    assert codes(back) == ["alignment.jaws_changed", "alignment.no_jaw"]
    assert next(problem.value for problem in step_problems(back, AlignStep.JAW, JOB)) == "09:00"
    found = jaw_found(back, 12.0, 3, "09:40")
    assert codes(found) == []
    assert codes(replace(found, jaw=None)) == ["alignment.no_jaw"]


def test_the_next_blank_of_the_same_job_keeps_jaw_1_and_the_touch_off() -> None:
    assert codes(clamped(unclamped(COMPLETE, "09:20"), JOB, "09:25")) == []


def test_an_open_chuck_that_the_controller_sees_holds_no_blank() -> None:
    after = observed(COMPLETE, drives_on=True, homed=True, at="09:20", chuck_open=True)
    assert codes(after) == ["alignment.unclamped", "alignment.no_clamping"]
    assert after.jaw is not None and after.touch_off is not None


def test_behind_another_console_nothing_is_aligned() -> None:
    after = handed_over(COMPLETE, "09:20")
    assert (after.clamping, after.jaw, after.touch_off) == (None, None, None)
    assert codes(after)[:2] == ["alignment.handed_over", "alignment.no_clamping"]


@pytest.mark.parametrize("stamp", ["clamping", "jaw", "touch_off"])
def test_behind_another_console_the_only_stamp_is_gone_as_well(stamp: str) -> None:
    after = handed_over(replace(Alignment(), **{stamp: getattr(COMPLETE, stamp)}), "09:20")
    assert (getattr(after, stamp), codes(after).count("alignment.handed_over")) == (None, 1)


def test_who_had_found_nothing_loses_nothing_to_another_console() -> None:
    assert handed_over(Alignment(), "09:20") == Alignment()


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


ON, HOLDS = Problem(code="cut.table_on", key="I51"), Problem(code="cut.table_holds", key="D:$46")


@pytest.mark.parametrize(
    ("tables", "homed", "codes"),
    [
        ((ON,), False, ["cut.table_on"]),
        ((ON, HOLDS), True, ["cut.table_on", "cut.table_holds"]),
        ((ON, HOLDS), False, ["cut.table_no_home"]),
        ((), False, []),
    ],
)
def test_a_table_that_adds_something_is_cleared_another_way_without_a_home(
    tables: tuple[Problem, ...], homed: bool, codes: list[str]
) -> None:
    """One that is only switched on adds nothing, and is switched off wherever the axes are."""
    assert [problem.code for problem in tables_told(tables, homed=homed)] == codes


def test_the_lobe_of_a_job_is_where_jaw_1_was_found_and_not_where_that_of_another_machine_was() -> None:
    """20 degrees behind a jaw at 350 is at 10."""
    job, jaw = (
        replace(JOB, lobe_phase_deg=77.0, lobe_past_jaw_deg=20.0),
        JawAngle(angle_deg=350.0, jaws=3, at="08:45"),
    )
    aligned = replace(COMPLETE, jaw=jaw)
    assert aligned_job(job, aligned).lobe_phase_deg == pytest.approx(10.0)
    assert aligned_job(replace(job, lobe_past_jaw_deg=None), aligned).lobe_phase_deg == pytest.approx(350.0)
    for without in (replace(aligned, jaw=None), replace(aligned, jaw=replace(jaw, jaws=4))):
        assert aligned_job(job, without) == job
