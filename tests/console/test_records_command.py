"""`console records`: what was cut is found again; what an upgraded profile still holds for."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.cli.machine.run_cut import add_end
from console.session.cut.engine import NotAsPlannedError
from console.session.cut.run import roundness_of
from console.session.data import records
from console.session.data.learned_store import asked_for, choose_version, store, versions
from console.session.data.record_file import FILE_NAME
from console.session.data.records import RunRecord, add_to_run
from console.session.data.run_reader import runs, story
from console.session.data.run_rows import RunOutcome
from console.session.errors import SessionError
from console.session.stages import nominal_path
from console.text.columns import cell_width
from drivers.cutting.strategy import Strategy
from profiles.compensations.learned_compensation import HoldsFor, model_again
from profiles.problem import Problem
from profiles.store import LoadedMachine, load_job, load_machine
from profiles.traces import parse_trace
from tests.console.commands import Console, JobFile
from tests.console.floor import known
from tests.console.test_run_reader import RUN, USER, part


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    """Four runs: good, out of tolerance on another machine, stopped, and real."""
    folder = tmp_path / "kept"
    for job, machine, um, simulated in (
        ("ring", "lathe", 2.5, 1),
        ("ring", "other", 9.0, 1),
        ("a bar with quite a long name, 65 mm", "lathe", None, 1),
        ("ring", "lathe", 3.25, 0),
    ):
        run = RunRecord(folder, {**RUN, "job": job, "machine": machine, "simulated": simulated, "operator": "kim"})
        run.add("started", {})
        run.log.event("command", {"command": "Start", "by": "kim"})
        run.log.event("alarm_raised", {"code": "cut.out_of_phase", "priority": "high"})
        if um is None:
            run.add("stopped", {"reason": "space", "by": "kim", "turn": 12.3456})
        else:
            run.add("cut", {"turn": 90.0})
            run.add("measured", {}, part(um, diameter_mm=51.8, part="after"))
        run.close()
    return folder


def test_each_run_is_listed_with_its_result_and_what_is_simulated_says_so(console: Console, kept: Path) -> None:
    said_of = {
        "en": ("NOT within 5", "stopped (turn 12.3): Space, kim"),
        "ko": ("초과", "정지 (12.3 회전): 스페이스, kim"),
    }
    for lang, words in said_of.items():
        said = console("records", "list", "--data", str(kept), "--lang", lang)
        assert said.code == 0
        for word in (*words, "3.25", "9.00", "kim", "a bar with quite a long name, 65 mm"):
            assert word in said.out
        lines = said.out.splitlines()
        heads = [line for line in lines[2:] if not line.startswith(" ")]
        assert ["SIM" in head for head in heads] == [False, True, True, True]
        assert max(map(cell_width, lines)) <= 80
    fields = console("records", "list", "--data", str(kept), "--json").json
    assert [run["ront_um"] for run in fields["runs"]] == [3.25, None, 9.0, 2.5] and fields["more"] is False
    assert [run["simulated"] for run in fields["runs"]] == [False, True, True, True]


@pytest.mark.parametrize(("lang", "words"), [("en", "not proven"), ("ko", "진원도 3.2 um, 지름 39.2 um")])
def test_the_verdict_of_a_cut_is_shown(console: Console, tmp_path: Path, lang: str, words: str) -> None:
    """A part that is not judged may be one whose cut is not proven; a word of a stranger's record says nothing."""
    tool = {"roundness_um": 3.2, "size_um": 39.2}
    for verdict, told in (("not_proven", True), ("splendid", False)):
        run = RunRecord(tmp_path, {**RUN, "job": "ring"})
        run.add("started", {})
        run.add("cut", {"turn": 90.0, "cut_verdict": verdict, "tool": tool})
        run.close()
        newest = console("records", "list", "--data", str(tmp_path), "--json").json["runs"][0]["run"]
        said = console("records", "show", newest, "--data", str(tmp_path), "--lang", lang)
        assert said.code == 0 and (words in said.out) is told


def test_the_list_is_narrowed(console: Console, kept: Path) -> None:
    def found(*words: str) -> list[Any]:
        return [
            run["ront_um"]
            for run in console("records", "list", "--data", str(kept), "--json", *words).json["runs"]
        ]

    today, tomorrow = (datetime.now() + timedelta(days=days) for days in (0, 1))
    assert found("--job", "ring") == [3.25, 9.0, 2.5]
    assert found("--machine", "other") == [9.0]
    assert found("--failed") == [None, 9.0]
    assert found("--limit", "2") == [3.25, None]
    assert found("--since", f"{today:%Y-%m-%d}", "--until", f"{tomorrow:%Y-%m-%d}") == [3.25, None, 9.0, 2.5]
    assert found("--since", f"{tomorrow + timedelta(days=1):%Y-%m-%d}") == []
    assert found("--until", f"{today - timedelta(days=2):%Y-%m-%d}") == []
    assert "--limit N" in console("records", "list", "--data", str(kept), "--limit", "2").out
    for words in (("--since", "yesterday"), ("--limit", "0")):
        assert console("records", "list", *words).code == 2


