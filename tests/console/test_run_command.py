"""`console run`: from a saved job to a measured part, on both controllers, and the dialogue that it traces."""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pytest import MonkeyPatch

from drivers.link.memory import MemoryLink
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_job, load_machine, save_job
from tests.console.commands import Console, JobFile
from tests.system.lathe_sites import compact_text

FILTER_AT_3 = 0.99751
"""What the 50 UPR filter lets through of a three-lobe (ISO 16610-21 table)."""


SHORT_MM = "0.5"
"""A cut of 24 turns, for what is in each of them or in none."""


Run = Callable[..., dict[str, Any]]
"""With the words and the fields of the job, the result of a short cut close to the chuck."""


@pytest.fixture
def run(console: Console, close: tuple[str, str], job_file: JobFile) -> Run:
    def of_words(*words: str, **fields: str) -> dict[str, Any]:
        path = job_file(**{"cut_length_mm": SHORT_MM, **fields})
        result: dict[str, Any] = console("run", str(path), "--sim", *close, "--json", *words).json
        return result

    return of_words


def shorter(job: str, folder: Path) -> str:
    """Save a bundled job with a shorter cut."""
    path = folder / f"{job}.toml"
    save_job(replace(load_job(job).job, cut_length_mm=1.0), path)
    return str(path)


def harmonic(result: dict[str, Any], n: int) -> dict[str, float]:
    found: dict[str, float] = next(h for h in result["harmonics"] if h["n"] == n)
    return found


@pytest.mark.parametrize(
    ("job", "error_um", "amplitude_um"),
    [
        pytest.param("lee-2001-experiment-1", 55.0, 27.5, marks=pytest.mark.long),
        ("lee-2001-experiment-2", 33.0, 16.5),
    ],
)
def test_the_lobe_of_the_paper_is_measured_and_then_taken_away(
    console: Console, close: tuple[str, str], tmp_path: Path, job: str, error_um: float, amplitude_um: float
) -> None:
    # The first as it is, on the lathe that is there without being named; the second shorter and close together.
    words = (job,) if job == "lee-2001-experiment-1" else (shorter(job, tmp_path), *close)
    result = console("run", *words, "--sim", "--json", "--strategy", "pvt").json
    before, after = result["before"], result["after"]
    assert before["RONt_um"] == pytest.approx(error_um, abs=0.3)
    assert harmonic(before, 3)["amplitude_um"] == pytest.approx(amplitude_um * FILTER_AT_3, abs=0.02)
    assert after["RONt_um"] < 1.0
    assert result["improvement_percent"] == pytest.approx(
        100 * (1 - after["RONt_um"] / before["RONt_um"]), abs=1e-9
    )
    assert result["spindle_rpm"] == pytest.approx(1000, rel=1e-4)
    assert result["lobe_frequency_hz"] == pytest.approx(50, rel=1e-4)
    assert (result["job"], result["machine"], result["simulated"]) == (job, "lee-2001-lathe", True)
    for part in (before, after):
        assert (part["reference_circle"], part["filter_upr"], part["state"]) == ("LSC", 50, "free")


def test_a_simulated_part_is_measured_over_its_length(
    console: Console, close: tuple[str, str], tmp_path: Path
) -> None:
    """A shell of another method than the prediction's, on a lathe without other errors: no end is left off."""
    plant = tmp_path / "shell.toml"
    plant.write_text("[chuck]\njaw_stiffness = 300.0\n", encoding="utf-8")
    job = shorter("lee-2001-experiment-1", tmp_path)
    result = console("run", job, "--sim", "--plant", str(plant), *close, "--json", "--strategy", "cam").json
    heights = [each["z_mm"] for each in result["sections"]]
    assert len(heights) == 5 and heights == sorted(heights)
    assert all(each["RONt_um"] < 1.0 for each in result["sections"])
    assert max(each["RONt_um"] for each in result["sections"]) <= result["CYLt_um"] + 1e-6
    assert {"taper_um", "axis_straightness_um", "generatrix_straightness_um", "crown_um"} <= set(result)


@pytest.mark.long
def test_tool_and_following_error_differ(run: Run) -> None:
    """The command runs ahead of the tool by the lag of the servo; the tool is where the part wants it."""
    result = run()
    assert result["tool_error_um"] < 2.0
    # |1 - T| of the command: 31.05 um times |1 - 0.8855 exp(-0.9023j)|.
    assert result["following_error_um"] == pytest.approx(31.05 * 0.8294, abs=1.5)


