"""Backup and restore of the data folder: the whole of it, checked, never over anything, all or nothing."""

from __future__ import annotations

import gzip
import io
import json
import os
import signal
import sqlite3
import subprocess
import sys
import tarfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pytest import MonkeyPatch

from console.session.data import calibrations, identified_responses, learned_store, restore, stop_records
from console.session.data.backup import back_up
from console.session.data.backup_format import MANIFEST
from console.session.data.history import last_results
from console.session.data.kept_files import jobs_folder
from console.session.data.record_file import FILE_NAME
from console.session.data.record_schema import SCHEMA
from console.session.data.records import RunRecord
from console.session.data.restore import check_archive
from console.session.data.trace_folder import export_trace
from console.session.station.machine_control import take_lock
from console.session.work import open_work, saved_as
from profiles.problem import ProblemError
from profiles.store import load_job, load_machine
from profiles.traces import Trace
from tests.console.commands import Console
from tests.console.test_identify_command import RESPONSE
from tests.console.test_own_files import CALIBRATION, LEARNED, MACHINE, STOPS

RUN = {
    **dict.fromkeys(("software", "job", "job_sha256", "machine", "machine_sha256", "strategy", "program"), ""),
    "simulated": 0,
}
TRACE = Trace(angle_deg=np.arange(0.0, 360.0, 20.0), deviation_um=np.zeros(18))


def fill(data: Path) -> None:
    """One of everything that a console keeps."""
    saved_as(open_work(load_job("lee-2001-experiment-1"), load_machine(MACHINE.name)), "mine", jobs_folder(data))
    (data / "machines").mkdir()
    (data / "machines" / "선반.toml").write_text("# an own machine\n", encoding="utf-8")
    learned_store.store(data, LEARNED)
    calibrations.store(data, CALIBRATION)
    identified_responses.store(data, RESPONSE)
    stop_records.store(data, MACHINE, STOPS)
    export_trace(data, TRACE, job="ring")
    os.utime(next((data / "exported-traces").iterdir()), (1e9, 1e9 + 0.5))


@pytest.fixture
def data(tmp_path: Path) -> Path:
    folder = tmp_path / "lathe"
    fill(folder)
    return folder


@pytest.fixture
def running(data: Path) -> Iterator[RunRecord]:
    """A console in the middle of a run: its last events are only in SQLite's journal."""
    lock = take_lock(data, "tcp:192.0.2.1:1025")
    record = RunRecord(data, RUN)
    for number in range(3):
        record.add("measured", {"job": "ring", "ront_um": 2.5 + number})
    yield record
    record.close()
    assert lock is not None
    lock.close()


def contents(folder: Path) -> dict[str, bytes | None]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
        if FILE_NAME not in path.name
    }


@pytest.mark.usefixtures("running")
def test_all_comes_back_from_under_a_running_console(console: Console, data: Path, tmp_path: Path) -> None:
    file, again = tmp_path / "lathe.tar.gz", tmp_path / "new" / "lathe"
    (data / ".job.toml.0123abcd.tmp").write_bytes(b"half")
    said = console("backup", str(file), "--data", str(data), "--json")
    assert (said.code, said.err, said.json["warnings"]) == (0, "", [])
    assert file.stat().st_mode & 0o777 == 0o600
    done = console("restore", str(file), "--data", str(again), "--json")
    assert (done.code, done.err) == (0, "")
    assert done.json["files"] == said.json["files"] == len([p for p in again.rglob("*") if p.is_file()])
    of_running = {".job.toml.0123abcd.tmp", "locks", "running"}
    expected = {path: each for path, each in contents(data).items() if path.split("/")[0] not in of_running}
    assert contents(again) == expected
    assert (last_results(again, simulated=False)["ring"].ront_um, len(list(again.glob("records*")))) == (4.5, 1)
    assert next((again / "exported-traces").iterdir()).stat().st_mtime == 1e9 + 0.5
    assert {path.stat().st_mode & 0o7777 for path in again.rglob("*")} == {0o700, 0o600}
    with sqlite3.connect(again / FILE_NAME) as database:
        assert database.execute("SELECT count(*) FROM events").fetchone() == (3,)


