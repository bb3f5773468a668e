"""What is kept in the data folder is its owner's alone, whatever the umask; what is saved elsewhere is not."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from datetime import date
from functools import cache
from pathlib import Path

import pytest

from console.session.data import identified, stop_records
from console.session.data.calibrations import keep_job
from console.session.data.kept_files import jobs_folder
from console.session.data.records import RunRecord
from console.session.station.owning import LOG_NAME, take_lock
from console.session.work import opened, saved_as
from drivers.commissioning.stop_record import StopRecord
from drivers.pmac.dialect import DIALECTS
from drivers.simulator.machine import SimulatedLathe
from profiles.files import write_atomically
from profiles.store import load_job, load_machine
from tests.console.consoles import ADDRESS, MACHINE, console_of
from tests.console.test_identified_store import RESPONSE

RUN = ("software", "job", "job_sha256", "machine", "machine_sha256", "strategy", "program")
EXPERIMENT = "lee-2001-experiment-1"


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
    "job saved as": lambda data: saved_as(
        opened(load_job(EXPERIMENT), load_machine(MACHINE)), "mine", jobs_folder(data)
    ),
    "calibrated job": lambda data: keep_job(data, load_job(EXPERIMENT), load_job(EXPERIMENT).job),
}


@pytest.fixture(params=[0o000, 0o002, 0o277], ids=lambda umask: f"{umask:03o}")
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
