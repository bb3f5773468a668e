"""Why an alignment is valid, or not any more: stamps hold for what they were found with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from console.session.cut.alignment import (
    Alignment,
    AlignStep,
    JawAngle,
    TouchOff,
    aligned_job,
    aligned_machine,
    clamp_blank,
    clamping_of,
    current_step,
    handed_over,
    jaw_found,
    observe_poll,
    problems,
    step_problems,
    tables_told,
    unclamp_blank,
)
from console.session.station.commands import (
    Approach,
    ConfirmClamping,
    DisableDrives,
    EnableDrives,
    Home,
    Jog,
    Retract,
    TakeJaw,
)
from console.session.station.jogging import tool_in_part
from drivers.lathe.snapshot import AxisName
from profiles.findings import refusals
from profiles.problem import Problem
from profiles.rules import check
from profiles.same_objects import SameObjects
from profiles.store import load_job, load_machine
from tests.console.floor import Floor, experiment_1, open_floor, refused_codes

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


def test_a_complete_alignment_is_valid_and_an_empty_one_begins_with_the_controller() -> None:
    assert codes(COMPLETE) == [] and current_step(COMPLETE, JOB) is None
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


def test_another_force_than_that_of_the_clamping_or_of_the_error_is_named() -> None:
    assert codes(COMPLETE, replace(JOB, chucking_force_n=1400.0, lobe_force_n=1400.0)) == [
        "alignment.clamped_otherwise"
    ]
    job = replace(JOB, chucking_force_n=1400.0)
    assert codes(replace(COMPLETE, clamping=clamping_of(job, at="08:40")), job) == ["rule.force_differs"]


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
    larger = clamp_blank(COMPLETE, LARGER, "09:00")
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
    there = clamp_blank(COMPLETE, TWO_JAWS, "09:00")
    assert step_problems(there, AlignStep.CLAMP, TWO_JAWS) == ()
    back = clamp_blank(there, JOB, "09:30")
    assert codes(back) == ["alignment.jaws_changed", "alignment.no_jaw"]
    assert next(problem.value for problem in step_problems(back, AlignStep.JAW, JOB)) == "09:00"
    found = jaw_found(back, 12.0, 3, "09:40")
    assert codes(found) == []
    assert codes(replace(found, jaw=None)) == ["alignment.no_jaw"]


def test_each_event_takes_what_rests_on_it_and_no_more() -> None:
    at = "09:20"
    assert codes(clamp_blank(unclamp_blank(COMPLETE, at), JOB, "09:25")) == [], "the next blank of the same job"
    assert codes(observe_poll(COMPLETE, drives_on=False, homed=True, at=at)) == ["alignment.drives_off"]
    by_sensor = observe_poll(COMPLETE, drives_on=True, homed=True, at=at, chuck_open=True)
    for opened in (by_sensor, unclamp_blank(COMPLETE, at)):
        assert codes(opened) == ["alignment.unclamped", "alignment.no_clamping"]
        assert (opened.jaw, opened.touch_off) == (COMPLETE.jaw, COMPLETE.touch_off)
    unhomed = observe_poll(COMPLETE, drives_on=True, homed=False, at=at)
    assert (unhomed.jaw, unhomed.touch_off, [problem.value for problem in unhomed.lost]) == (None, None, [at])
    assert "alignment.home_lost" in codes(unhomed)


def test_behind_another_console_nothing_is_aligned() -> None:
    after = handed_over(COMPLETE, "09:20")
    assert (after.clamping, after.jaw, after.touch_off) == (None, None, None)
    assert codes(after)[:2] == ["alignment.handed_over", "alignment.no_clamping"]
    for stamp in ("clamping", "jaw", "touch_off"):
        alone: dict[str, Any] = {stamp: getattr(COMPLETE, stamp)}
        after = handed_over(replace(Alignment(), **alone), "09:20")
        assert (getattr(after, stamp), codes(after).count("alignment.handed_over")) == (None, 1)
    assert handed_over(Alignment(), "09:20") == Alignment(), "who had found nothing loses nothing"


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
def test_a_table_is_cleared_otherwise_unhomed(tables: tuple[Problem, ...], homed: bool, codes: list[str]) -> None:
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


@pytest.fixture
def floor(tmp_path: Path) -> Floor:
    return open_floor(tmp_path)


@pytest.fixture
def aligned(floor: Floor) -> Floor:
    floor.set_up(experiment_1())
    return floor


def test_before_the_touch_off_the_tip_is_known_to_its_band_only(floor: Floor) -> None:
    """The tip is 1 mm from the surface by the profile, and a touch-off may find it 1.5 mm elsewhere."""
    job = experiment_1()
    floor.do(DisableDrives(), ConfirmClamping(job=job), EnableDrives(), Home(), Approach(job=job))
    machine = floor.context.loaded_machine.machine
    assert tool_in_part(floor.lathe.snapshot(), machine, floor.state.alignment) is False
    floor.infeed(1.0)
    assert tool_in_part(floor.lathe.snapshot(), machine, floor.state.alignment) is None


@pytest.mark.parametrize(
    ("homed", "code"), [(True, "alignment.drives_off"), (False, "machine.tool_unknown")], ids=["homed", "fresh"]
)
def test_a_retract_without_drives_says_what_is_known_of_the_tool(floor: Floor, homed: bool, code: str) -> None:
    floor.do(DisableDrives(), ConfirmClamping(job=experiment_1()))
    if homed:
        floor.do(EnableDrives(), Home(), DisableDrives())
    assert refused_codes(floor.do(Retract())) == [code]


def test_another_chuck_and_another_diameter_are_not_armed_on_the_stamps_of_before(aligned: Floor) -> None:
    """Experiment 1 is aligned; then one with 2 jaws of 50 mm is clamped, and experiment 1 again."""
    first = experiment_1()
    other = replace(first, jaws=2, diameter_mm=50.0, lobe_diameter_mm=50.0)
    aligned.do(Jog(axis=AxisName.CARRIAGE, distance=-10.0), DisableDrives(), ConfirmClamping(job=other))
    aligned.do(EnableDrives())
    refused = refused_codes(aligned.arm(other))
    assert refused == ["alignment.jaws_changed", "alignment.no_jaw", "alignment.touched_otherwise"]
    aligned.do(TakeJaw())
    jaw = aligned.state.alignment.jaw
    assert jaw is not None and jaw.jaws == 2
    assert refused_codes(aligned.arm(other)) == ["alignment.touched_otherwise"]
    aligned.do(DisableDrives(), ConfirmClamping(job=first), EnableDrives())
    # The touch-off was not taken anew, and is that of this diameter.
    assert refused_codes(aligned.arm(first)) == ["alignment.jaws_changed", "alignment.no_jaw"]


MACHINE = load_machine("lee-2001-lathe").machine


def test_keys_of_equal_objects_differ() -> None:
    alike = replace(JOB)
    assert alike == JOB and SameObjects(JOB, MACHINE) == SameObjects(JOB, MACHINE)
    assert SameObjects(alike, MACHINE) != SameObjects(JOB, MACHINE) != (JOB, MACHINE)
    assert len({SameObjects(JOB, MACHINE), SameObjects(JOB, MACHINE), SameObjects(alike, MACHINE)}) == 2


def test_a_job_or_a_machine_that_was_changed_is_judged_anew() -> None:
    good = check(JOB, MACHINE)
    assert check(JOB, MACHINE) is good and not refusals(good)
    fast = replace(JOB, spindle_speed_rpm=100.0 * JOB.spindle_speed_rpm)
    weak = replace(MACHINE, chuck=replace(MACHINE.chuck, max_force_n=100.0))
    for _ in range(2):
        assert refusals(check(fast, MACHINE)) and refusals(check(JOB, weak))
        assert check(JOB, MACHINE) == good
    for number in range(20):  # more than are kept
        assert check(replace(JOB, name=f"ring-{number}"), MACHINE) == good
    assert check(JOB, MACHINE) == good


def test_a_stamp_that_was_made_or_lost_is_seen_at_once() -> None:
    bare = Alignment()
    stamped = replace(bare, clamping=clamping_of(JOB, "08:40"))
    assert step_problems(bare, AlignStep.CLAMP, JOB) and not step_problems(stamped, AlignStep.CLAMP, JOB)
    thicker = replace(JOB, wall_thickness_mm=JOB.wall_thickness_mm + 1.0)
    assert step_problems(stamped, AlignStep.CLAMP, thicker)
    assert step_problems(bare, AlignStep.CLAMP, JOB) and len(problems(stamped, JOB)) < len(problems(bare, JOB))
