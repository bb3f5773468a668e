"""The debrief of a recorded run, and that what is recorded reads the same everywhere."""

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
from pytest import MonkeyPatch

from console.report.page import write_report
from console.school.training.lesson import load_lesson
from console.session.cut.recording import part_record
from console.session.cut.run import roundness_of
from console.session.data import run_facts
from console.session.data.measured_part import MadeWith, tool_event
from console.session.data.records import RunRecord, add_to_run
from console.session.data.run_reader import runs, story
from console.session.data.run_rows import problem_events
from console.session.data.run_story import RunStory
from console.session.learning.opened_run import open_for_report, open_run
from console.session.learning.part_learning import PartLearning, learning_event
from console.session.learning.run_debrief import Advice, RunDebrief, run_debrief
from console.session.stages import Stage
from console.session.station.commands import Command, Measure, Start
from console.session.station.history.session_log import SessionLog, command_entry, with_state
from console.text.catalogue import LANGUAGES, Catalogue, load
from console.text.run_debrief import debrief_sections
from console.tui.further.log_lines import entry_words
from console.tui.records.panels import trace_caption
from console.tui.records.run_lines import story_lines
from profiles.compensations.hypotheses import LatheFault
from profiles.job import Job
from profiles.problem import Problem
from profiles.store import LoadedJob, job_text
from profiles.traces import Trace
from tests.architecture.test_catalogues import catalogue
from tests.console.commands import Console, JobFile
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


def turned(late_deg: float = LATE_DEG, path_deg: float = 0.0) -> Trace:
    """What is left of a lobe `late_deg` further on than the job has it, by a path that is so by `path_deg`."""
    amplitude_um, phase_deg = 0.5 * (JOB.lobe_error_um_pp or 0.0), JOB.lobe_phase_deg
    lobe = amplitude_um * np.cos(np.radians(3.0 * (ANGLES_DEG - phase_deg - late_deg)))
    path = amplitude_um * np.cos(np.radians(3.0 * (ANGLES_DEG - phase_deg - path_deg)))
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
    assert debrief.diagnosis is not None
    angle = next(each for each in debrief.diagnosis.ranked if each.fault is LatheFault.ANGLE)
    # Two cosines of 27.5 um, 3 x 2 degrees apart, differ by 2 x 27.5 sin 3 degrees in amplitude.
    assert angle.amount == pytest.approx(LATE_DEG, abs=0.05)
    left_um_pp = 4.0 * 27.5 * math.sin(math.radians(3.0))
    assert 0.5 * left_um_pp < angle.um_pp < left_um_pp + 0.1
    assert list(debrief.advice) == [Advice.CAUSES]
    assert codes(debrief) == {"no_diameter"}
    debrief = run_debrief(recorded(tmp_path, turned(0.1)), tmp_path)
    assert not debrief.fails_round and list(debrief.advice) == [Advice.NONE]


def row_that_learns(data: Path, *, ends: bool = True) -> RunStory:
    """A chuck that creeps round by 4 degrees a part, its path one part behind: all parts look alike."""
    run = RunRecord(data, described(JOB))
    passes = []
    for number in (1, 2, 3):
        trace, path_deg = turned(4.0 * number, 4.0 * (number - 1)), JOB.lobe_phase_deg + 4.0 * (number - 1)
        how: dict[str, Any] = {"more": {"jaw_1_deg": JOB.jaw_1_deg}, "part": f"part {number}"}
        run.add("part", {}, part_record(JOB, roundness_of(trace), trace, Stage.FULL, **how))
        wanted = {"n": 3, "amplitude_um": 27.5, "crest_deg": path_deg}
        passes.append({"learned": {"wanted": [wanted], "tool_error": [{**wanted, "amplitude_um": 0.0}]}})
    if ends:
        run.add("result", {**MADE.event(), **tool_event(0j, 0.0), "passes": passes})
    run.close()
    return story(data, run.run_id)