def test_the_printed_program_is_slow_and_short(
    console: Console, close: tuple[str, str], job_file: JobFile
) -> None:
    said = console("run", str(job_file(cut_length_mm=SHORT_MM)), "--sim", *close, "--json", "--strategy", "paper")
    result = said.json
    assert result["spindle_rpm"] == pytest.approx(500, rel=1e-4)
    assert result["lobe_frequency_hz"] == pytest.approx(25, rel=1e-4)
    told = " ".join(result["warnings"])
    assert "20 ms" in told
    assert "500 rpm" in told
    assert "36.67 um (66.7 %)" in told
    assert result["segment_ms"] == 20
    for warning in result["warnings"]:
        assert warning in said.err
    # 0.657 of the lobe through the sampled loop at 25 Hz: 55 |1 - 0.657 T(25 Hz)|.
    assert result["after"]["RONt_um"] == pytest.approx(28, abs=1.0)


@pytest.mark.long
def test_a_part_whose_lobe_is_hardly_any_at_its_free_end_is_cut_and_measured(
    console: Console, close: tuple[str, str]
) -> None:
    """The thin tube of the paper: where its lobe is small friction takes all of it, and nobody moved the tool."""
    words = ("--sim", "--plant", "steady", "--seed", "1", "--strategy", "pvt", "--json")
    result = console("run", "lee-2001-experiment-2", *close, *words).json
    assert result["cut_verdict"] == "tool_error" and len(result["sections"]) == 5


@pytest.mark.long
def test_ts_5_reaches_the_speed_but_not_the_stroke(run: Run) -> None:
    result = run("--strategy", "paper", "--ts", "5")
    assert result["spindle_rpm"] == pytest.approx(1000, rel=1e-4)
    assert "36.67 um (66.7 %)" in " ".join(result["warnings"])
    assert result["segment_ms"] == 10
    assert "10 ms" not in " ".join(result["warnings"])
    # 55 |1 - 0.657 x 0.8855 exp(-0.9023j)| = 43.2.
    assert result["after"]["RONt_um"] == pytest.approx(43.2, abs=1.0)


def test_uncompensated_nothing_is_gained(run: Run) -> None:
    result = run("--strategy", "none")
    assert result["before"] == result["after"]
    assert result["improvement_percent"] == 0
    assert result["collisions"] == []


@pytest.mark.long
def test_a_four_jaw_chuck_does_what_it_says(run: Run) -> None:
    size = {"spindle_speed_rpm": "730.0", "diameter_mm": "53.0"}
    result = run(jaws="4", lobe_error_um_pp="20.0", lobe_phase_deg="17.0", **size)
    before = result["before"]
    assert before["RONt_um"] == pytest.approx(20.0, abs=0.3)
    assert harmonic(before, 4)["amplitude_um"] == pytest.approx(10.0, abs=0.1)
    assert harmonic(before, 4)["phase_deg"] == pytest.approx(17.0, abs=0.1)
    assert harmonic(before, 3)["amplitude_um"] < 0.05
    assert result["after"]["RONt_um"] < 1.0
    assert result["spindle_rpm"] == pytest.approx(730, rel=1e-4)
    assert result["lobe_frequency_hz"] == pytest.approx(730 * 4 / 60, rel=1e-4)


@pytest.mark.parametrize(
    ("rpm", "jaws"),
    [pytest.param(173.0, 3, marks=pytest.mark.long), pytest.param(2400.0, 2, marks=pytest.mark.long), (601.3, 6)],
)
def test_any_permitted_speed_is_compensated(run: Run, rpm: float, jaws: int) -> None:
    part = {"material": '"A6061"', "chucking_force_n": "2500.0", "lobe_force_n": "2500.0", "cut_length_mm": "2.0"}
    cut = {"spindle_speed_rpm": str(rpm), "lobe_error_um_pp": "12.5", "feed_mm_per_rev": "0.2"}
    result = run(jaws=str(jaws), **part, **cut)
    assert result["before"]["RONt_um"] == pytest.approx(12.5, abs=0.3)
    assert result["after"]["RONt_um"] < 1.0


