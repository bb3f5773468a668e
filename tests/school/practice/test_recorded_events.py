"""An event is taken up at the moment before: what stands where, what comes when, what is said to differ."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from console.flight.recording import Recording
from console.school.practice.as_lesson import lesson_of_practice, lesson_text, steps_of
from console.school.practice.practice import Practice, practice_of
from console.school.practice.practice_start import likeness
from console.school.practice_lathe import machine_recorded, work_recorded
from console.school.training.event import LessonEvent
from console.school.training.lesson import lesson_of, load_lesson
from console.school.words.practice import lesson_words, practice_lines
from console.session.errors import SessionError
from console.session.station.commands import Home, Measure, Start
from console.session.station.handlers import begin_as
from console.session.station.progress import CutStage
from console.session.station.state import Activity, SessionStart
from console.session.work import Work, open_work
from console.text.catalogue import LANGUAGES, load
from drivers.cutting.planning import Strategy
from drivers.lathe_placement import LathePlacement, placed_of, placed_text
from drivers.simulator.faults.board import check_line
from profiles.files import parse_toml
from profiles.job import Job
from profiles.problem import Problem, ProfileError
from profiles.store import LoadedJob, load_machine, save_job
from tests.console.flight.bench import FlightBench
from tests.console.floor import Floor, open_floor
from tests.school.test_debrief import JOB, Pupil
from tests.tui import run_stage
from tests.tui.scenes import ALIGNED
from tests.tui.stage import ON, experiment, lathe

TRIP = Problem(code="machine.fault", key="program", value="spindle: fatal_following_error")
OWN: Job = replace(experiment().job, name="flange-52", cut_length_mm=12.0)
"""A job that is not bundled; 1000 rpm."""


def own_work() -> Work:
    loaded = LoadedJob(job=OWN, path=Path("/somewhere/flange-52.toml"), sha256="f" * 64)
    return open_work(loaded, lathe())


def bench_of(data: Path, **changes: Any) -> FlightBench:
    """A console with that job open, everything set up, 1 mm behind the face and clear of the part."""
    state = run_stage.state(ALIGNED, snapshot=run_stage.look(ON, tool=200_000.0), **changes)
    return FlightBench(data, state, own_work())


def fails_in_a_cut(
    data: Path, problem: Problem = TRIP, *, first_turn: float = 20.0, rest_s: float = 3.0
) -> Recording:
    """Armed after 3 s at rest; in the part from turn 20 on; 2.5 s later, at turn 45, the alarm."""
    bench = bench_of(data)
    bench.runs(rest_s)
    armed = replace(run_stage.armed(), job=OWN, alignment=ALIGNED)
    bench.state = replace(bench.state, armed=armed)
    bench.runs(1.0)
    bench.state = replace(bench.state, activity=Activity.CUTTING, snapshot=run_stage.look(running=True))
    bench.state = replace(bench.state, cut=run_stage.cut(CutStage.RUN_UP, turn=0.0))
    bench.runs(1.0)
    turn = [first_turn]

    def turns() -> None:
        bench.state = replace(bench.state, cut=run_stage.cut(turn=turn[0], z_mm=0.05 * (turn[0] - first_turn)))
        turn[0] += 1.0

    bench.runs(2.6, turns)
    bench.alarms(problem)
    bench.state = replace(bench.state, activity=Activity.STOPPED)
    bench.runs(7.0)
    (found,) = bench.frozen
    return found


def codes(practice: Practice) -> list[str]:
    return [problem.code.removeprefix("practice.") for problem in practice.otherwise]


def test_a_fault_in_a_cut_comes_at_its_turn_and_the_practice_begins_before_the_cut(tmp_path: Path) -> None:
    practice = practice_of(fails_in_a_cut(tmp_path))
    assert practice.work is not None and practice.work.job == OWN
    assert practice.before.turn == 45.0
    # 25 turns at 1000 rpm are 1.5 s; the alarm came a poll later.
    assert practice.before.after_s == pytest.approx(1.5 + 0.1, abs=0.02)
    assert practice.event.like is not None
    assert practice.event.like.fault == "following-error-trip motor=spindle"
    assert practice.begins.drives_on and practice.placed.job == OWN
    assert (practice.placed.jaw_1_deg, practice.placed.tip_radius_mm) == (12.63, 76.013)
    tool_mm, carriage_mm, turns = practice.placed.axes or (0.0, 0.0, 0.0)
    # 5000 counts a mm of tool, 1000 of carriage, 10 000 a turn; some polls have moved the tool by a count each.
    assert tool_mm == pytest.approx(40.0, abs=0.02) and carriage_mm == 171.0 and turns == pytest.approx(0.035)
    assert steps_of(practice, set_up=False)[:4] == ("drives_on", "armed", "in_cut", "stopped_in_cut")
    assert codes(practice) == ["as_found", "before_cut"]


def test_a_cut_that_is_older_than_its_recording_begins_at_the_start_of_its_program(tmp_path: Path) -> None:
    bench = bench_of(tmp_path, activity=Activity.CUTTING)
    armed = replace(run_stage.armed(), job=OWN, alignment=ALIGNED)
    bench.state = replace(bench.state, armed=armed, snapshot=run_stage.look(running=True))
    bench.state = replace(bench.state, cut=run_stage.cut(turn=100.0, z_mm=4.0))
    bench.runs(4.0)
    bench.alarms(TRIP)
    bench.runs(6.0)
    practice = practice_of(bench.frozen[0])
    plan, (tool_mm, carriage_mm, _) = armed.plan, practice.placed.axes or (0.0, 0.0, 0.0)
    assert (tool_mm, carriage_mm) == (plan.tool_start / 5000.0, plan.carriage_start / 1000.0)
    # 4 mm with 0.05 mm a turn are 80 turns, 4.8 s at 1000 rpm.
    assert practice.before.after_s == pytest.approx(4.8)
    assert "at_start" in codes(practice)


def test_at_rest_it_begins_as_long_before_as_was_asked_and_no_longer_than_recorded(tmp_path: Path) -> None:
    bench = bench_of(tmp_path)
    bench.runs(20.0)
    bench.alarms(Problem(code="link.lost"))
    bench.runs(6.0)
    recording = bench.frozen[0]
    for before_s in (None, 4.0, 15.0):
        practice = practice_of(recording, before_s)
        assert practice.before.after_s == pytest.approx(
            before_s or 10.0, abs=1.05
        )  # at rest, written once a second
        assert practice.before.after_s >= (before_s or 10.0)
    with pytest.raises(ProfileError) as refused:
        practice_of(recording, 60.0)
    assert [problem.code for problem in refused.value.problems] == ["practice.not_so_long"]


def test_a_blank_that_was_cut_in_part_is_told_as_far_as_the_pages_showed_it(tmp_path: Path) -> None:
    bench = bench_of(tmp_path, **run_stage.CUT_IN_PART)
    bench.runs(20.0)
    bench.alarms(Problem(code="link.lost"))
    bench.runs(6.0)
    told = {problem.code: problem.value for problem in practice_of(bench.frozen[0]).otherwise}
    assert told["practice.fresh_blank"] == "4.23 mm", "to its mark, beyond the last poll in the cut"


def test_a_record_without_a_moment_at_rest_or_without_its_job_is_refused(tmp_path: Path) -> None:
    bench = bench_of(tmp_path / "moving", activity=Activity.JOGGING)
    bench.runs(3.0)
    bench.alarms(TRIP)
    bench.runs(6.0)
    with pytest.raises(ProfileError, match="never at rest"):
        practice_of(bench.frozen[0])
    recording = fails_in_a_cut(tmp_path / "no job")
    without = replace(recording, moments=tuple(replace(each, work=None) for each in recording.moments))
    with pytest.raises(ProfileError, match="job is not in the recording"):
        practice_of(without)


@pytest.mark.parametrize(
    ("problem", "fault"),
    [
        (Problem(code="machine.fault", value="tool: amplifier_fault"), "amplifier-fault motor=tool"),
        (
            Problem(code="machine.fault", value="carriage: positive_limit"),
            "limit motor=carriage direction=positive",
        ),
        (Problem(code="machine.fault", value="tool: fatal_following_error"), "following-error-trip motor=tool"),
        (Problem(code="link.lost"), "cut-cable"),
        (Problem(code="link.silent"), "hang"),
        (Problem(code="machine.timeout", key="home spindle"), "index-lost motor=spindle"),
        (Problem(code="machine.timeout", key="jog"), None),
        (Problem(code="machine.fault", value="program: runtime_error"), None),
        (Problem(code="simulator.met_jaws"), None),
    ],
)
def test_each_alarm_has_the_fault_that_raises_it_or_none(problem: Problem, fault: str | None) -> None:
    like = likeness(problem)
    assert (like is None) == (fault is None)
    if like is not None and fault is not None:
        assert like.fault.startswith(fault)
        check_line(like.fault)


def test_what_cannot_be_reproduced_is_said_in_both_languages(tmp_path: Path) -> None:
    recording = fails_in_a_cut(tmp_path, Problem(code="cut.out_of_phase", limit="1.39"))
    header = replace(recording.header, simulated=False)
    practice = practice_of(replace(recording, header=header))
    assert {"was_real", "doubt_phase", "before_cut", "as_found"} <= set(codes(practice))
    for language in LANGUAGES:
        text = load(language)
        said = "\n".join(practice_lines(practice, text))
        assert all(text.problem(problem) in said for problem in practice.otherwise)
        assert header.machine.name in said and "45.0" in said


@pytest.mark.parametrize("stop", ["space", "f9"])
def test_a_stop_by_a_key_has_no_fault_and_says_so(stop: str, tmp_path: Path) -> None:
    bench = bench_of(tmp_path)
    bench.runs(12.0)
    bench.stops(stop)
    bench.runs(6.0)
    practice = practice_of(bench.frozen[0])
    assert practice.event.like is None and "nothing_like_it" in codes(practice)
    lesson = lesson_of_practice(practice, words_of(practice), plant="mounted", seed=3)
    assert lesson.events == () and lesson.steps[-2:] == ("stopped", "recovered")


def words_of(practice: Practice, *, set_up: bool = False) -> dict[str, Any]:
    steps = steps_of(practice, set_up=set_up)
    return {language: lesson_words(practice, steps, load(language)) for language in LANGUAGES}


@pytest.mark.parametrize("problem", [TRIP, Problem(code="link.lost", where="tcp:127.0.0.1:1", value='"gone"')])
def test_the_lesson_that_is_written_is_read_as_one(problem: Problem, tmp_path: Path) -> None:
    practice = practice_of(fails_in_a_cut(tmp_path, problem))
    lesson = lesson_of_practice(practice, words_of(practice, set_up=True), plant="mounted", seed=None, set_up=True)
    content = lesson_text(lesson, tuple(practice_lines(practice, load("ko"))))
    assert lesson_of(parse_toml(content.encode(), ""), lesson.name, "") == lesson
    assert lesson.steps[:5] == ("clamped", "drives_on", "homed", "jaw_found", "touched_off")
    assert (lesson.job, lesson.events[0].after) == ("flange-52", "in_cut")


def test_what_was_set_up_between_the_beginning_and_the_event_is_a_step(tmp_path: Path) -> None:
    bench = bench_of(tmp_path)
    bare = replace(bench.state, alignment=replace(ALIGNED, drives_on=False, homed=False, jaw=None, touch_off=None))
    ready, bench.state = bench.state, bare
    bench.runs(8.0)
    bench.state = ready
    bench.runs(6.0)
    bench.alarms(Problem(code="machine.fault", value="tool: amplifier_fault"))
    bench.runs(6.0)
    recording = bench.frozen[0]
    # Unasked it begins with everything set up; ten seconds before, it was not.
    unasked = practice_of(recording)
    assert unasked.before.missing == () and unasked.before.after_s == pytest.approx(6.0, abs=0.2)
    asked = practice_of(recording, 10.0)
    assert asked.before.missing == ("drives_on", "homed", "jaw_found", "touched_off")
    lesson = lesson_of_practice(asked, words_of(asked), plant="mounted", seed=3)
    assert (lesson.steps[:4], lesson.events[0].after) == (asked.before.missing, "touched_off")
    assert lesson.events[0].wait_s == pytest.approx(6.0, abs=0.2)
    with pytest.raises(ProfileError, match="begins 14"):
        practice_of(recording, 15.0)


# Machine and job are those of the recording: the saved ones where they are the same, else made from it.


def test_a_saved_machine_is_used_as_long_as_it_is_the_same(tmp_path: Path) -> None:
    recording = fails_in_a_cut(tmp_path / "data")
    assert machine_recorded(recording, tmp_path).path == lathe().path


@pytest.mark.parametrize("change", [{"machine_sha256": "0" * 64}, {"machine_path": Path("/nowhere/lathe.toml")}])
def test_another_machine_of_the_name_is_not_taken_for_it(change: dict[str, object], tmp_path: Path) -> None:
    recording = fails_in_a_cut(tmp_path / "data")
    tool = replace(recording.header.machine.tool, moving_mass_kg=3.21)
    header = replace(recording.header, machine=replace(recording.header.machine, tool=tool), **change)  # type: ignore[arg-type]
    loaded = machine_recorded(replace(recording, header=header), tmp_path)
    assert loaded.machine == header.machine
    # The simulator reads the file of the profile: it has to say the same.
    assert load_machine(str(loaded.path)).machine == header.machine


def test_a_job_that_is_not_saved_is_opened_from_the_recording_and_one_that_is_from_its_file(
    tmp_path: Path,
) -> None:
    data = tmp_path / "data"
    recorded = fails_in_a_cut(data).moments[-1].work
    assert recorded is not None
    edited = replace(recorded, job=replace(recorded.job, depth_of_cut_mm=0.07), strategy="cam", stage="partial")
    work, saved = work_recorded(edited, lathe(), data, tmp_path)
    assert not saved and work.loaded.job == OWN
    assert (work.job.depth_of_cut_mm, work.strategy, work.stage, work.edited) == (0.07, "cam", "partial", True)
    (data / "jobs").mkdir()
    save_job(OWN, data / "jobs" / "other-name.toml")
    again = replace(recorded, sha256=work.loaded.sha256)
    work, saved = work_recorded(again, lathe(), data, tmp_path)
    assert saved and work.loaded.path.name == "other-name.toml" and not work.edited


# A simulated lathe that is taken up where somebody left it: it stands there, aligned, and is cut on at once.


@pytest.fixture(scope="module")
def left(tmp_path_factory: pytest.TempPathFactory) -> Floor:
    """A lathe that somebody has set up."""
    floor = open_floor(tmp_path_factory.mktemp("left"), seed=4)
    floor.set_up(JOB)
    return floor


def taken(left: Floor, data: Path, seed: int) -> Floor:
    """Another lathe, placed as that one stands, with what was known of it."""
    state, machine = left.idle(), left.context.machine
    assert state.snapshot is not None and state.alignment.jaw is not None
    snapshot = state.snapshot
    axes = (
        snapshot.tool.position / machine.tool.counts_per_mm - 1.0,  # 1 mm off the part
        snapshot.carriage.position / machine.carriage.counts_per_mm,
        snapshot.spindle.position / machine.spindle.counts_per_rev,
    )
    jaw_1_deg, tip_mm = state.alignment.jaw.angle_deg, machine.tool.home_radius_mm
    placed = LathePlacement(axes=axes, jaw_1_deg=jaw_1_deg, tip_radius_mm=tip_mm, job=JOB)
    sent = placed_of(placed_text(placed))
    assert sent == placed
    return open_floor(data, seed, placed=sent, begins=SessionStart(alignment=state.alignment, drives_on=True))


@pytest.mark.parametrize("seed", [4, 9])
def test_it_stands_where_it_was_left_with_what_was_known(seed: int, left: Floor, tmp_path: Path) -> None:
    floor = taken(left, tmp_path, seed)
    state, before = floor.idle(), left.state
    assert state.activity is Activity.READY and not state.alarms and not state.refusals
    assert state.alignment == replace(before.alignment, settings=())
    assert state.seen is not None and before.seen is not None
    assert state.seen.jaw_1_past_mark_deg == pytest.approx(before.seen.jaw_1_past_mark_deg, abs=0.05)
    assert state.seen.tool_gap_mm == pytest.approx(1.0 + (before.seen.tool_gap_mm or 0.0), abs=0.002)
    assert state.seen.collisions == ()


def test_a_part_is_cut_on_it_and_homing_again_finds_the_same_zeros(left: Floor, tmp_path: Path) -> None:
    floor = taken(left, tmp_path, 9)
    assert floor.arm(JOB, Strategy.PVT).armed is not None, floor.state.refusals
    floor.idle()
    floor.do(Start())
    measured = floor.do(Measure()).measured
    assert measured is not None and measured.result.ront_um < JOB.roundness_tolerance_um
    again = taken(left, tmp_path / "again", 9)
    again.do(Home())
    state = again.idle()
    assert state.snapshot is not None and left.state.alignment.jaw is not None
    # A zero that had been moved would show at once in what is seen of the chuck against what is reported.
    at = state.snapshot.spindle.position / again.context.machine.spindle.counts_per_rev * 360.0
    jaw_1_deg = left.state.alignment.jaw.angle_deg
    assert state.seen is not None
    off = (at - jaw_1_deg - state.seen.jaw_1_past_mark_deg + 180.0) % 360.0 - 180.0
    assert off == pytest.approx(0.0, abs=0.05)


def test_the_recorded_fault_comes_in_its_cut(left: Floor, tmp_path: Path) -> None:
    floor = taken(left, tmp_path, 9)
    event = LessonEvent(after="in_cut", wait_s=0.5, fault="following-error-trip motor=spindle")
    lesson = replace(load_lesson("drive-fails", tmp_path), steps=("in_cut", "stopped_in_cut"), events=(event,))
    pupil = Pupil(floor, lesson)
    floor.arm(replace(JOB, cut_length_mm=6.0), Strategy.PVT)
    floor.idle()
    floor.do(Start())
    assert [step for step, _ in pupil.tried.reached] == ["in_cut", "stopped_in_cut"]
    assert "machine.fault" in [alarm.problem.code for alarm in floor.state.alarms]


def test_a_machine_that_is_not_simulated_is_not_taken_up(left: Floor, tmp_path: Path) -> None:
    floor = open_floor(tmp_path)
    floor.context.shop = None
    with pytest.raises(SessionError):
        begin_as(floor.context, SessionStart(alignment=left.state.alignment, drives_on=True))
    assert floor.state.alignment.jaw is None and not floor.state.alignment.drives_on