def test_a_row_that_learns_is_judged_by_all_its_parts_with_the_path_of_each(tmp_path: Path) -> None:
    found = run_debrief(row_that_learns(tmp_path), tmp_path).diagnosis
    assert found is not None and found.parts == 3
    assert found.best.fault is LatheFault.DRIFT and found.best.amount == pytest.approx(4.0, abs=0.05)
    ended = run_debrief(row_that_learns(tmp_path, ends=False), tmp_path)
    assert ended.fails_round and ended.diagnosis is None, "its paths are in no record"


def test_what_the_record_lacks_is_said_and_not_guessed(tmp_path: Path) -> None:
    lacks: tuple[tuple[dict[str, Any], str], ...] = (
        ({"job_text_sha256": None}, "no_texts"),
        ({"stage": "partial"}, "partial"),
    )
    for changes, code in lacks:
        debrief = run_debrief(recorded(tmp_path, turned(), **changes), tmp_path)
        assert code in codes(debrief) and list(debrief.advice) == [Advice.NONE]
    moving = run_debrief(recorded(tmp_path, turned()), tmp_path, explains=False)
    assert moving.fails_round and moving.diagnosis is None and "later" in codes(moving), "while a machine moves"
    trace = replace(turned(), meta={**META, **replace(MADE, compensation="4").header()})
    gone = run_debrief(recorded(tmp_path, trace), tmp_path)
    assert gone.diagnosis is None and gone.fails_round
    assert any(problem.code.startswith("learned.") for problem in gone.unknown), "a version that is gone"


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
        for each in story_lines(open_run(tmp_path, found.row.run_id, lathe()), text, 120)
    )
    report = write_report(open_for_report(found, debrief=debrief), text)
    for shown in (told.out, page, report):
        plain = "".join(shown.split())
        assert all("".join(row.split()) in plain for row in rows)


def test_the_debrief_for_a_program_has_causes_and_codes(console: Console, tmp_path: Path) -> None:
    found = recorded(tmp_path, turned())
    said = json.loads(console("records", "debrief", found.row.run_id, "--data", str(tmp_path), "--json").out)
    angle = next(each for each in said["diagnosis"]["ranked"] if each["fault"] == "angle")
    assert angle["amount"] == pytest.approx(LATE_DEG, abs=0.05) and said["next"] == ["causes"]
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
    assert debrief.diagnosis == shown.learning.faults.diagnosis and debrief.diagnosis is not None
    angle = next(each for each in debrief.diagnosis.ranked if each.fault is LatheFault.ANGLE)
    assert abs(abs(angle.amount) - 3.0) < 0.2


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


def test_parts_on_new_machines_follow_each_other_in_machine_time(
    console: Console, close: tuple[str, str], job_file: JobFile, data_folder: Path
) -> None:
    assert console("run", str(job_file(cut_length_mm="0.5")), "--sim", *close).code in (0, 4)
    (row,) = runs(data_folder / "trilobe")
    found = story(data_folder / "trilobe", row.run_id)
    events = [event for event in found.events if event.kind == "part" or event.data.get("step") == "cut"]
    polled = {each.part: float(each.column("time_s")[-1]) for each in found.telemetry if each.kind == "poll"}
    cut, measured, cut_again, measured_again = (event.at_s for event in events)
    assert 0.0 < cut < measured < cut_again < measured_again
    for part, at_s in (("before", measured - cut), ("after", measured_again - cut_again)):
        assert at_s == pytest.approx(polled[part], abs=2.0)


def test_events_without_a_machine_time_are_told_by_their_dates(monkeypatch: MonkeyPatch, tmp_path: Path) -> None:
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
def test_a_run_that_ended_while_homing_tells_why(end: dict[str, object], words: str, tmp_path: Path) -> None:
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
    run = open_run(tmp_path, found.row.run_id, lathe())
    said = "".join(words for each in trace_caption(run, 1.0, load("en"), 60) for words, _ in each)
    assert jaw in said and "unknown" not in said and ("jaw" in said) is bool(jaw)