def test_nothing_is_overwritten(console: Console, data: Path, tmp_path: Path) -> None:
    file = tmp_path / "lathe.tar.gz"
    where = ("--data", str(data))
    assert console("backup", str(data / "backup.tar.gz"), *where).err.startswith("console: the backup ")
    assert console("backup", str(file), *where).code == 0
    before, archive = contents(data), file.read_bytes()
    assert "already exists" in console("backup", str(file), *where).err
    said = console("restore", str(file), *where)
    assert (said.code, "is not empty" in said.err) == (1, True)
    assert (contents(data), file.read_bytes()) == (before, archive)
    assert "nothing to back up" in console("backup", str(tmp_path / "b"), "--data", str(tmp_path / "no")).err


def test_an_empty_folder_keeps_its_rights_and_what_is_restored_has_them(data: Path, tmp_path: Path) -> None:
    file, shared = tmp_path / "lathe.tar.gz", tmp_path / "shared"
    back_up(data, file)
    shared.mkdir()
    if os.geteuid() == 0:
        os.chown(shared, 61001, 61100)
    shared.chmod(0o2770)
    status = shared.stat()
    before = os.umask(0o077)
    try:
        restore.restore(file, shared)
    finally:
        os.umask(before)
    found = [shared, *shared.rglob("*")]
    assert {(path.is_dir(), path.stat().st_mode & 0o7777) for path in found} == {(True, 0o2770), (False, 0o660)}
    assert {(each.stat().st_uid, each.stat().st_gid) for each in found} == {(status.st_uid, status.st_gid)}


def test_a_link_is_left_out_and_said(console: Console, data: Path, tmp_path: Path) -> None:
    (data / "traces").symlink_to(tmp_path)
    os.mkfifo(data / "pipe")
    said = console("backup", str(tmp_path / "b.tar.gz"), "--data", str(data), "--json")
    assert [line.split(": ")[0].rsplit("/")[-1] for line in said.json["warnings"]] == ["pipe", "traces"]
    assert said.code == 0 and "not in the backup" in said.err


def test_damaged_records_are_no_backup_and_those_of_a_newer_console_no_restore(data: Path, tmp_path: Path) -> None:
    place, file = tmp_path / "place", tmp_path / "b.tar.gz"
    place.mkdir()
    (data / FILE_NAME).write_bytes(b"no database" * 500)
    with pytest.raises(ProblemError) as refused:
        back_up(data, file)
    assert refused.value.problems[0].code == "record.damaged" and not file.exists()
    (data / FILE_NAME).unlink()
    RunRecord(data, RUN).close()
    with sqlite3.connect(data / FILE_NAME) as database:
        database.execute(f"PRAGMA user_version = {SCHEMA + 1}")
    back_up(data, file)
    assert code_of(file, place) == "record.other_schema"


def entries(file: Path) -> list[tuple[tarfile.TarInfo, bytes]]:
    with tarfile.open(file) as tar:
        return [(each, b"" if (found := tar.extractfile(each)) is None else found.read()) for each in tar]


def packed(file: Path, content: list[tuple[tarfile.TarInfo, bytes]]) -> None:
    with tarfile.open(file, "w:gz") as tar:
        for each, data in content:
            each.size = len(data)
            tar.addfile(each, io.BytesIO(data))


def entry(name: str, kind: bytes = tarfile.REGTYPE, link: str = "") -> tuple[tarfile.TarInfo, bytes]:
    found = tarfile.TarInfo(name)
    found.type, found.linkname = kind, link
    return found, b""


def code_of(archive: Path, place: Path) -> str:
    """The refusal of a restore, after which nothing at all has been written."""
    before = sorted(path.name for path in place.iterdir())
    with pytest.raises(ProblemError) as refused:
        restore.restore(archive, place / "again")
    assert sorted(path.name for path in place.iterdir()) == before
    return refused.value.problems[0].code


