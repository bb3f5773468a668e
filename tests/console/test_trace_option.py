"""`--trace FILE`: the whole dialogue with a controller, for a person to read."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from drivers.link.memory import MemoryLink
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_machine
from tests.console.commands import Console, JobFile

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


def test_without_room_for_it_nothing_begins(console: Console, job_file: JobFile, tmp_path: Path) -> None:
    job = str(job_file(cut_length_mm="0.5"))
    said = console("run", job, "--sim", "--trace", str(tmp_path))
    assert said.code == 1
    assert said.out == ""
    assert "Is a directory" in said.err.splitlines()[-1]


@pytest.mark.long
def test_a_trace_that_ends_is_told_once_and_the_job_goes_on(
    console: Console,
    close: tuple[str, str],
    job_file: JobFile,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
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
    console: Console, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...], asked: str
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


def test_without_room_for_it_no_controller_is_looked_for(
    console: Console, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[object] = []
    monkeypatch.setattr("console.cli.machine.card_access.open_link", opened.append)
    said = console("doctor", "--link", "tcp:lathe:1", "--trace", str(tmp_path))
    assert (said.code, said.out, opened) == (1, "", [])
    assert "Is a directory" in said.err
