"""Two accounts at one lathe share its data folder: each finds what the other has made, and its lock."""

from __future__ import annotations

import os
import shutil
import signal
import sqlite3
import stat
from argparse import Namespace
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from console.__main__ import main
from console.cli.library import data_of
from console.cli.machine.doctor_checks import data_folder_checks
from console.flight.frozen_recordings import frozen_in
from console.flight.recording import read_recording
from console.session.data import calibrations, learned_store, stop_records
from console.session.data.controller_backups import backups_of
from console.session.data.history import last_results
from console.session.data.identified_responses import kept_responses
from console.session.data.kept_files import jobs_folder, newest_files, require_open
from console.session.data.records import RunRecord, killed_runs
from console.session.errors import SessionError
from console.session.station.machine_control import take_lock
from console.session.work import open_work, saved_as
from console.tui.controller.watching import WatchTable, read_watch, watch_path
from console.tui.further.scope import records_of
from drivers.cutting.strategy import Strategy
from profiles.files import made_locked, remove_all_left
from profiles.findings import Severity
from profiles.problem import ProfileError
from profiles.store import list_jobs, load_job, load_machine, save_job
from tests.branching import in_a_copy
from tests.console.flight.bench import FlightBench, reasons
from tests.console.test_own_files import CALIBRATION, HOLDS, LEARNED, MACHINE, STOPS
from tests.system.accounts import GROUP, STRANGER, A, B, as_account, become, lathe_folder, needs_root

pytestmark = [pytest.mark.system, needs_root]

EXPERIMENT, ADDRESS = "lee-2001-experiment-1", "tcp:192.0.2.1:1025"
RUN = {**dict.fromkeys(("software", "job_sha256", "machine_sha256", "strategy", "program"), ""), "simulated": 0}
UMASKS = (0o077, 0o002)


@pytest.fixture
def data() -> Iterator[Path]:
    with lathe_folder() as folder:
        yield folder


def works(data: Path, number: int) -> None:
    """A day at the lathe: a job, a version, a calibration, a stop record, a measured part."""
    saved_as(open_work(load_job(EXPERIMENT), load_machine(MACHINE.name)), f"mine-{number}", jobs_folder(data))
    learned_store.store(data, replace(LEARNED, version=number))
    calibrations.store(data, CALIBRATION)
    stop_records.store(data, MACHINE, STOPS)
    record = RunRecord(data, {**RUN, "job": "ring", "machine": MACHINE.name})
    record.add("measured", {"job": "ring", "ront_um": 2.5 + number})
    record.close()


def finds(data: Path, number: int) -> None:
    """What another account has made so far is all there."""
    assert {f"mine-{each}" for each in range(1, number + 1)} <= {
        each.name for each in list_jobs(jobs_folder(data))
    }
    assert [each.version for each in learned_store.versions(data, HOLDS)] == list(range(1, number + 1))
    assert calibrations.newest(data, "m", "wrench", "SC-160") is not None
    assert len(calibrations.files_of(data, "m", "wrench")) == number
    assert stop_records.load(data, MACHINE) == STOPS
    last = last_results(data, simulated=False)["ring"]
    assert (last.ront_um, last.parts) == (2.5 + number, number)


@pytest.mark.parametrize("umask", UMASKS, ids=oct)
def test_each_finds_replaces_and_continues_what_the_other_has_made(data: Path, umask: int) -> None:
    as_account(A, lambda: works(data, 1), umask)
    as_account(B, lambda: (finds(data, 1), works(data, 2)), umask)  # type: ignore[func-returns-value, arg-type]
    as_account(A, lambda: (finds(data, 2), works(data, 3)), umask)  # type: ignore[func-returns-value, arg-type]
    (check,) = data_folder_checks(data)
    assert (check.code, check.severity) == ("data_folder_shared", Severity.OK)


