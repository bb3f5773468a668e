"""What is recorded reads the same everywhere: log, `console records`, page Records, report and debrief."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from console.report.page import report_page
from console.report.reported_run import reported_run
from console.session.data import run_facts
from console.session.data.records import RunRecord
from console.session.data.run_reader import RunStory
from console.session.data.run_rows import problem_events
from console.session.learning.learning_record import learning_event
from console.session.learning.part_learning import PartLearning
from console.session.learning.run_debrief import run_debrief
from console.session.station.commands import Command
from console.session.station.history.session_log import SessionLog, command_entry, with_state
from console.text.catalogue import LANGUAGES, Catalogue, load
from console.text.run_debrief import debrief_sections
from console.tui.further.log_lines import entry_words
from console.tui.records.opened_run import opened_run
from console.tui.records.run_lines import story_lines
from profiles.problem import Problem
from tests.architecture.test_catalogues import catalogue
from tests.console.commands import Console
from tests.console.test_run_debrief import MADE, recorded, turned
from tests.tui.stage import lathe

NAMES = sorted(each.__name__ for each in Command.__subclasses__())
AT = datetime(2026, 3, 4, 5, 6, tzinfo=UTC)
BRIEF = Problem(code="cut.off_path", key="tool", value="12.5 um", limit="2.0 um", where="3.1 mm")
CHANGED = Problem(code="learned.changed_in_cut", value="override 97 %")


def page_words(data: Path, found: RunStory, text: Catalogue) -> str:
    run = opened_run(data, found.row.run_id, lathe())
    return " ".join("".join(piece for piece, _ in row).strip() for row in story_lines(run, text, 100))


def report_words(data: Path, found: RunStory, text: Catalogue) -> str:
    return report_page(reported_run(found, (), debrief=run_debrief(found, data)), text)


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


def test_an_early_end_of_an_older_console_has_the_figures_of_its_alarm_or_says_that_it_has_none(
    tmp_path: Path,
) -> None:
    codes: dict[str, object] = {"reasons": ["cut.off_path"]}
    found = recorded(tmp_path, None, tell=ended_early(codes, BRIEF))
    assert "was briefly 12.5 um off its path" in page_words(tmp_path, found, load("en"))
    bare = recorded(tmp_path, None, tell=ended_early(codes))
    told = page_words(tmp_path, bare, load("en"))
    assert "… was briefly … off its path" in told and "– was briefly" not in told


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
    assert debrief.fails_round and debrief.causes == ()
    told = " ".join(row for _, rows in debrief_sections(debrief, load("en")) for row in rows)
    assert "too much." in told and "Most likely" not in told
    assert "override 97 %" in told, "why it is not known"
    explained = run_debrief(recorded(tmp_path, turned()), tmp_path)
    rows = [row for _, rows in debrief_sections(explained, load("en")) for row in rows]
    assert rows[0].endswith("Most likely, largest first:")


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


def test_a_fact_is_one_row_and_its_words_for_page_command_report_and_debrief(
    tmp_path: Path, console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    row = ("coolant", run_facts.Kind.TEXT, "coolant", "coolant_at")
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


def test_the_set_up_of_an_older_console_is_known_everywhere(tmp_path: Path, console: Console) -> None:
    """It kept the forces with the event that armed the run, which only the report read."""
    found = recorded(tmp_path, turned(), setup=None)
    shown = console("records", "show", found.row.run_id, "--data", str(tmp_path)).out
    assert "1314 N" in shown
    assert "1314.0 N" in page_words(tmp_path, found, load("en"))
    assert "1314.0 N" in report_words(tmp_path, found, load("en"))


def test_a_damaged_date_of_an_event_is_a_dash(tmp_path: Path) -> None:
    from console.text.recorded_words import clock, local

    damaged = datetime.min.replace(tzinfo=UTC)
    assert (local(damaged), clock(damaged)) == ("–", "–")
