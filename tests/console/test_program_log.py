"""The log of the program: what was called and what went wrong, in a folder that is there, by several processes."""

from __future__ import annotations

import logging
import os
import re
import stat
from argparse import Namespace
from pathlib import Path

import pytest

from console.cli.logged import carried_out
from console.cli.measured import records
from console.session import program_log
from console.session.program_log import FILE, FOLDER, note
from tests.console.commands import Console

LINE = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z (INFO|WARNING|ERROR) +\d+ .*")


def lines(data: Path) -> list[str]:
    return (data / FOLDER / FILE).read_text(encoding="utf-8").splitlines()


def test_a_command_that_works_a_machine_is_in_it_with_its_end(console: Console, tmp_path: Path) -> None:
    assert console("run", "no-such-job", "--sim", "--data", str(tmp_path)).code == 1
    begin, refused, end = lines(tmp_path)
    assert all(LINE.fullmatch(line) for line in (begin, refused, end))
    assert begin.endswith(f" begin  run no-such-job --sim --data {tmp_path}")
    assert "WARNING" in refused and "job.unknown" in refused
    assert re.search(r" INFO +\d+ end  exit code 1  trilobe \d", end)


def test_reading_leaves_nothing_and_no_folder_is_made(console: Console, tmp_path: Path) -> None:
    assert console("jobs", "--data", str(tmp_path)).code == 0
    assert os.listdir(tmp_path) == []
    assert console("run", "no-such-job", "--sim", "--data", str(tmp_path / "new")).code == 1
    assert not (tmp_path / "new").exists()


def test_a_fault_of_the_program_is_in_it_with_its_traceback_and_on_the_terminal_without(
    console: Console, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> int:
        raise RuntimeError("one\x1b[2J\ntwo")

    monkeypatch.setattr(records, "main", broken)
    said = console("records", "list", "--data", str(tmp_path))
    assert said.code == 1 and "Traceback" not in said.err
    text = (tmp_path / FOLDER / FILE).read_text(encoding="utf-8")
    assert "Traceback (most recent call last)" in text and "RuntimeError: one" in text and "\x1b" not in text
    assert [line for line in text.splitlines() if not LINE.fullmatch(line) and not line.startswith("    ")] == []


@pytest.mark.parametrize(("command", "logged"), [("jobs", ""), ("ship", "end  BrokenPipeError, exit code 1")])
def test_a_reader_that_has_gone_as_behind_head_is_no_fault(command: str, logged: str, tmp_path: Path) -> None:
    def unread() -> int:
        raise BrokenPipeError

    with pytest.raises(BrokenPipeError):
        carried_out(unread, Namespace(command=command, data=tmp_path), [command])
    log = tmp_path / FOLDER / FILE
    text = log.read_text(encoding="utf-8") if log.exists() else ""
    assert logged in text and "fault" not in text and "Traceback" not in text


@pytest.mark.rings
@pytest.mark.parametrize(
    "given",
    [("--shop", "host=x password=geheim"), ("--shop=postgresql://a:geheim@x/shop",), ("--sho", "password=geheim")],
)
def test_no_password_of_a_shop_is_in_it(console: Console, tmp_path: Path, given: tuple[str, ...]) -> None:
    assert console("ship", *given, "--once", "--data", str(tmp_path)).code != 0
    log = tmp_path / FOLDER / FILE
    text = log.read_text(encoding="utf-8") if log.exists() else ""  # wrong usage is not logged
    assert "geheim" not in text and ("begin  ship" in text or given[0] == "--sho")


@pytest.mark.rings
def test_nor_where_the_program_fails(console: Console, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> int:
        raise RuntimeError("broken")

    monkeypatch.setattr(records, "main", broken)
    console("records", "list", "--shop", "password=geheim", "--data", str(tmp_path))
    text = (tmp_path / FOLDER / FILE).read_text(encoding="utf-8")
    assert "fault" in text and "geheim" not in text


def test_it_rotates_and_keeps_so_many(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(program_log, "MOST_BYTES", 500)
    for number in range(60):
        note(tmp_path, f"line {number:04d}")
    names = sorted(os.listdir(tmp_path / FOLDER))
    assert names == ["lock", FILE, *(f"{FILE}.{number}" for number in range(1, 6))]
    assert all((tmp_path / FOLDER / name).stat().st_size <= 500 for name in names)
    assert lines(tmp_path)[-1].endswith("line 0059")
    assert {stat.S_IMODE((tmp_path / FOLDER / name).stat().st_mode) for name in names} == {0o600}


def test_processes_write_whole_lines_beside_each_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(program_log, "WAIT_S", 30.0)  # a busy computer loses none here
    children = []
    for _ in range(4):
        if (pid := os.fork()) == 0:
            for number in range(25):
                note(tmp_path, f"{number} " + "x" * 200, level=logging.WARNING)
            os._exit(0)
        children.append(pid)
    for pid in children:
        os.waitpid(pid, 0)
    found = lines(tmp_path)
    assert len(found) == 100 and all(LINE.fullmatch(line) for line in found)


@pytest.mark.parametrize("in_the_way", [FOLDER, f"{FOLDER}/{FILE}/folder"])
def test_what_cannot_be_written_is_no_fault(in_the_way: str, tmp_path: Path, console: Console) -> None:
    path = tmp_path / in_the_way
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("")
    said = console("run", "no-such-job", "--sim", "--data", str(tmp_path))
    assert said.code == 1 and said.err.count("\n") == 1
