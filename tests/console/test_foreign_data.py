"""A data folder, an archive or records of somebody else: nothing waits, swells or is run, and all is named."""

from __future__ import annotations

import csv
import gzip
import io
import os
import signal
import sqlite3
import subprocess
import tarfile
import zlib
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from pytest import MonkeyPatch

from console.cli.machine.doctor_checks import data_folder_checks, library_checks, loses_wal_reset
from console.escaping import csv_table
from console.flight.ring import whole_lines
from console.session.data import restore
from console.session.data.backup import back_up
from console.session.data.record_file import BESIDE_RECORDS, FILE_NAME
from console.session.data.records import add_to_run
from console.session.data.restore import MOST_HEADER_BYTES, check_archive
from console.session.data.run_reader import runs, story
from console.session.data.run_story import MOST_TRACE_BYTES
from console.session.errors import SessionError
from console.session.program_log import FILE, FOLDER, LOCK, note
from console.session.station.machine_control import LOG_NAME
from console.site.study.running import NAME, journal
from drivers.simulator.machine import SimulatedLathe
from profiles.files import MOST_DEPTH, remove_all_left
from profiles.findings import Severity
from profiles.problem import ProblemError
from profiles.store import load_machine
from tests.branching import in_a_copy
from tests.console.commands import Console
from tests.console.consoles import MACHINE, console_of
from tests.console.test_backup import code_of, entries, entry, packed
from tests.console.test_run_reader import part, record


def within(seconds: int, act: Callable[[], None]) -> None:
    """Do something in a copy of this process, which is killed if it waits, such as for the other end of a pipe."""

    def limited() -> None:
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(seconds)
        act()

    in_a_copy(limited)


def code(act: Callable[[], object]) -> str:
    with pytest.raises(ProblemError) as refused:
        act()
    return refused.value.problems[0].code


# Archives


def test_a_clone_goes_into_no_backup_and_out_of_no_archive(console: Console, tmp_path: Path) -> None:
    data, file, old = tmp_path / "data", tmp_path / "b.tar.gz", tmp_path / "old.tar.gz"
    for name in ("jobs/ring.toml", ".git/config", "import/there/.git/hooks/post-checkout", ".GIT/config"):
        (data / name).parent.mkdir(parents=True, exist_ok=True)
        (data / name).write_text("of somebody else\n")
    said = console("backup", str(file), "--data", str(data), "--json")
    assert (said.code, said.json["files"], len(said.json["warnings"])) == (0, 1, 3)
    assert not any(".git" in found.name.lower() for found, _ in entries(file))
    written_by_an_older_console(data, old)
    said = console("restore", str(old), "--data", str(tmp_path / "new"), "--json")
    assert (said.code, said.json["files"], len(said.json["warnings"])) == (0, 1, 3)
    assert "again" in said.json["warnings"][0] and ".git" in said.err.lower()
    restored = [path.relative_to(tmp_path / "new").as_posix() for path in (tmp_path / "new").rglob("*")]
    assert sorted(restored) == ["import", "import/there", "jobs", "jobs/ring.toml"]


def written_by_an_older_console(data: Path, archive: Path) -> None:
    from console.session.data import backup_format

    with MonkeyPatch.context() as patched:
        patched.setattr(backup_format, "is_of_clone", lambda path: False)
        back_up(data, archive)


def test_an_archive_of_thousands_of_nested_folders_is_refused(tmp_path: Path) -> None:
    (place := tmp_path / "place").mkdir()
    nested = ["data/" + "/".join(["d"] * depth) for depth in range(1, 2001)]
    packed(tmp_path / "deep.tar.gz", [entry(name, tarfile.DIRTYPE) for name in nested])
    assert code_of(tmp_path / "deep.tar.gz", place) == "restore.unsafe"
    (data := tmp_path / "data").mkdir()
    deepest = data.joinpath(*["d"] * (MOST_DEPTH + 1))
    deepest.mkdir(parents=True)
    _, left_out = back_up(data, tmp_path / "b.tar.gz")
    assert [problem.code for problem in left_out] == ["backup.left_out"]
    assert len(check_archive(tmp_path / "b.tar.gz").folders) == MOST_DEPTH


def test_thousands_of_nested_folders_in_a_shared_folder_end_no_command(tmp_path: Path) -> None:
    def acts() -> None:
        os.chdir(tmp_path)
        for _ in range(1500):
            os.mkdir("d")
            os.chdir("d")
        remove_all_left(tmp_path)
        assert [check.code for check in data_folder_checks(tmp_path)] == ["data_folder_private"]

    try:
        in_a_copy(acts)
    finally:  # Python itself cannot remove them
        subprocess.run(["rm", "-rf", str(tmp_path / "d")], check=True)


