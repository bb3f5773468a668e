"""The debrief of a recorded run: what it cost and why, what happened, what to do, what the record lacks."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.report.page import report_page
from console.report.reported_run import reported_run
from console.school.training.lesson import load_lesson
from console.session.cut.recording import part_record
from console.session.cut.run import roundness_of
from console.session.data.measured_part import MadeWith, tool_event
from console.session.data.records import RunRecord, add_to_run
from console.session.data.run_reader import RunStory, runs, story
from console.session.learning.run_debrief import Advice, RunDebrief, run_debrief
from console.session.stages import Stage
from console.session.station.commands import Measure, Start
from console.text.catalogue import LANGUAGES, load
from console.text.run_debrief import debrief_sections
from console.tui.records.opened_run import opened_run
from console.tui.records.panels import trace_caption
from console.tui.records.run_lines import story_lines
from profiles.compensations.causes import CauseKind
from profiles.job import Job
from profiles.store import LoadedJob, job_text
from profiles.traces import Trace
from tests.console.commands import Console
from tests.console.floor import open_floor
from tests.record_clock import set_dates
from tests.school.test_debrief import JOB as CUT
from tests.school.test_debrief import Pupil
from tests.tui.records_stage import ANGLES_DEG, META, described, telemetry
from tests.tui.stage import experiment, lathe

JOB: Job = replace(experiment().job, name="flange-52")
"""Not a bundled job: 55 um p-p with three jaws, the part 5 um round."""

MADE = MadeWith(compensation="none", strategy="pvt", stage="full", inverted="model")
LATE_DEG = 2.0
BEGAN = datetime(2026, 5, 4, 8, 0, tzinfo=UTC)


def turned(late_deg: float = LATE_DEG) -> Trace:
    """What is left of a lobe that stands `late_deg` further on than the path that was to remove it."""
    amplitude_um, phase_deg = 0.5 * (JOB.lobe_error_um_pp or 0.0), JOB.lobe_phase_deg
    lobe = amplitude_um * np.cos(np.radians(3.0 * (ANGLES_DEG - phase_deg - late_deg)))
    path = amplitude_um * np.cos(np.radians(3.0 * (ANGLES_DEG - phase_deg)))
    noise = 0.05 * np.cos(np.radians(7.0 * ANGLES_DEG))
    return Trace(angle_deg=ANGLES_DEG, deviation_um=lobe - path + noise, meta={**META, **MADE.header()})


def recorded(
    data: Path,
    trace: Trace | None,
    *,
    tell: Callable[[RunRecord], None] = lambda _: None,
    made: MadeWith = MADE,
    more: Mapping[str, object] | None = None,
    **changes: Any,
) -> RunStory:
    """A run of that job, as the console records one."""
    run = RunRecord(data, described(JOB, **changes))
    run.add("armed", {"force_n": 1314.0})
    run.add("started", {"strategy": "pvt"})
    run.log.begin_cut("", lambda polls: telemetry())
    run.log.poll((0.0,))
    run.log.end_cut()
    tell(run)
    if trace is not None:
        run.add("cut", {"turn": 160.0, **made.event(), **tool_event(0j, 0.0)})
        told = {"jaw_1_deg": JOB.jaw_1_deg, "phase_known": True, **(more or {})}
        part = part_record(JOB, roundness_of(trace), trace, Stage(changes.get("stage", "full")), more=told)
        run.add("measured", {"ront_um": part.ront_um}, part)
    run.close()
    return story(data, run.run_id)


def codes(debrief: RunDebrief) -> set[str]:
    return {problem.code.removeprefix("debrief.") for problem in debrief.unknown}


def test_a_lobe_that_stands_elsewhere_is_the_first_cause_with_its_angle_and_um(tmp_path: Path) -> None:
    debrief = run_debrief(recorded(tmp_path, turned()), tmp_path)
    first = debrief.causes[0]
    # Two cosines of 27.5 um, 3 x 2 degrees apart, differ by 2 x 27.5 sin 3 degrees in amplitude.
    assert first.kind is CauseKind.ANGLE
    assert first.value == pytest.approx(LATE_DEG, abs=0.05)
    assert first.um_pp == pytest.approx(4.0 * 27.5 * math.sin(math.radians(3.0)), abs=0.1)
    assert list(debrief.advice) == [Advice.CAUSES]
    assert codes(debrief) == {"no_diameter"}


def test_a_round_part_has_no_causes_and_asks_for_nothing(tmp_path: Path) -> None:
    debrief = run_debrief(recorded(tmp_path, turned(0.1)), tmp_path)
    assert debrief.causes == () and not debrief.fails_round
    assert list(debrief.advice) == [Advice.NONE]


@pytest.mark.parametrize(
    ("changes", "code"),
    [({"job_text_sha256": None}, "no_texts"), ({"stage": "partial"}, "partial")],
)
def test_what_the_record_does_not_have_is_said_and_not_guessed(
    changes: dict[str, Any], code: str, tmp_path: Path
) -> None:
    debrief = run_debrief(recorded(tmp_path, turned(), **changes), tmp_path)
    assert code in codes(debrief) and debrief.causes == ()


def test_a_version_that_is_gone_is_named(tmp_path: Path) -> None:
    learned = replace(MADE, compensation="4")
    trace = replace(turned(), meta={**META, **learned.header()})
    debrief = run_debrief(recorded(tmp_path, trace), tmp_path)
    assert debrief.causes == () and debrief.fails_round
    assert any(problem.code.startswith("learned.") for problem in debrief.unknown)


def stops(run: RunRecord) -> None:
    run.log.event("alarm_raised", {"code": "cut.out_of_phase", "priority": "medium", "limit": "1.39"})
    run.add("stopped", {"reason": "space", "by": "kim", "turn": 83.4})


def test_a_stop_by_a_key_in_the_cut_is_told_with_its_turn_and_what_to_do_instead(tmp_path: Path) -> None:
    debrief = run_debrief(recorded(tmp_path, None, tell=stops), tmp_path)
    assert [told.event.kind for told in debrief.happened if told.event] == ["started", "stopped"]
    assert list(debrief.advice) == [Advice.ENDED, Advice.STOPS]
    for language in LANGUAGES:
        said = " ".join(row for _, rows in debrief_sections(debrief, load(language)) for row in rows)
        assert "83.4" in said and "F4" in said


@pytest.mark.parametrize("language", LANGUAGES)
def test_command_page_and_report_say_the_same(language: str, console: Console, tmp_path: Path) -> None:
    found, text = recorded(tmp_path, turned(), tell=stops), load(language)
    debrief = run_debrief(found, tmp_path)
    rows = [row for _, rows in debrief_sections(debrief, text) for row in rows]
    assert any("5.8" in row for row in rows), rows
    told = console("records", "debrief", found.row.run_id[:8], "--data", str(tmp_path), "--lang", language)
    page = "\n".join(
        "".join(words for words, _ in each)
        for each in story_lines(opened_run(tmp_path, found.row.run_id, lathe()), text, 120)
    )
    report = report_page(reported_run(found, debrief=debrief), text)
    for shown in (told.out, page, report):
        plain = "".join(shown.split())
        assert all("".join(row.split()) in plain for row in rows)


def test_the_debrief_for_a_program_has_causes_and_codes(console: Console, tmp_path: Path) -> None:
    found = recorded(tmp_path, turned())
    said = json.loads(console("records", "debrief", found.row.run_id, "--data", str(tmp_path), "--json").out)
    assert said["causes"][0]["kind"] == "angle" and said["next"] == ["causes"]
    assert said["unknown"] == ["debrief.no_diameter"]


@pytest.mark.long
def test_a_part_that_was_cut_with_jaw_1_off_has_the_causes_that_inspect_shows(tmp_path: Path) -> None:
    floor = open_floor(tmp_path)
    pupil = Pupil(floor, load_lesson("touch-off", tmp_path))
    pupil.aligns(off_deg=3.0)
    loaded = LoadedJob(job=CUT, path=Path("/somewhere.toml"), sha256="0" * 64, text=job_text(CUT))
    assert floor.arm(CUT, loaded=loaded).armed is not None, floor.state.refusals
    floor.idle()
    floor.do(Start())
    shown = floor.do(Measure()).measured
    floor.idle()
    assert shown is not None and shown.learning is not None and shown.learning.taught is not None
    (row,) = runs(tmp_path)
    debrief = run_debrief(story(tmp_path, row.run_id), tmp_path)
    assert debrief.causes == shown.learning.taught.causes
    first = debrief.causes[0]
    assert first.kind is CauseKind.ANGLE and abs(abs(first.value) - 3.0) < 0.2


def test_while_a_machine_moves_the_causes_are_left_for_later(tmp_path: Path) -> None:
    found = recorded(tmp_path, turned())
    debrief = run_debrief(found, tmp_path, explains=False)
    assert debrief.fails_round and debrief.causes == () and "later" in codes(debrief)


def times_of(debrief: RunDebrief) -> dict[str, float]:
    """When the first event of each kind was, s after the start."""
    events = ((told.event, told.at_s) for told in reversed(debrief.happened))
    return {event.kind: at_s for event, at_s in events if event is not None}


def test_a_cut_that_a_simulated_lathe_makes_in_a_moment_is_told_in_machine_time(tmp_path: Path) -> None:
    floor = open_floor(tmp_path)
    floor.set_up(CUT)
    assert floor.arm(CUT, stage=Stage.AIR).armed is not None, floor.state.refusals
    floor.do(Start())
    floor.context.end_record()
    (row,) = runs(tmp_path)
    found = story(tmp_path, row.run_id)
    (polled,) = (each for each in found.telemetry if each.kind == "poll")
    cut_s = float(polled.column("time_s")[-1])
    # The polls carry the time of the controller; on this clock, the cut takes far less.
    assert times_of(run_debrief(found, tmp_path))["cut"] == pytest.approx(cut_s, abs=3.0) and cut_s > 5.0


@pytest.mark.parametrize("speed", [0.25, 4.0, 1000.0])
def test_an_alarm_stands_unseen_for_machine_time(speed: float, tmp_path: Path) -> None:
    now = [100.0]
    run = RunRecord(tmp_path, described(JOB), now_s=lambda: now[0])
    for seconds, kind in ((0.0, "started"), (3.0, "alarm_raised"), (90.0, "alarm_acknowledged")):
        now[0] = 100.0 + speed * seconds
        run.log.event(kind, {"code": "cut.out_of_phase", "priority": "medium"})
    run.close()
    debrief = run_debrief(story(tmp_path, run.run_id), tmp_path)
    (raised,) = (told for told in debrief.happened if told.raised)
    (seen,) = (told for told in debrief.happened if told.seen)
    assert (raised.at_s, seen.at_s, seen.unseen_s) == (3.0 * speed, 90.0 * speed, 87.0 * speed)


def test_parts_on_new_machines_follow_each_other_in_machine_time(console: Console, data_folder: Path) -> None:
    assert console("run", "lee-2001-experiment-1", "--sim").code == 0
    (row,) = runs(data_folder / "trilobe")
    found = story(data_folder / "trilobe", row.run_id)
    events = [event for event in found.events if event.kind == "part" or event.data.get("step") == "cut"]
    polled = {each.part: float(each.column("time_s")[-1]) for each in found.telemetry if each.kind == "poll"}
    cut, measured, cut_again, measured_again = (event.at_s for event in events)
    assert 0.0 < cut < measured < cut_again < measured_again
    for part, at_s in (("before", measured - cut), ("after", measured_again - cut_again)):
        assert at_s == pytest.approx(polled[part], abs=2.0)


def test_events_without_a_machine_time_are_told_by_their_dates(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    second = iter(range(0, 1000, 40))
    set_dates(monkeypatch, lambda: (BEGAN + timedelta(seconds=next(second))).isoformat())
    run = RunRecord(tmp_path, described(JOB))
    run.close()
    for kind in ("started", "cut", "measured"):  # as an older console has written them
        add_to_run(tmp_path, run.run_id, kind, {})
    debrief = run_debrief(story(tmp_path, run.run_id), tmp_path)
    assert times_of(debrief) == {"started": 0.0, "cut": 40.0, "measured": 80.0}


@pytest.mark.parametrize(
    ("end", "words"),
    [
        ({"reason": "SIGTERM", "stopped": True, "by": "SIGTERM"}, "stop: SIGTERM"),
        ({"reason": "the tool has not found its home flag"}, "has not found its home flag"),
        ({"reason": "killed"}, "console killed"),
    ],
)
def test_a_run_that_ended_while_homing_tells_why_instead_of_asking_for_nothing(
    end: dict[str, object], words: str, tmp_path: Path
) -> None:
    run = RunRecord(tmp_path, described(JOB))
    run.add("planned", {})
    run.add("ended", end)
    run.close()
    found = story(tmp_path, run.run_id)
    debrief = run_debrief(found, tmp_path)
    assert [told.event.kind for told in debrief.happened if told.event] == ["ended"]
    assert list(debrief.advice) == [Advice.STOPPED]
    said = dict(debrief_sections(debrief, load("en")))
    assert words in said["What happened, from the start"][0] and words in said["Next time"][0]


@pytest.mark.parametrize(("setup", "jaw"), [('{"jaw_1_deg": 12.63}', "jaw 1 at 12.6"), ("{}", "")])
def test_a_stopped_run_has_jaw_1_from_its_alignment_or_not_at_all(setup: str, jaw: str, tmp_path: Path) -> None:
    found = recorded(tmp_path, None, tell=stops, setup=setup)
    run = opened_run(tmp_path, found.row.run_id, lathe())
    said = "".join(words for each in trace_caption(run, 1.0, load("en"), 60) for words, _ in each)
    assert jaw in said and "unknown" not in said and ("jaw" in said) is bool(jaw)