@pytest.mark.parametrize("umask", UMASKS, ids=oct)
def test_a_lock_keeps_out_the_console_of_the_other_account_until_it_is_gone(data: Path, umask: int) -> None:
    ready, held = os.pipe()
    holder = os.fork()
    if holder == 0:
        try:
            become(A, umask)
            lock = take_lock(data, ADDRESS)
            assert lock is not None
            lock.keep(4711)
            os.write(held, b"1")
            signal.pause()
        finally:
            os._exit(1)
    os.close(held)
    assert os.read(ready, 1) == b"1"

    def is_kept_out() -> None:
        assert take_lock(data, ADDRESS) is None

    def follows() -> None:
        lock = take_lock(data, ADDRESS)
        assert lock is not None and lock.last_number == 4711

    try:
        as_account(B, is_kept_out, umask)
    finally:
        os.kill(holder, signal.SIGKILL)
        os.waitpid(holder, 0)
    as_account(B, follows, umask)


@pytest.mark.parametrize("umask", UMASKS, ids=oct)
def test_what_a_killed_console_has_left_the_other_account_takes_over(data: Path, umask: int) -> None:
    ready, begun = os.pipe()
    killed = os.fork()
    if killed == 0:
        try:
            become(A, umask)
            record = RunRecord(data, {**RUN, "job": "ring", "machine": MACHINE.name})
            record.add("started", {})
            # The temporary file of a writer, which is no longer there.
            made_locked(data / ".job.toml.0123abcd.tmp", 0o660)
            os.fchmod(os.open(data / ".job.toml.0123abcd.tmp", os.O_WRONLY), 0o660)
            os.write(begun, b"1")
            signal.pause()
        finally:
            os._exit(1)
    os.close(begun)
    assert os.read(ready, 1) == b"1"

    def leaves_the_living_alone() -> None:
        assert killed_runs(data, MACHINE.name, simulated=False) == ()
        remove_all_left(data)
        assert (data / ".job.toml.0123abcd.tmp").exists() and list((data / "running").iterdir())

    def takes_over() -> None:
        assert {"records.sqlite3-wal", "records.sqlite3-shm"} < {path.name for path in data.iterdir()}
        assert [each.code for each in killed_runs(data, MACHINE.name, simulated=False)] == ["record.killed"]
        remove_all_left(data)
        assert not (data / ".job.toml.0123abcd.tmp").exists() and not list((data / "running").iterdir())
        with sqlite3.connect(data / "records.sqlite3") as database:
            kinds = database.execute("SELECT kind FROM events ORDER BY number").fetchall()
            assert kinds == [("started",), ("ended",)]

    try:
        as_account(B, leaves_the_living_alone, umask)
    finally:
        os.kill(killed, signal.SIGKILL)
        os.waitpid(killed, 0)
    as_account(B, takes_over, umask)


def test_an_account_outside_the_group_reads_and_writes_nothing(data: Path) -> None:
    as_account(A, lambda: works(data, 1))

    def is_outside() -> None:
        with pytest.raises(SessionError) as refused:
            take_lock(data, ADDRESS)
        assert refused.value.problems[0].code == "lock.unwritable"
        with pytest.raises(SessionError) as closed:
            data_of(Namespace(data=str(data)))
        assert (closed.value.problems[0].code, closed.value.problems[0].value) == ("data.closed", str(STRANGER))
        (check,) = data_folder_checks(data)
        assert (check.code, check.severity) == ("data_folder_unusable", Severity.REFUSAL)
        assert "drwxrws---" in check.found
        (check,) = data_folder_checks(data.parent / "new")
        assert (check.code, check.found) == ("data_folder_unmakeable", str(data.parent))

    as_account(STRANGER, is_outside)


def test_a_lock_of_another_group_is_refused_and_stays_as_it_is(data: Path) -> None:
    def is_refused() -> None:
        with pytest.raises(SessionError) as refused:
            take_lock(data, ADDRESS)
        assert refused.value.problems[0].code == "lock.unwritable"

    as_account(A, lambda: locks(data))
    (path,) = (data / "locks").iterdir()
    os.chown(path, A, B)
    path.chmod(0o666)
    as_account(B, is_refused)
    assert path.read_text() == "4711\n"


def locks(data: Path) -> None:
    lock = take_lock(data, ADDRESS)
    assert lock is not None
    lock.keep(4711)