@pytest.mark.parametrize("kind", [tarfile.XHDTYPE, tarfile.XGLTYPE, tarfile.GNUTYPE_LONGNAME])
def test_a_header_that_swells_is_refused_before_it_is_read(kind: bytes, tmp_path: Path) -> None:
    (place := tmp_path / "place").mkdir()
    header = tarfile.TarInfo("data/jobs")
    header.type, header.size = kind, 2_000_000_000  # of which there are none behind it
    (tmp_path / "wide.tar.gz").write_bytes(gzip.compress(header.tobuf() + bytes(10 * MOST_HEADER_BYTES)))
    assert code_of(tmp_path / "wide.tar.gz", place) in ("restore.not_backup", "restore.damaged")
    with pytest.raises(ProblemError, match="a header of 2000000000 bytes"):
        restore.restore(tmp_path / "wide.tar.gz", place / "again")


# Records


def traced(folder: Path, *sizes: int) -> str:
    run_id = record(folder, *[2.0] * len(sizes))
    with closing(sqlite3.connect(folder / FILE_NAME, isolation_level=None)) as database:
        database.execute("DROP TRIGGER traces_are_kept")
        database.execute("DELETE FROM traces")
        for number, size in enumerate(sizes, start=1):
            database.execute(
                "INSERT INTO traces VALUES (?, ?, ?)", (run_id, number, zlib.compress(bytes(size), 9))
            )
    return run_id


def test_a_trace_that_swells_is_left_out_of_everything_that_reads_a_run(console: Console, tmp_path: Path) -> None:
    run_id = traced(tmp_path, 100, 200_000_000)
    assert (tmp_path / FILE_NAME).stat().st_size < 2_000_000
    whole, swelling = story(tmp_path, run_id).parts
    assert (len(whole.trace or b""), swelling.trace) == (100, None)
    assert story(tmp_path, run_id).damaged == ("trace 2",)
    said = console("records", "show", run_id, "--data", str(tmp_path))
    assert said.code == 0 and "trace 2" in said.out


def test_many_traces_do_not_swell_together_either(tmp_path: Path) -> None:
    found = story(tmp_path, traced(tmp_path, *[19_000_000] * 7))
    assert sum(len(each.trace or b"") for each in found.parts) <= MOST_TRACE_BYTES
    assert found.damaged == ("trace 6", "trace 7")


@pytest.mark.parametrize(
    "made",
    [
        "CREATE TRIGGER also AFTER INSERT ON events BEGIN SELECT 1; END",
        "CREATE VIEW also AS SELECT zeroblob(900000000)",
        "CREATE VIRTUAL TABLE also USING fts5(a)",
    ],
)
def test_records_that_do_something_when_they_are_read_are_refused(made: str, tmp_path: Path) -> None:
    run_id = record(tmp_path, 2.0)
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as database:
        database.execute(made)
        database.commit()
    assert code(lambda: runs(tmp_path)) == code(lambda: story(tmp_path, run_id)) == "record.damaged"
    assert code(lambda: record(tmp_path, 3.0)) == "record.damaged"


def test_records_of_0_bytes_are_not_taken_for_new_ones(console: Console, tmp_path: Path) -> None:
    record(tmp_path, 2.0)
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as holds_the_journal:
        holds_the_journal.execute("SELECT count(*) FROM runs")
        os.truncate(tmp_path / FILE_NAME, 0)
        beside = sorted(path.name for path in tmp_path.glob("records*"))
        assert code(lambda: runs(tmp_path)) == code(lambda: record(tmp_path, 3.0)) == "record.empty"
        assert code(lambda: back_up(tmp_path, tmp_path.with_suffix(".gz"))) == "record.empty"
        assert sorted(path.name for path in tmp_path.glob("records*")) == beside
    for lang, words in (("en", "Restore it from a backup"), ("ko", "백업에서 복원")):
        said = console("records", "list", "--data", str(tmp_path), "--lang", lang)
        assert said.code == 1 and words in said.err


def test_a_console_that_is_killed_while_it_makes_the_records_leaves_none(tmp_path: Path) -> None:
    from console.session.data import record_file

    with MonkeyPatch.context() as patched:
        patched.setattr(record_file, "connect_records", lambda *_: os._exit(0))
        child = os.fork()
        if not child:
            try:
                record(tmp_path, 2.0)
            finally:
                os._exit(1)
    assert os.waitpid(child, 0)[1] == 0
    assert (tmp_path / FILE_NAME).stat().st_size > 0 and runs(tmp_path) == ()
    record(tmp_path, 2.0)
    assert len(runs(tmp_path)) == 1


