"""Rights of the data folder: its owner's alone, or its group's if it is shared, whatever the umask."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from datetime import date
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from console.session.data import identified, stop_records
from console.session.data.calibrations import keep_job
from console.session.data.kept_files import jobs_folder
from console.session.data.records import RunRecord
from console.session.data.trace_folder import export_trace, trace_folder
from console.session.station.owning import LOG_NAME, take_lock
from console.session.work import opened, saved_as
from drivers.commissioning.stop_record import StopRecord
from drivers.pmac.dialect import DIALECTS
from drivers.simulator.machine import SimulatedLathe
from profiles.files import write_atomically
from profiles.folder_rights import rights_in
from profiles.store import load_job, load_machine
from profiles.traces import Trace, write_trace
from tests.console.consoles import ADDRESS, MACHINE, console_of
from tests.console.test_identified_store import RESPONSE

RUN = ("software", "job", "job_sha256", "machine", "machine_sha256", "strategy", "program")
EXPERIMENT = "lee-2001-experiment-1"
TRACE = Trace(angle_deg=np.arange(0.0, 360.0, 20.0), deviation_um=np.zeros(18))


def takes_over(data: Path) -> None:
    machine = load_machine(MACHINE).machine
    sim = SimulatedLathe(machine)
    console_of(sim, machine, data.parent / "there", locking=False).owning.claim()
    console_of(sim, machine, data, locking=False).owning.take_control()
    assert (data / LOG_NAME).read_text(encoding="utf-8").count("\n") == 1


def records(data: Path) -> None:
    record = RunRecord(data, {**dict.fromkeys(RUN, ""), "simulated": 1})
    record.add("step", {})
    assert {path.name for path in data.iterdir()} > {"records.sqlite3", "records.sqlite3-wal"}


@cache
def stop_record() -> StopRecord:
    return stop_records.simulated_record(load_machine(MACHINE).machine, DIALECTS["pmac"], date(2001, 11, 30))


def keeps_a_stop_record(data: Path) -> None:
    stop_records.store(data, load_machine(MACHINE).machine, stop_record())


def locks(data: Path) -> None:
    lock = take_lock(data, ADDRESS)
    assert lock is not None
    lock.keep(4711)
    lock.close()


WRITERS: dict[str, Callable[[Path], object]] = {
    "records": records,
    "ownership log": takes_over,
    "lock": locks,
    "stop record": keeps_a_stop_record,
    "identified response": lambda data: identified.store(data, RESPONSE),
    "traces": lambda data: (trace_folder(data), export_trace(data, TRACE, job="ring")),
    "job saved as": lambda data: saved_as(
        opened(load_job(EXPERIMENT), load_machine(MACHINE)), "mine", jobs_folder(data)
    ),
    "calibrated job": lambda data: keep_job(data, load_job(EXPERIMENT), load_job(EXPERIMENT).job),
}


@pytest.fixture(params=[0o000, 0o002, 0o077, 0o277], ids=lambda umask: f"{umask:03o}")
def umask(request: pytest.FixtureRequest) -> Iterator[int]:
    before = os.umask(request.param)
    yield request.param
    os.umask(before)


@pytest.mark.parametrize("writer", WRITERS)
@pytest.mark.usefixtures("umask")
def test_the_data_folder_and_all_that_is_in_it_is_its_owners_alone(tmp_path: Path, writer: str) -> None:
    data = tmp_path / "share" / "trilobe"
    WRITERS[writer](data)
    found = {path: path.stat().st_mode & 0o777 for path in (data.parent, data, *data.rglob("*"))}
    assert any(path.is_file() for path in found)
    assert {path: oct(mode) for path, mode in found.items() if mode != (0o700 if path.is_dir() else 0o600)} == {}


@pytest.mark.parametrize("writer", WRITERS)
@pytest.mark.usefixtures("umask")
def test_in_a_shared_data_folder_all_is_its_groups_too(tmp_path: Path, writer: str) -> None:
    data = shared(tmp_path / "lathe")
    WRITERS[writer](data)
    found = {path: path.stat().st_mode & 0o7777 for path in data.rglob("*")}
    assert any(path.is_file() for path in found)
    assert {path: oct(mode) for path, mode in found.items() if mode != (0o2770 if path.is_dir() else 0o660)} == {}


def shared(folder: Path) -> Path:
    folder.mkdir()
    folder.chmod(0o2770)
    return folder


def test_which_folder_is_shared(tmp_path: Path) -> None:
    """By the bits of the nearest folder; one that somebody made by hand in a shared one counts as that."""
    cases = {
        (0o2770,): True,
        (0o2775,): True,
        (0o0770,): False,
        (0o2750,): False,
        (0o2777,): False,
        (0o0777,): False,
        (0o2770, 0o2755): True,
        (0o2770, 0o2700): False,
        (0o2770, 0o2777): False,
        (0o2770, 0o0755): False,
    }
    for number, (modes, expected) in enumerate(cases.items()):
        folder = tmp_path / str(number)
        for mode in modes:
            folder /= "x"
            folder.mkdir(parents=True)
            folder.chmod(mode)
        assert rights_in(folder).shared is expected, [oct(mode) for mode in modes]
        assert rights_in(folder / "new" / "newer").shared is expected


def test_a_folder_that_is_there_stays_as_its_owner_has_made_it(tmp_path: Path) -> None:
    tmp_path.chmod(0o750)
    locks(tmp_path)
    assert tmp_path.stat().st_mode & 0o777 == 0o750


def test_what_is_saved_elsewhere_is_as_the_umask_says(tmp_path: Path) -> None:
    before = os.umask(0o022)
    try:
        write_atomically(tmp_path / "part.csv", b"", overwrite=False)
    finally:
        os.umask(before)
    assert (tmp_path / "part.csv").stat().st_mode & 0o777 == 0o644


def test_a_trace_that_is_saved_into_a_shared_folder_by_its_path_is_its_groups_too(tmp_path: Path) -> None:
    data = shared(tmp_path / "lathe")
    before = os.umask(0o077)
    try:
        write_trace(data / "part.csv", TRACE)
    finally:
        os.umask(before)
    assert (data / "part.csv").stat().st_mode & 0o7777 == 0o660