def test_whatever_is_wrong_with_an_archive_nothing_is_written(data: Path, tmp_path: Path) -> None:
    file, wrong, place = tmp_path / "b.tar.gz", tmp_path / "wrong.tar.gz", tmp_path / "place"
    place.mkdir()
    back_up(data, file)
    whole, plain = entries(file), gzip.decompress(file.read_bytes())
    *files, (manifest, said) = whole
    foreign = {
        "data/../../out": tarfile.REGTYPE,
        "/etc/out": tarfile.REGTYPE,
        "data//etc/out": tarfile.REGTYPE,
        "elsewhere/out": tarfile.REGTYPE,
        "data/./out": tarfile.REGTYPE,
        "data/locks/x.lock": tarfile.REGTYPE,
        "data/link": tarfile.SYMTYPE,
        "data/hard": tarfile.LNKTYPE,
        "data/device": tarfile.CHRTYPE,
        "data/pipe": tarfile.FIFOTYPE,
    }
    for name, kind in foreign.items():
        packed(wrong, [*files, entry(name, kind, "../../out"), (manifest, said)])
        assert code_of(wrong, place) == "restore.unsafe", name
    number = said.index(b'"sha256": "') + 11
    other_digit = said[:number] + (b"0" if said[number : number + 1] != b"0" else b"1") + said[number + 1 :]
    for content, code in (
        ([*files, (manifest, other_digit)], "restore.damaged"),
        ([*files[:-1], (manifest, said)], "restore.damaged"),
        ([*files, entry("data/jobs/more.toml"), (manifest, said)], "restore.damaged"),
        ([*files, entry("data/more", tarfile.DIRTYPE), (manifest, said)], "restore.damaged"),
        ([*files, (manifest, said.replace(b'"schema": 1', b'"schema": 2'))], "schema.unsupported"),
        ([*files, (manifest, b"{}")], "restore.not_backup"),
        (files, "restore.not_backup"),
        ([*files, (manifest, said), (manifest, said)], "restore.unsafe"),
    ):
        packed(wrong, content)
        with pytest.raises(ProblemError):
            check_archive(wrong)
        assert code_of(wrong, place) == code
    for raw, code in (
        (plain.replace(b"spindle_speed_rpm = 1000", b"spindle_speed_rpm = 1001"), "restore.damaged"),
        (plain[: len(plain) // 2], "restore.damaged"),
        (b"hello", "restore.not_backup"),
    ):
        assert raw != plain
        wrong.write_bytes(gzip.compress(raw))
        assert code_of(wrong, place) == code
    zipped = file.read_bytes()
    for raw in (zipped[:-1], zipped[: len(zipped) // 2], zipped[:-8] + bytes(4) + zipped[-4:], b"", plain):
        wrong.write_bytes(raw)
        assert code_of(wrong, place) in ("restore.damaged", "restore.not_backup")
    os.mkfifo(tmp_path / "pipe")
    assert [code_of(tmp_path / name, place) for name in ("pipe", "nowhere")] == ["file.unreadable"] * 2


def test_a_replaced_archive_or_a_full_disk_restores_nothing(
    data: Path, tmp_path: Path, monkeypatch: MonkeyPatch
) -> None:
    file, other, place = tmp_path / "b.tar.gz", tmp_path / "other.tar.gz", tmp_path / "place"
    place.mkdir()
    back_up(data, file)
    found = json.loads(entries(file)[-1][1])
    assert entries(file)[-1][0].name == MANIFEST
    assert set(found["files"]["jobs/mine.toml"]) == {"bytes", "sha256"}
    learned = next((data / "learned").rglob("*.json"))
    learned.write_bytes(learned.read_bytes().replace(b"27.5", b"28.5"))
    back_up(data, other)
    manifest = check_archive(file)
    with monkeypatch.context() as replaced:
        replaced.setattr(restore, "check_archive", lambda _: manifest)
        assert code_of(other, place) == "restore.damaged"
    free = os.statvfs(place)

    class Full:
        f_bavail, f_frsize = 3, free.f_frsize

    monkeypatch.setattr(os, "statvfs", lambda _: Full)
    assert code_of(file, place) == "restore.no_space"


def test_a_flipped_bit_anywhere_in_the_file_is_found_or_harmless(data: Path, tmp_path: Path) -> None:
    file, wrong = tmp_path / "b.tar.gz", tmp_path / "wrong.tar.gz"
    back_up(data, file)
    good, zipped = check_archive(file), file.read_bytes()
    refused = 0
    for place in range(10, len(zipped), max(1, len(zipped) // 60)):  # behind the header of gzip: a date
        wrong.write_bytes(zipped[:place] + bytes([zipped[place] ^ 0x10]) + zipped[place + 1 :])
        try:
            assert check_archive(wrong) == good
        except ProblemError as error:
            assert error.problems[0].code in ("restore.damaged", "restore.not_backup", "restore.unsafe")
            refused += 1
    assert refused > 50


def test_a_damaged_byte_that_reads_as_another_schema_is_called_damage(data: Path, tmp_path: Path) -> None:
    """The checksum of gzip is at the end of the file; of another version is what is whole and says so."""
    file, newer = tmp_path / "b.tar.gz", tmp_path / "newer.tar.gz"
    back_up(data, file)
    content = gzip.decompress(file.read_bytes())
    other = content.replace(b'"schema": 1,', b'"schema": 3,')
    assert other != content
    newer.write_bytes(gzip.compress(other))
    assert refused(newer) == "schema.unsupported"
    newer.write_bytes(gzip.compress(other)[:-8] + gzip.compress(content)[-8:])
    assert refused(newer) == "restore.damaged"


def refused(archive: Path) -> str:
    with pytest.raises(ProblemError) as caught:
        check_archive(archive)
    return caught.value.problems[0].code


def test_a_killed_restore_leaves_no_half_folder(data: Path, tmp_path: Path, monkeypatch: MonkeyPatch) -> None:
    file, place = tmp_path / "b.tar.gz", tmp_path / "place"
    place.mkdir()
    back_up(data, file)
    half, written = restore._unpack, []

    def dies_in_the_middle(*words: Any) -> None:
        half(*words)
        written.append(words)
        if len(written) == 5:
            os.kill(os.getpid(), signal.SIGKILL)

    child = os.fork()
    if child == 0:
        try:
            monkeypatch.setattr(restore, "_unpack", dies_in_the_middle)
            restore.restore(file, place / "lathe")
        finally:
            os._exit(0)
    assert os.WTERMSIG(os.waitpid(child, 0)[1]) == signal.SIGKILL
    (left,) = place.iterdir()
    assert left.name.startswith(".lathe.") and len(list(left.rglob("*"))) >= 5
    restore.restore(file, place / "lathe")
    assert [path.name for path in place.iterdir()] == ["lathe"]
    assert contents(place / "lathe") == contents(data)


@pytest.mark.long
def test_what_git_would_keep_is_written_in_the_same_order_each_time(data: Path, tmp_path: Path) -> None:
    """Another console, with another hash seed, writes the same bytes, one value a line."""
    code = "import sys, pathlib; from tests.console.test_backup import fill; fill(pathlib.Path(sys.argv[1]))"
    words = [sys.executable, "-c", code, str(tmp_path / "other")]
    subprocess.run(words, env={**os.environ, "PYTHONHASHSEED": "1"}, check=True, timeout=60)
    first, second = (
        {p: c for p, c in contents(f).items() if "traces" not in p} for f in (data, tmp_path / "other")
    )
    assert first == second and len([each for each in first.values() if each is not None]) == 6
    assert all(content.count(b"\n") > 5 for path, content in first.items() if content and path.endswith(".json"))
