"""Rights of the data folder, and every kind of file of our own: read or refused with a problem."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import date
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from console.session.data import identified_responses, stop_records
from console.session.data.calibrations import keep_job
from console.session.data.kept_files import jobs_folder
from console.session.data.records import RunRecord
from console.session.data.trace_folder import export_trace, trace_folder
from console.session.station.machine_control import LOG_NAME, take_lock
from console.session.work import Work, edit_field, open_work, parse_field, saved_as, undone, with_strategy
from drivers.commissioning.stop_record import StopRecord
from drivers.pmac.dialect import DIALECTS
from drivers.simulator.machine import SimulatedLathe
from profiles.files import rights_in, write_atomically
from profiles.job import SIMULATED_SOURCE
from profiles.problem import Problem, ProfileError
from profiles.store import load_job, load_machine
from profiles.traces import Trace, write_trace
from tests.console.consoles import ADDRESS, MACHINE, console_of
from tests.console.floor import known
from tests.console.test_identify_command import RESPONSE

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
    lock = known(take_lock(data, ADDRESS))
    lock.keep(4711)
    lock.close()


WRITERS: dict[str, Callable[[Path], object]] = {
    "records": records,
    "ownership log": takes_over,
    "lock": locks,
    "stop record": keeps_a_stop_record,
    "identified response": lambda data: identified_responses.store(data, RESPONSE),
    "traces": lambda data: (trace_folder(data), export_trace(data, TRACE, job="ring")),
    "job saved as": lambda data: saved_as(
        open_work(load_job(EXPERIMENT), load_machine(MACHINE)), "mine", jobs_folder(data)
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


@pytest.fixture
def work() -> Work:
    return open_work(load_job("lee-2001-experiment-1"), load_machine("lee-2001-lathe"))


MEANT = {"1314": 1314.0, "1314.5": 1314.5, "1314,5": 1314.5, " 20 ": 20.0, "0,100": 0.1, ".5": 0.5, "7.": 7.0}
REFUSED = {
    **dict.fromkeys(("1,314", "1.314.5", "1,314.5"), "value.ambiguous"),
    **dict.fromkeys(("1_000", "1e3", "nan", "١٢", "--5"), "value.not_number"),
    **dict.fromkeys(("-5", "0", "100001"), "value.out_of_range"),
}


def refusal(typed: str, key: str = "chucking_force_n") -> Problem:
    with pytest.raises(ProfileError) as raised:
        parse_field(typed, key)
    (problem,) = raised.value.problems
    return problem


def test_a_number_may_have_a_point_or_a_comma_and_what_may_be_two_is_refused() -> None:
    """Separated thousands are never taken for another number."""
    assert {typed: parse_field(typed, "chucking_force_n") for typed in MEANT} == MEANT
    for typed, code in REFUSED.items():
        problem = refusal(typed)
        limit = ">= 0.1, <= 100000 N"
        assert (problem.code, problem.key, problem.limit) == (code, "chucking_force_n", limit)
    thousands = ("1,234.5", "1.234,5", "1 234,5", "1\u00a0234", "1\u202f234", "1'234.5", "1\u2019234")
    for typed in (f"{sign}{each}" for each in thousands for sign in ("", "-", "\u2212")):
        assert refusal(typed).code in ("value.ambiguous", "value.not_number")
    assert [refusal(typed, "jaws").code for typed in ("3.5", "3,0", "three", "")] == ["value.not_whole"] * 4
    assert parse_field("6", "jaws") == 6


def test_an_edit_can_be_undone_step_by_step(work: Work) -> None:
    after = edit_field(edit_field(work, "spindle_speed_rpm", "800"), "material", "Steel")
    assert (after.job.spindle_speed_rpm, after.job.material, after.edited) == (800.0, "Steel", True)
    assert undone(after).job.material == "Al"
    assert undone(undone(after)).job == work.job
    assert not undone(undone(after)).edited and undone(work) is work
    assert edit_field(work, "chucking_force_n", "1314") is work, "what was computed is kept"


def test_a_force_that_the_operator_gives_is_not_assumed_and_the_error_stays_with_its_own(work: Work) -> None:
    after = edit_field(work, "chucking_force_n", "900")
    assert (after.job.chucking_force_n, after.job.error_force_n) == (900.0, 1314.0)
    assert [("chucking_force_n" in each.job.assumed) for each in (work, after, undone(after))] == [
        True,
        False,
        True,
    ]
    assert "feed_mm_per_rev" in after.job.assumed


def test_a_job_saved_under_another_name_is_the_one_in_hand(work: Work, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "jobs"
    before = edit_field(with_strategy(work, "paper"), "feed_mm_per_rev", "0.04")
    after = saved_as(before, "ring", folder)
    assert after.loaded.path == folder / "ring.toml"
    assert (after.job.name, after.job.feed_mm_per_rev, after.strategy) == ("ring", 0.04, "paper")
    assert not after.edited
    assert load_job("ring", folder).job == after.job


def test_saving_never_writes_over_a_file_nor_into_one(work: Work, tmp_path: Path) -> None:
    (tmp_path / "ring.toml").write_text("mine")
    (tmp_path / "jobs").write_text("a file")
    for folder, code in ((tmp_path, "file.exists"), (tmp_path / "jobs", "file.not_writable")):
        with pytest.raises(ProfileError) as raised:
            saved_as(work, "ring", folder)
        assert raised.value.problems[0].code == code
    assert (tmp_path / "ring.toml").read_text() == "mine"


def test_a_copy_says_what_it_was_copied_from_and_not_the_source_of_that(work: Work, tmp_path: Path) -> None:
    steel = edit_field(work, "material", "steel")
    assert "Table 6" in steel.job.source
    copied = saved_as(steel, "mine", tmp_path).job
    assert (copied.source, copied.copied_from) == ("", "lee-2001-experiment-1")
    assert (copied.material, copied.lobe_material) == ("steel", "Al")
    again = saved_as(saved_as(steel, "mine-2", tmp_path), "mine-3", tmp_path).job
    assert again.copied_from == "mine-2"


def test_a_copy_keeps_it_that_its_lobe_is_one_of_a_simulated_part(work: Work, tmp_path: Path) -> None:
    practice = replace(work.job, source=f"Table 6; {SIMULATED_SOURCE}")
    copied = saved_as(replace(work, job=practice), "mine", tmp_path).job
    assert copied.source == SIMULATED_SOURCE