def test_a_run_is_shown_in_full_by_the_beginning_of_its_id(console: Console, kept: Path) -> None:
    listed = console("records", "list", "--data", str(kept), "--json").json["runs"]
    said = console("records", "show", listed[0]["run"][:8], "--data", str(kept))
    assert max(map(cell_width, said.out.splitlines())) <= 80
    for word in (listed[0]["run"], "ring", "kim", "RONt 3.25 um", "D 51.800 mm", "start", "Alarms", "tool lag"):
        assert word in said.out
    fields = console("records", "show", listed[1]["run"], "--data", str(kept), "--json").json
    assert [event["kind"] for event in fields["events"]] and fields["ended"]["how"] == "stopped"
    assert [alarm["code"] for alarm in fields["alarms"]] == ["cut.out_of_phase"]
    refused = console("records", "show", "0123456789", "--data", str(kept))
    assert refused.code == 1 and "console records list" in refused.err


@pytest.mark.long
def test_a_cut_without_a_screen_is_found_and_taken_elsewhere(
    console: Console, close: tuple[str, str], job_file: JobFile, data_folder: Path, tmp_path: Path
) -> None:
    data, out, file = data_folder / "trilobe", tmp_path / "out", tmp_path / "part.csv"
    job = job_file(cut_length_mm="1.0")
    said = console("run", str(job), "--sim", *close, "--json", "--part", str(file))
    assert said.code == 0
    (run,) = console("records", "list", "--json").json["runs"]
    assert (run["ront_um"], run["passed"], run["operator"]) == (said.json["after"]["RONt_um"], True, USER)
    told = story(data, run["run"])
    assert [(each.part, each.product) for each in told.parts] == [("before", False), ("after", True)]
    assert told.job_text == job.read_text(encoding="utf-8") and told.complete and told.controller
    assert told.parts[1].trace == file.read_bytes()  # the same file as that of --part
    done = console("records", "export", str(out), "--traces", "--telemetry", "--json").json
    assert (done["runs"], done["files"], done["warnings"]) == (1, 6, [])
    (row,) = csv.DictReader((out / "runs.csv").read_text(encoding="utf-8").splitlines())
    assert (row["run"], row["simulated"], float(row["ront_um"])) == (run["run"], "True", run["ront_um"])
    (line,) = (out / "runs.jsonl").read_text(encoding="utf-8").splitlines()
    assert json.loads(line)["machine_text"] == told.machine_text
    trace = parse_trace(next(out.glob("SIM-*after.trace.csv")).read_bytes())
    assert roundness_of(trace).ront_um == run["ront_um"]
    whole = console("roundness", str(next(out.glob("SIM-*after.sections.csv"))), "--filter", "none", "--json").json
    assert whole["CYLt_um"] == pytest.approx(said.json["CYLt_um"], abs=0.05)
    table = np.genfromtxt(next(out.glob("SIM-*after.poll.csv")), delimiter=",", names=True, skip_header=3)
    assert np.array_equal(table["turn"].astype(np.float32), told.telemetry[1].column("turn"))
    again = console("records", "export", str(out))
    assert again.code == 1 and "exists" in again.err
    learned = console("learn", str(file), "--job", str(job), *close, "--keep")
    assert learned.code == 0, learned.err
    assert [event.data["version"] for event in story(data, run["run"]).accepted_steps] == [1]


def test_a_run_without_a_screen_says_how_it_ended_and_who_stopped_it(tmp_path: Path) -> None:
    early = SessionError(Problem(code="cut.ended_early"))
    early.__cause__ = NotAsPlannedError(Problem(code="cut.ended_early"), turns=7.0)
    ended = {
        RunOutcome.EARLY: (early, 7.0, "cut.ended_early", ""),
        RunOutcome.FAILED: (
            SessionError(Problem(code="session.busy")),
            None,
            str(Problem(code="session.busy")),
            "",
        ),
        RunOutcome.STOPPED: (
            SessionError(Problem(code="machine.stopped", value="SIGTERM")),
            None,
            "SIGTERM",
            "SIGTERM",
        ),
    }
    for error, *_ in ended.values():
        run = RunRecord(tmp_path, RUN)
        run.add("planned", {})
        add_end(run, error)
        run.close()
    listed = [row.ended for row in reversed(runs(tmp_path))]
    assert [(each.how, each.turn, each.reason, each.by) for each in listed] == [
        (how, turn, reason, by) for how, (_, turn, reason, by) in ended.items()
    ]