# Names in a shared folder that are no files


def pipe_at(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    os.mkfifo(path)
    return path


@pytest.mark.parametrize("name", [FILE, LOCK])
def test_nothing_in_place_of_the_program_log_delays(console: Console, tmp_path: Path, name: str) -> None:
    place = pipe_at(tmp_path / "data" / FOLDER / name)
    secret = tmp_path / "secret"
    secret.write_text("mine\n")
    secret.chmod(0o600)

    def acts() -> None:
        note(tmp_path / "data", "hello")
        assert console("run", "no-such-job", "--sim", "--data", str(tmp_path / "data")).code == 1

    for put in (os.mkfifo, lambda path: os.symlink(secret, path), lambda path: os.symlink("/dev/zero", path)):
        place.unlink()
        put(place)
        within(10, acts)
    assert (secret.read_text(), secret.stat().st_mode & 0o777) == ("mine\n", 0o600)


@pytest.mark.parametrize("name", [FILE_NAME, *BESIDE_RECORDS])
def test_a_pipe_in_place_of_the_records_is_named(console: Console, tmp_path: Path, name: str) -> None:
    record(tmp_path, 2.0)
    run_id = runs(tmp_path)[0].run_id
    pipe_at(tmp_path / name)

    def acts() -> None:
        assert code(lambda: record(tmp_path, 3.0)) == "record.unwritable"
        assert code(lambda: runs(tmp_path)) == "record.not_readable"
        said = console("records", "list", "--data", str(tmp_path))
        assert said.code == 1 and "not a regular file" in said.err
        with pytest.raises(SessionError):
            add_to_run(tmp_path, run_id, "measured", {}, part(1.0))

    within(10, acts)


def test_a_pipe_in_place_of_other_shared_files_delays_nothing(tmp_path: Path) -> None:
    def acts() -> None:
        machine = load_machine(MACHINE).machine
        pipe_at(tmp_path / LOG_NAME)
        console_of(SimulatedLathe(machine), machine, tmp_path).owning.take_control()  # which is logged
        assert list(whole_lines([pipe_at(tmp_path / "1.segment")])) == []
        with (
            pytest.raises(ProblemError, match=r"file\.not_writable"),
            journal(pipe_at(tmp_path / NAME).parent, ""),
        ):
            pass


# Tables


def test_what_a_spreadsheet_would_calculate_is_text_in_every_table() -> None:
    said = ["=cmd()", "+1", "-1", "@a", "\tx", "\rx", "plain", "a\r=b", -1.5, 3, None, True]
    _, row = csv.reader(io.StringIO(csv_table(["a"] * len(said), [said])))
    assert row[:6] == ["'=cmd()", "'+1", "'-1", "'@a", r"'\tx", r"'\rx"]
    assert row[6:] == ["plain", r"a\r=b", "-1.5", "3", "", "True"]


def test_a_job_and_an_operator_are_text_in_an_export(console: Console, tmp_path: Path) -> None:
    record(tmp_path, 2.0, job="=cmd()", operator="@kim", machine="-lathe")
    out = tmp_path / "out"
    assert console("records", "export", str(out), "--data", str(tmp_path)).code == 0
    (row,) = csv.DictReader((out / "runs.csv").read_text(encoding="utf-8").splitlines())
    assert (row["job"], row["operator"], row["machine"]) == ("'=cmd()", "'@kim", "'-lathe")


# Libraries


def test_the_versions_are_told_with_the_known_fault_of_sqlite(monkeypatch: MonkeyPatch) -> None:
    """SQLite's own page on its write-ahead log names 3.7.0 to 3.51.2, and 3.44.6 and 3.50.7 as corrected, too."""
    faulty = [(3, 7, 0), (3, 40, 1), (3, 44, 5), (3, 45, 0), (3, 50, 6), (3, 51, 2)]
    sound = [(3, 6, 23), (3, 44, 6), (3, 50, 7), (3, 51, 3), (3, 53, 0)]
    assert [loses_wal_reset(each) for each in (*faulty, *sound)] == [True] * len(faulty) + [False] * len(sound)
    monkeypatch.setattr(sqlite3, "sqlite_version_info", (3, 40, 1))
    told = [(check.code, check.severity) for check in library_checks()]
    assert told == [("libraries", Severity.OK), ("wal_reset", Severity.NOTICE)]
    monkeypatch.setattr(sqlite3, "sqlite_version_info", (3, 51, 3))
    (only,) = library_checks()
    assert f"SQLite {sqlite3.sqlite_version}" in only.found