def test_a_folder_that_was_copied_by_hand_and_is_closed_is_said_not_taken_for_empty(data: Path) -> None:
    as_account(A, lambda: works(data, 1))
    learned = next((data / "learned").glob("*/*/*"))

    def is_said() -> None:
        with pytest.raises(SessionError) as refused:
            data_of(Namespace(data=str(data)))
        assert (refused.value.problems[0].code, refused.value.problems[0].where) == ("data.closed", f"{data}/jobs")
        for reads in (lambda: stop_records.load(data, MACHINE), lambda: learned_store.versions(data, HOLDS)):
            with pytest.raises(ProfileError) as unreadable:
                reads()
            assert unreadable.value.problems[0].code == "file.unreadable"

    for folder in (data / "jobs", data / "stops", learned):
        folder.chmod(0o700)
    as_account(B, is_said)


def test_a_folder_that_is_closed_while_the_console_runs_is_said_not_taken_for_empty(data: Path) -> None:
    machine = MACHINE
    folders: dict[str, Callable[[], object]] = {
        "backups": lambda: backups_of(data, machine.name),
        "scope": lambda: records_of(data),
        "watch": lambda: read_watch(watch_path(data, machine.name)),
        "identified": lambda: kept_responses(data, machine, Strategy.PVT),
        "jobs": lambda: require_open(jobs_folder(data)),
        "traces": lambda: newest_files(data / "traces"),
    }

    def makes() -> None:
        for name in folders:
            (data / name / machine.name).mkdir(parents=True)
            (data / name).chmod(0o700)

    def is_said() -> None:
        for name, reads in folders.items():
            with pytest.raises(ProfileError) as unreadable:
                reads()
            (problem,) = unreadable.value.problems
            assert problem.code == "file.unreadable" and problem.where.startswith(str(data / name)), name
        table = WatchTable(data, machine.name)
        table.load()
        with pytest.raises(ProfileError):  # and not written over
            table.remove()

    as_account(A, makes)
    as_account(B, is_said)


def test_doctor_says_what_is_wrong_with_the_rights(data: Path) -> None:
    as_account(A, lambda: works(data, 1))
    cases = {
        0o2777: ["data_folder_open"],
        0o2750: ["data_folder_half"],
        0o0770: ["data_folder_not_setgid"],
        0o3770: ["data_folder_sticky"],
        0o2770: ["data_folder_shared"],
    }
    for mode, codes in cases.items():
        data.chmod(mode)
        assert [check.code for check in data_folder_checks(data)] == codes, oct(mode)
    (data / "jobs" / "mine-1.toml").chmod(0o600)  # as a copy by hand is
    (check,) = data_folder_checks(data)
    assert (check.code, check.found, check.facts["number"]) == ("data_folder_closed", "jobs/mine-1.toml", "1")


# Data that this account may not read or write: every command says so in a line, and none ends as a fault.


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


# The flight recorder in a data folder that two accounts share: each finds what the other's console has left.


def is_killed(data: Path) -> None:
    """A console records, and ends without an end."""
    bench = FlightBench(data)
    bench.runs(20.0)
    bench.alarms()
    bench.runs(6.0)


def starts(data: Path) -> None:
    bench = FlightBench(data)
    bench.recorder._freeze_left()
    bench.runs(1.0)
    bench.recorder._finish()


def test_the_ring_of_a_killed_console_of_another_account_is_frozen(tmp_path: Path) -> None:
    is_killed(tmp_path)  # all that is imported on use is there: the accounts may not read the interpreter
    assert len([read_recording(path) for path in frozen_in(tmp_path)]) == 1
    with lathe_folder() as data:
        as_account(A, lambda: is_killed(data), 0o077)
        as_account(B, lambda: starts(data), 0o077)
        files = list((data / "flight").rglob("*"))
        assert list((data / "flight" / "running").iterdir()) == []
        found = [read_recording(path) for path in frozen_in(data)]
        assert sorted(reasons(each)[0] for each in found) == ["cut.spindle_stands", "killed"]
        assert {path.stat().st_gid for path in files} == {GROUP}
        assert {stat.S_IMODE(path.stat().st_mode) for path in files} == {0o660, 0o2770}