def test_without_free_space_no_run_is_started_and_a_damaged_record_is_refused(
    console: Console, job_file: JobFile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    new = tmp_path / "new"
    said = console("records", "list", "--data", str(new))
    assert (said.code, said.err) == (0, "") and "No recorded run" in said.out
    monkeypatch.setattr(records, "LEAST_FREE_BYTES", 10**18)
    said = console("run", str(job_file(cut_length_mm="0.5")), "--sim", "--data", str(new))
    assert (said.code, said.out, said.err.count("\n")) == (1, "", 1) and "are free" in said.err
    assert not (new / FILE_NAME).exists()
    (tmp_path / FILE_NAME).write_bytes(b"no database" * 500)
    refused = console("records", "list", "--data", str(tmp_path))
    assert refused.code == 1 and refused.err.count("\n") == 1


def test_a_name_that_would_control_the_terminal_is_escaped(console: Console, tmp_path: Path) -> None:
    run = RunRecord(tmp_path, {**RUN, "job": "ring\x1b[2J\nnext"})
    run.close()
    add_to_run(tmp_path, run.run_id, "measured", {}, part(1.0, trace_name="x\x1b]0;y.csv"))
    for words in (("list",), ("show", run.run_id)):
        said = console("records", *words, "--data", str(tmp_path))
        assert said.code == 0 and "\x1b" not in said.out


JOB = load_job("lee-2001-experiment-1")
THEN = load_machine("lee-2001-lathe")

BOUNDS = {
    r"^I111 = .*$": "I111 = 14000",  # fatal following error
    r"^I122 = .*$": "I122 = 40",  # jog speed
    r"^travel_min_mm = -2.0.*$": "travel_min_mm = -1.5",
    r"^jaw_stiffness_n_per_um = .*$": "jaw_stiffness_n_per_um = 60.0",
    r"^max_force_n = .*$": "max_force_n = 6000.0",
    r"^signed_by = .*$": 'signed_by = "somebody else"',
    r"^continuous_force_n = .*$": "continuous_force_n = 380.0",
}
"""What bounds or predicts a cut."""


def upgraded(folder: Path, changes: dict[str, str]) -> LoadedMachine:
    """The bundled lathe as a later release has it."""
    text = THEN.text
    for pattern, line in changes.items():
        text, count = re.subn(pattern, line, text, flags=re.MULTILINE)
        assert count == 1, pattern
    (folder / "lee-2001-lathe.toml").write_text(text)
    found = load_machine("lee-2001-lathe", folder)
    assert found.sha256 != THEN.sha256
    return found


def learned(data: Path, **changes: object) -> None:
    """A version that was learned with the release before."""
    holds = replace(asked_for(JOB, THEN, "cam", simulated=True), **changes)  # type: ignore[arg-type]
    store(data, model_again(holds, nominal_path(JOB.job, THEN.machine, Strategy.CAM), 1, "2026-05-01T08:00:00Z"))


def chosen_now(data: Path, machine: LoadedMachine) -> HoldsFor:
    asked = asked_for(JOB, machine, "cam", simulated=True)
    found = known(choose_version("newest", versions(data, asked), asked))
    return found.holds_for


def refused(data: Path, machine: LoadedMachine) -> str:
    with pytest.raises(SessionError) as error:
        chosen_now(data, machine)
    return error.value.problems[0].code


def test_bounds_and_predictions_that_an_upgrade_changes_end_nothing(tmp_path: Path) -> None:
    learned(tmp_path)
    assert chosen_now(tmp_path, upgraded(tmp_path, BOUNDS)).machine_sha256 == THEN.sha256


@pytest.mark.parametrize(
    "change",
    [
        {r"^I130 = .*$": "I130 = 400"},
        {r"^home_radius_mm = .*$": "home_radius_mm = 75.0"},
        {r"^force_per_torque_n_per_n_m = .*$": "force_per_torque_n_per_n_m = 300.0"},
    ],
)
def test_what_shapes_the_path_still_ends_it(tmp_path: Path, change: dict[str, str]) -> None:
    learned(tmp_path)
    assert refused(tmp_path, upgraded(tmp_path, BOUNDS | change)) == "learned.settings_changed"
