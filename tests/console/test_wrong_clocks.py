"""A clock that was wrong, or is set back, changes no order: what was kept last counts, a date to come is told."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from console.session.data.history import last_results
from console.session.data.kept_files import is_ahead
from console.session.data.learned_store import asked_for
from console.session.data.measured_part import cuts_of, date_problems, parts_made
from console.session.data.records import RunRecord
from console.text.catalogue import load
from profiles.store import load_job, load_machine
from tests.console.commands import Console, JobFile
from tests.record_clock import set_dates

JOB, MACHINE = load_job("lee-2001-experiment-1"), load_machine("lee-2001-lathe")
NEXT_YEAR, LAST_YEAR, LATE, EARLY = "2099-11-22T10:00:00Z", "2001-11-22T10:00:00Z", "12:00", "10:00"
KEY = "chuck.force_per_torque_n_per_n_m"
SLOPES = {"soft": 300.0, "stiff": 377.0}


@pytest.fixture
def data(data_folder: Path) -> Path:
    return data_folder / "trilobe"


@pytest.fixture
def calibrate(console: Console, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], Any]:
    """Keep a calibration of the wrench on a day."""

    def keep(slope: str, date: str) -> Any:
        rows = [f"{t},{SLOPES[slope] * t + off:.1f}" for t in (10, 20, 30, 40) for off in (-20.0, 20.0)]
        path = tmp_path / f"{slope}.csv"
        path.write_text("\n".join(["torque_n_m,force_n", *rows]), encoding="utf-8")
        monkeypatch.setattr("console.session.learning.chuck_calibrating.utc_now", lambda: date)
        said = console("calibrate", "chuck", str(path), "--keep", "--json")
        assert said.code == 0, said.err
        return said

    return keep


def predicted(console: Console) -> Any:
    return console("predict", JOB.job.name, "--json")


def test_the_calibration_that_was_kept_last_counts_whatever_its_date(
    console: Console, calibrate: Callable[[str, str], Any]
) -> None:
    calibrate("stiff", NEXT_YEAR)
    said = calibrate("soft", LAST_YEAR)
    assert NEXT_YEAR in said.err and "wrong" in said.err
    found = predicted(console)
    assert found.json["clamping"]["torque_n_m"] == pytest.approx(JOB.job.chucking_force_n / 300.0, rel=0.02)
    assert found.json["sources"][KEY] == LAST_YEAR
    assert NEXT_YEAR not in found.err


@pytest.mark.parametrize("command", ["predict", "preview", "program"])
def test_a_calibration_of_a_day_to_come_is_told_wherever_it_is_used(
    console: Console, calibrate: Callable[[str, str], Any], command: str
) -> None:
    calibrate("soft", NEXT_YEAR)
    said = console(command, JOB.job.name, "--json")
    assert said.err.count(NEXT_YEAR) == 1 and "wrong" in said.err
    assert any(NEXT_YEAR in warning for warning in said.json["warnings"])


def test_a_calibration_that_was_named_by_its_date_comes_before_all_with_a_number(
    console: Console, calibrate: Callable[[str, str], Any], data: Path
) -> None:
    first = Path(calibrate("stiff", NEXT_YEAR).json["kept"])
    first.rename(first.with_name("wrench-20991122T100000Z.json"))
    assert predicted(console).json["sources"][KEY] == NEXT_YEAR
    calibrate("soft", LAST_YEAR)
    assert predicted(console).json["sources"][KEY] == LAST_YEAR


def record_cut(data: Path, monkeypatch: pytest.MonkeyPatch, at: str, compensation: int | None) -> None:
    """Add a run of the job to the record, at that time of 30 November 2001."""
    set_dates(monkeypatch, lambda: f"2001-11-30T{at}:00.000+00:00")
    run = RunRecord(
        data,
        {
            "software": "x",
            "job": JOB.job.name,
            "job_sha256": JOB.sha256,
            "machine": MACHINE.machine.name,
            "machine_sha256": MACHINE.sha256,
            "simulated": 1,
            "strategy": "cam",
            "program": "",
        },
    )
    made = {"strategy": "cam", "stage": "full", "inverted": "model", "compensation": compensation}
    run.add("result", made)
    run.add("measured", {"job": JOB.job.name, "ront_um": 9.0 if compensation is None else 2.0})
    run.close()


def test_a_part_is_of_the_cut_that_was_recorded_last_though_the_clock_was_set_back(
    data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record_cut(data, monkeypatch, LATE, None)
    record_cut(data, monkeypatch, EARLY, 3)
    asked = asked_for(JOB, MACHINE, "", simulated=True)
    assert [made and made.compensation for made in parts_made(cuts_of(data, asked))] == ["3", "none"]
    assert last_results(data, simulated=True)[JOB.job.name].ront_um == 2.0
    assert date_problems(cuts_of(data, asked), asked.job) == ()


def test_a_cut_of_a_day_to_come_is_told(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record_cut(data, monkeypatch, EARLY, None)
    record_cut(data, monkeypatch, EARLY, 3)
    asked = asked_for(JOB, MACHINE, "", simulated=True)
    monkeypatch.setattr("console.session.data.kept_files.utc_now", lambda: "2001-11-29T10:00:00Z")
    (told,) = date_problems(cuts_of(data, asked), asked.job)
    assert (told.code, told.value) == ("record.date_ahead", "2001-11-30T10:00:00.000+00:00")
    assert "2001-11-30T10:00" in load("en").problem(told)


@pytest.mark.long
def test_a_version_of_a_day_to_come_is_told_when_it_is_learned_from_listed_and_cut_with(
    console: Console, data: Path, tmp_path: Path, close: tuple[str, str], job_file: JobFile
) -> None:
    job, part = str(job_file(cut_length_mm="1.5", feed_mm_per_rev="0.1")), str(tmp_path / "part.csv")
    plant = tmp_path / "larger-lobe.toml"
    plant.write_text('schema = 1\nsource = "a wrench that pulls harder"\n[chuck]\nlobe_factor = 1.2\n')
    run = ("run", job, "--sim", "--plant", str(plant), *close, "--strategy", "cam", "--json")
    learn = ("learn", "--job", job, *close, "--json")
    assert console(*run, "--part", part).code == 0
    kept = Path(console(*learn, part, "--gain", "0.5", "--keep").json["kept"])
    kept.write_text(json.dumps({**json.loads(kept.read_text()), "date": NEXT_YEAR}))
    said = console("learn", "--job", job, *close, "--list", "--sim")
    assert f"{NEXT_YEAR} (in the future)" in said.out
    again = str(tmp_path / "again.csv")
    cut = console(*run, "--compensation", "newest", "--part", again)
    assert cut.code == 0 and cut.err.count(NEXT_YEAR) == 1
    assert NEXT_YEAR in console(*learn, again).err


@pytest.mark.parametrize(
    ("date", "ahead"),
    [
        ("2001-11-30T10:11:00Z", True),
        ("2001-11-30T10:09:00Z", False),
        ("2001-11-30T12:09:00+02:00", False),
        ("2001-11-30T10:11:00", True),
        ("9999-12-31T23:59:59-23:59", True),
        ("tomorrow", False),
        ("", False),
    ],
)
def test_a_date_is_ahead_by_more_than_two_clocks_differ(date: str, ahead: bool) -> None:
    assert is_ahead(date, "2001-11-30T10:00:00Z") is ahead