def test_the_same_command_tells_people_the_same_and_no_line_of_its_record_can_be_changed(
    console: Console, close: tuple[str, str], job_file: JobFile, data_folder: Path
) -> None:
    words = ("run", str(job_file(cut_length_mm=SHORT_MM, roundness_tolerance_um="10.0")), "--sim", *close)
    said, again = console(*words), console(*words)
    assert (said.code, said.err) == (0, "")
    for word in ("load program", "home and align", "arm", "cut", "retract", "measure", "um", "rpm", "LSC", "free"):
        assert word in said.out
    assert "not machined" in said.out and again.out == said.out
    database = sqlite3.connect(data_folder / "trilobe" / "records.sqlite3")
    row = database.execute("SELECT job, simulated, strategy, length(job_sha256), program FROM runs").fetchone()
    assert row[:4] == ("lee-2001-experiment-1", 1, "pvt", 64)
    assert "OPEN PROG 2" in row[4]
    kinds = [kind for (kind,) in database.execute("SELECT kind FROM events ORDER BY rowid")]
    steps = [kind for kind in kinds if kind != "telemetry"]  # that is written beside the others
    assert steps == ["planned", *[*["step"] * 7, "part"] * 2, "result"] * 2
    assert kinds.count("telemetry") == 4
    for change in ("UPDATE runs SET job = 'x'", "DELETE FROM events", "UPDATE events SET data = ''"):
        with pytest.raises(sqlite3.IntegrityError, match="append only"):
            database.execute(change)
    database.close()


@pytest.mark.long
def test_people_are_told_in_korean(console: Console, close: tuple[str, str], job_file: JobFile) -> None:
    job = str(job_file(cut_length_mm=SHORT_MM))
    said = console("run", job, "--sim", *close, "--lang", "ko", "--strategy", "paper")
    assert "보상 전" in said.out
    assert "경고" in said.err


