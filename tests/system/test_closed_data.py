"""Data that this account may not read or write: every command says so in a line, and none ends as a fault."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from console.__main__ import main
from console.session.data.kept_files import jobs_folder
from console.session.data.records import RunRecord
from profiles.store import load_job, save_job
from tests.branching import in_a_copy
from tests.console.test_own_files import MACHINE
from tests.system.accounts import STRANGER, become, lathe_folder, needs_root
from tests.system.test_two_accounts import RUN

pytestmark = [pytest.mark.system, needs_root]

JOB, RUN_ID = "mine", "0"
READS = (
    *(("jobs",), ("lessons",), ("tries",), ("program", JOB), ("predict", JOB), ("report",), ("watch",)),
    *(("records", "list"), ("records", "show", RUN_ID), ("records", "debrief", RUN_ID)),
    *(("learn", "--list", "--job", JOB), ("replay", "--list"), ("config",)),
)
WRITES = (("records", "export", "OUT"), ("backup", "OUT.tar.gz"))


def closed(folder: Path) -> None:
    folder.chmod(0)


def unreadable_files(folder: Path) -> None:
    _rights(folder, 0o755, 0)


def read_only(folder: Path) -> None:
    _rights(folder, 0o555, 0o444)


def a_file(folder: Path) -> None:
    shutil.rmtree(folder)
    folder.write_text("no folder")


def _rights(folder: Path, of_folders: int, of_files: int) -> None:
    for each in (folder, *folder.rglob("*")):
        each.chmod(of_folders if each.is_dir() else of_files)


@pytest.fixture
def place() -> Iterator[Path]:
    """A folder that another account can enter, with the data of this one in `data`."""
    with lathe_folder() as shared:
        (data := shared.parent / "data").mkdir()
        jobs_folder(data).mkdir()
        save_job(replace(load_job("lee-2001-experiment-1").job, name=JOB), jobs_folder(data) / f"{JOB}.toml")
        record = RunRecord(data, {**RUN, "job": JOB, "machine": MACHINE.name})
        record.add("measured", {"job": JOB, "ront_um": 2.5})
        record.close()
        yield shared.parent


def written_to(out: Path, command: tuple[str, ...]) -> list[str]:
    return [word.replace("OUT", str(out)) for word in command]


def said(place: Path, command: tuple[str, ...], capfd: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """Return exit code and output of a command, by a stranger to the data."""
    told = place / "told"
    told.touch(mode=0o666)
    told.chmod(0o666)
    words = written_to(place / "out", command)

    def acts() -> None:
        become(STRANGER, 0o022)
        try:
            code = main([*words, "--data", str(place / "data")])
        except SystemExit as end:
            code = int(end.code or 0)
        told.write_text(str(code))

    in_a_copy(acts)
    out, err = capfd.readouterr()
    return int(told.read_text()), out + err


@pytest.mark.long
def test_every_command_says_what_is_closed(
    place: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(place))
    monkeypatch.chdir(place)
    # Once by this account: what the interpreter loads may be closed to the other.
    for command in (*READS, *WRITES):
        main([*written_to(place / "warm", command), "--data", str(place / "data")])
    (place / "out").mkdir(mode=0o700)
    (place / "data").rename(place / "kept")
    capfd.readouterr()
    for made in (closed, unreadable_files, read_only, a_file):
        shutil.copytree(place / "kept", place / "data")
        made(place / "data")
        for command in (*READS, *WRITES):
            code, output = said(place, command, capfd)
            facts = (made.__name__, command, output)
            assert code in (0, 1), facts
            assert "internal error" not in output and "Traceback" not in output, facts
            assert code == 0 or len(output.strip().splitlines()) <= 3, facts
        (place / "data").rename(place / made.__name__)


def test_a_file_in_place_of_the_folder_is_called_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "data").write_text("no folder")
    assert main(["jobs", "--data", str(tmp_path / "data")]) == 1
    assert "is a file" in capsys.readouterr().err


def test_records_that_may_only_be_read_are_read(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    main(["records", "list", "--data", str(place / "data")])
    capfd.readouterr()
    read_only(place / "data")
    code, output = said(place, ("records", "list"), capfd)
    assert code == 0 and JOB in output


def test_records_that_are_closed_are_called_so(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    main(["records", "list", "--data", str(place / "data")])
    capfd.readouterr()
    unreadable_files(place / "data")
    code, output = said(place, ("records", "list"), capfd)
    assert code == 1 and "closed to the account" in output and "records.sqlite3" in output