NAMES = sorted(each.__name__ for each in Command.__subclasses__())
AT = datetime(2026, 3, 4, 5, 6, tzinfo=UTC)
BRIEF = Problem(code="cut.off_path", key="tool", value="12.5 um", limit="2.0 um", where="3.1 mm")
CHANGED = Problem(code="learned.changed_in_cut", value="override 97 %")


def page_words(data: Path, found: RunStory, text: Catalogue) -> str:
    run = open_run(data, found.row.run_id, lathe())
    return " ".join("".join(piece for piece, _ in row).strip() for row in story_lines(run, text, 100))


def report_words(data: Path, found: RunStory, text: Catalogue) -> str:
    return write_report(open_for_report(found, (), debrief=run_debrief(found, data)), text)


def ended_early(event: dict[str, object], *alarms: Problem) -> Callable[[RunRecord], None]:
    def tell(run: RunRecord) -> None:
        for each in alarms:
            facts = {"code": each.code, "key": each.key, "value": each.value, "limit": each.limit}
            run.log.event("alarm_raised", {**facts, "where": each.where, "priority": "high"})
        run.add("ended_early", {"turns": 12.0, **event})

    return tell


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_command_has_its_word_in_one_place(language: str, tmp_path: Path, console: Console) -> None:
    entries, text = {key: str(each) for key, each in catalogue(language).items()}, load(language)
    named = sorted(key.removeprefix("command.") for key in entries if key.startswith("command."))
    assert named == NAMES
    assert [key for key in entries if ".command." in key and key.rpartition(".")[2] in NAMES] == []

    def tell(run: RunRecord) -> None:
        for name in NAMES:
            run.log.event("command", {"command": name, "by": "kim"})

    found = recorded(tmp_path, None, tell=tell)
    listed = console("records", "show", found.row.run_id, "--data", str(tmp_path), "--lang", language).out
    seen = {
        "log": " | ".join(entry_words(command_entry(name, taken=True, at=AT), text) for name in NAMES),
        "records": " ".join(listed.split()),
        "page": " ".join(page_words(tmp_path, found, text).split()),
        "report": report_words(tmp_path, found, text),
    }
    missing = [
        (where, name) for where, told in seen.items() for name in NAMES if entries[f"command.{name}"] not in told
    ]
    assert missing == []
    assert [where for where, told in seen.items() if "command." in told] == []


def test_an_early_end_keeps_its_figures(tmp_path: Path, console: Console) -> None:
    found = recorded(tmp_path, None, tell=ended_early(problem_events([BRIEF])))
    listed = console("records", "list", "--data", str(tmp_path)).out
    for told in (page_words(tmp_path, found, load("en")), report_words(tmp_path, found, load("en")), listed):
        assert "was briefly 12.5 um off its path" in " ".join(told.split())
        assert "cut.off_path" not in told


def test_why_nothing_was_learned_keeps_its_figures(tmp_path: Path) -> None:
    event = learning_event(PartLearning(made=MADE, problems=(CHANGED,)))
    found = recorded(tmp_path, turned(), more={"learning": event})
    for told in (page_words(tmp_path, found, load("en")), report_words(tmp_path, found, load("en"))):
        assert "(override 97 %)" in " ".join(told.split())
        assert "(–)" not in told and "learned.changed_in_cut" not in told


def test_a_plain_cut_has_no_compensation(tmp_path: Path, console: Console) -> None:
    found = recorded(tmp_path, None, strategy="none", compensation=None)
    for language, said, wrong in (("en", "no compensation", "full comp"), ("ko", "보상 없음", "전체")):
        listed = console("records", "list", "--data", str(tmp_path), "--lang", language).out
        assert said in listed and wrong not in listed
        told = page_words(tmp_path, found, load(language))
        assert said in told and f"{load(language)('made.model')}, " not in told