def test_without_a_record_nothing_is_started(console: Console, job_file: JobFile, tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    said = console("run", str(job_file(roundness_tolerance_um="10.0")), "--sim", "--data", str(blocked))
    assert said.code == 1
    assert said.out == ""
    assert "--data" in said.err
    assert said.err.count("\n") == 1


@pytest.mark.parametrize(("language", "word"), [("en", "deeper"), ("ko", "충돌")])
@pytest.mark.first(1)
def test_what_the_tool_ran_into_is_told(
    console: Console, close: tuple[str, str], job_file: JobFile, monkeypatch: MonkeyPatch, language: str, word: str
) -> None:
    """A tool that takes nothing, put to an ordinary cut."""
    path = str(job_file(cut_length_mm=SHORT_MM))
    words = ("run", path, "--sim", *close, "--strategy", "none", "--lang", language)
    monkeypatch.setattr("drivers.simulator.plant.collision.TOOL_TAKES_MM", -0.05)
    assert any(word in line for line in console(*words).out.splitlines())
    if language == "en":
        assert console(*words, "--json").json["collisions"] == ["too_deep"]


def takes_the_lobe_away(result: dict[str, Any]) -> None:
    assert (result["machine"], result["simulated"]) == ("turbo-ethernet-lathe", True)
    assert (result["collisions"], result["warnings"]) == ([], [])
    assert result["before"]["RONt_um"] == pytest.approx(55.0, abs=0.3)
    assert result["after"]["RONt_um"] < 1.0
    assert result["spindle_rpm"] == pytest.approx(1000, rel=1e-4)


def lathe_of(family: str, folder: Path) -> str:
    """Save the bundled machine of a family with short ways."""
    path = folder / f"{family}.toml"
    path.write_text(compact_text(family), encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("strategy", ["cam", "timebase"])
@pytest.mark.long
def test_a_turbo_takes_the_lobe_away(console: Console, job_file: JobFile, tmp_path: Path, strategy: str) -> None:
    """By the table on the bundled machine as it is."""
    path = job_file(cut_length_mm="0.5", roundness_tolerance_um="10.0")
    machine = "turbo-ethernet-lathe" if strategy == "cam" else lathe_of("turbo", tmp_path)
    words = ("--sim", "--json", "--machine", machine, "--strategy", strategy)
    takes_the_lobe_away(console("run", str(path), *words).json)


@pytest.mark.long
def test_both_controllers_leave_the_same_part(console: Console, job_file: JobFile, tmp_path: Path) -> None:
    path = str(job_file(cut_length_mm="0.5", roundness_tolerance_um="10.0"))
    parts = [
        console("run", path, "--sim", "--json", "--machine", lathe_of(family, tmp_path), "--strategy", "pvt").json
        for family in ("pmac", "turbo")
    ]
    paper, turbo = parts
    takes_the_lobe_away(turbo)
    for part in ("before", "after"):
        assert turbo[part]["RONt_um"] == pytest.approx(paper[part]["RONt_um"], abs=0.1)
    assert turbo["tool_error_um"] == pytest.approx(paper["tool_error_um"], abs=0.1)


JOB = "lee-2001-experiment-1"
LINE = re.compile(r"\d+\.\d{3} [><!*] \S.*")


def test_a_job_is_traced_from_the_first_flush_to_the_end(
    console: Console, close: tuple[str, str], job_file: JobFile, tmp_path: Path
) -> None:
    path = tmp_path / "trace"
    said = console("run", str(job_file(cut_length_mm="0.5")), "--sim", *close, "--json", "--trace", str(path))
    assert (said.code, said.err) == (0, "")
    first, *lines = path.read_text(encoding="utf-8").splitlines()
    assert re.fullmatch(rf"# \S+ run {JOB}", first)
    assert [line for line in lines if not LINE.fullmatch(line)] == []
    assert lines[0].endswith("> [^X]")
    asked = [line.split(" > ", 1)[1] for line in lines if " > " in line]
    # Both parts were connected to, a program was loaded, and run.
    assert asked.count("[^X]") >= 2
    assert "VERSION TYPE" in asked or "VERSION" in asked
    assert any(line.startswith("OPEN PROG") for line in asked)
    assert "CLOSE" in asked
    assert any(line.endswith("< [ACK]") for line in lines)


def test_without_room_for_a_trace_nothing_begins_and_no_controller_is_met(
    console: Console, job_file: JobFile, tmp_path: Path, monkeypatch: MonkeyPatch
) -> None:
    opened: list[object] = []
    monkeypatch.setattr("console.cli.machine.card_access.open_link", opened.append)
    for words in (("run", str(job_file(cut_length_mm="0.5")), "--sim"), ("doctor", "--link", "tcp:lathe:1")):
        said = console(*words, "--trace", str(tmp_path))
        assert (said.code, said.out, opened) == (1, "", [])
        assert "Is a directory" in said.err.splitlines()[-1]


@pytest.mark.long
def test_a_trace_that_ends_is_told_once_and_the_job_goes_on(
    console: Console, close: tuple[str, str], job_file: JobFile, tmp_path: Path, monkeypatch: MonkeyPatch
) -> None:
    from drivers.link.tracing import TraceFile

    written = 0

    def write(file: TraceFile, line: str) -> None:
        nonlocal written
        written += 1
        if written > 100:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(TraceFile, "write", write)
    job = str(job_file(cut_length_mm="0.5"))
    said = console("run", job, "--sim", *close, "--json", "--trace", str(tmp_path / "trace"))
    assert said.code == 0
    assert [("No space left" in line) for line in said.err.splitlines()].count(True) == 1
    assert said.json["after"]["RONt_um"] < 1.0
    assert [warning for warning in said.json["warnings"] if "No space left" in warning] != []


@pytest.mark.parametrize(
    ("command", "asked"),
    [(("doctor",), "I10"), (("controller", "verify"), "I10"), (("controller", "backup", "{file}"), "LIST PLC1")],
    ids=["doctor", "verify", "backup"],
)
def test_what_looks_at_a_controller_is_traced_as_well(
    console: Console, tmp_path: Path, monkeypatch: MonkeyPatch, command: tuple[str, ...], asked: str
) -> None:
    sim = SimulatedLathe(load_machine("lee-2001-lathe").machine)
    monkeypatch.setattr("console.cli.machine.card_access.open_link", lambda _: MemoryLink(sim.connect(), sim))
    path = tmp_path / "trace"
    words = [word.format(file=tmp_path / "card.pmac") for word in command]
    said = console(*words, "--link", "tcp:lathe:1", "--trace", str(path))
    assert (said.out != "", said.err) == (True, "")
    first, *lines = path.read_text(encoding="utf-8").splitlines()
    assert re.fullmatch(rf"# \S+ {command[0]} lee-2001-lathe", first)
    assert [line for line in lines if not LINE.fullmatch(line)] == []
    assert any(" > " in line and asked in line for line in lines)
    assert any(line.endswith("< [ACK]") for line in lines)