def test_without_a_cause_nothing_is_called_most_likely(tmp_path: Path) -> None:
    """The strategy of a plain cut has no path: what its lobe comes from is not asked of its trace."""
    changed = replace(MADE, changed="override 97 %")
    found = recorded(tmp_path, turned(), made=changed)
    debrief = run_debrief(found, tmp_path)
    assert debrief.fails_round and debrief.diagnosis is None
    told = " ".join(row for _, rows in debrief_sections(debrief, load("en")) for row in rows)
    assert "too much." in told and "Most likely" not in told
    assert "override 97 %" in told, "why it is not known"
    explained = run_debrief(recorded(tmp_path, turned()), tmp_path)
    rows = [row for _, rows in debrief_sections(explained, load("en")) for row in rows]
    assert rows[0].endswith("too much.") and rows[1].startswith("Not sure") and "To decide:" in rows[1]
    assert f"turned {LATE_DEG:+.1f}°" in rows[1]


def test_the_log_has_the_name_under_which_a_job_is_stored_and_no_refused_entry() -> None:
    from console.session.station.history.alarm_history import Instant
    from console.session.station.state import StationState

    now = Instant(now_s=1.0, clock=AT)
    renamed = Problem(code="screen.job_renamed", key="ring", value="ring 2")
    refused = Problem(code="screen.name_taken", value="secret", limit="secret 2")
    log = with_state(SessionLog(), StationState(), (renamed, refused), now, typed=True)
    said = [entry_words(entry, load("en")) for entry in log.entries]
    assert said[0].startswith("ring renamed to ring 2")
    assert "secret" not in said[1]


def test_a_fact_is_one_row_wherever_it_is_shown(
    tmp_path: Path, console: Console, monkeypatch: MonkeyPatch
) -> None:
    row = ("coolant", run_facts.FactKind.TEXT, "coolant", "coolant_at")
    monkeypatch.setattr(run_facts, "SETUP", (*run_facts.SETUP, row))
    setup = {"force_n": 1314.0, "coolant": "oil 5 %", "coolant_at": "2 Jan 08:45"}
    found = recorded(tmp_path, turned(), setup=json.dumps(setup))
    run, data = found.row.run_id, ("--data", str(tmp_path))
    told = {
        "page": page_words(tmp_path, found, load("en")),
        "report": report_words(tmp_path, found, load("en")),
        **{name: console("records", name, run, *data).out for name in ("show", "debrief")},
    }
    for where, words in told.items():
        shown = "oil 5 %, taken 2 Jan 08:45" if where == "report" else "oil 5 % (2 Jan 08:45)"
        assert "fact.coolant" in words and shown in words, where
    for name in ("show", "debrief"):
        assert json.loads(console("records", name, run, *data, "--json").out)["setup"] == setup


def test_a_damaged_date_of_an_event_is_a_dash(tmp_path: Path) -> None:
    from console.text.recorded_words import clock, local

    damaged = datetime.min.replace(tzinfo=UTC)
    assert (local(damaged), clock(damaged)) == ("–", "–")


def test_a_row_that_a_compensation_makes_worse_is_told_to_cut_without(tmp_path: Path) -> None:
    """Plain 1.8 um; with the path of the model 5.8 um, again and again."""
    plain = replace(turned(), deviation_um=0.31 * turned(0.5).deviation_um)
    recorded(tmp_path, plain, made=replace(MADE, strategy="none"), strategy="none")
    stories = [recorded(tmp_path, turned()) for _ in range(3)]
    for found, advised in zip(stories, (False, True, True), strict=True):
        debrief = run_debrief(found, tmp_path)
        assert [each.code for each in debrief.worse] == ["learning.worse"] * advised
    assert debrief.diagnosis is not None and debrief.diagnosis.parts == 3
    said = dict(debrief_sections(debrief, load("en")))["Next time"]
    assert "cut without (--strategy none)" in said[0]
