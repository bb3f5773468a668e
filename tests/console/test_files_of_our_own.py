"""Whatever stands in a file of our own is read as it is or refused; no value of it is a fault of the console."""

from __future__ import annotations

import copy
import json
import math
import pwd
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from datetime import date
from pathlib import Path
from typing import Any

import pytest
from pytest import MonkeyPatch

from console.session.data import calibrations, identified, learned_store, stop_records
from console.session.data.calibrated_chuck import calibrated
from console.session.data.calibrations import Calibration
from console.session.data.history import last_results
from console.session.data.kept_files import data_folder
from console.session.data.learned_store import asked_for
from console.session.data.measured_part import cuts_of, parts_made
from console.session.data.records import RunRecord
from drivers.errors import DriverError
from drivers.pmac.dialect import DIALECTS
from drivers.simulator.card.saved_state import Flash
from drivers.simulator.machine import SimulatedLathe
from profiles.calibration.wrench import fit_wrench
from profiles.compensations.learned import LearnedCompensation, PartRead
from profiles.compensations.path import CutPath, PathHarmonic, target_path
from profiles.problem import ProblemError
from profiles.store import load_job, load_machine
from profiles.strict_values import DEPTH_CAP, from_json
from tests.console.commands import Console
from tests.console.test_identify_command import RESPONSE

JOB, MACHINE = load_job("lee-2001-experiment-1"), load_machine("lee-2001-lathe")


def nested(levels: int) -> Any:
    value: Any = 0
    for _ in range(levels):
        value = [value]
    return value


HOSTILE: tuple[Any, ...] = (
    10**400,
    -1,
    0,
    2.7,
    1e-320,
    1e308,
    math.inf,
    math.nan,
    True,
    None,
    "",
    "false",
    "\x1b[2J",
    "9" * 400,
    [],
    {},
    nested(10),
    nested(DEPTH_CAP + 1),
    nested(600),
)
DEEP = ("[" * 100_000, '{"schema":' * 50_000, f'{{"schema": {"[" * 900}{"]" * 900}}}')


def learned(data: Path) -> Path:
    path = target_path(JOB.job)
    harmonic = PathHarmonic.of(3, 1.0 + 1.0j)
    part = PartRead(version=0, fraction=1.0, target=harmonic, lobe=harmonic, lobe_sd_um=0.1, ront_um=2.0)
    version = LearnedCompensation(
        holds_for=asked_for(JOB, MACHINE, "cam", simulated=True),
        version=1,
        parent=0,
        gain=1.0,
        path=CutPath(target=path, command=path),
        part=part,
        date="2001-11-30T10:00:00Z",
    )
    return learned_store.store(data, version)


def calibration(data: Path) -> Path:
    torque = [10.0, 20.0, 30.0, 40.0, 50.0]
    fit = fit_wrench(torque, [300.0 * each + 5.0 * (-1) ** i for i, each in enumerate(torque)], affine=True)
    kept = Calibration(
        kind="wrench",
        subject=MACHINE.machine.name,
        subject_sha256="0",
        date="2001-11-30T10:00:00Z",
        file="w.csv",
        file_sha256="0",
        found={**asdict(fit), "profile": {"force_per_torque_n_per_n_m": 300.0}},
        chuck=MACHINE.machine.chuck.name,
    )
    return calibrations.store(data, kept)


def stops(data: Path) -> Path:
    record = stop_records.simulated_record(MACHINE.machine, DIALECTS["pmac"], date(2001, 11, 30))
    return stop_records.store(data, MACHINE.machine, record)


def saved(data: Path) -> Path:
    path = data / "saved.json"
    data.mkdir(exist_ok=True)
    sim = SimulatedLathe(MACHINE.machine)
    Flash(path).save(sim.controller)
    return path


def power_up(data: Path) -> None:
    sim = SimulatedLathe(MACHINE.machine)
    Flash(data / "saved.json").power_up(sim.controller)


def judged(data: Path) -> None:
    """With a profile that leaves the line open, and one that states it."""
    for assumed in ((), ("chuck.force_per_torque_n_per_n_m", "chuck.force_offset_n")):
        try:
            calibrated(replace(MACHINE, machine=replace(MACHINE.machine, assumed=assumed)), data)
        except ProblemError:
            continue


WRITERS: dict[str, tuple[Callable[[Path], Path], Callable[[Path], object]]] = {
    "identified": (
        lambda data: identified.store(data, RESPONSE),
        lambda data: [identified.load(file) for file in data.rglob("*.json")],
    ),
    "learned": (
        learned,
        lambda data: learned_store.versions(data, asked_for(JOB, MACHINE, "cam", simulated=True)),
    ),
    "calibration": (calibration, judged),
    "stops": (stops, lambda data: stop_records.load(data, MACHINE.machine)),
    "saved state": (saved, power_up),
}


def places(table: Any, above: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Every place of a file, but of many alike the first only."""
    inner = list(table.items())[:12] if isinstance(table, dict) else list(enumerate(table))[:1]
    for key, value in inner:
        yield (*above, key)
        if isinstance(value, dict | list):
            yield from places(value, (*above, key))


def changed(table: Any, place: tuple[Any, ...], value: object) -> Any:
    table = copy.deepcopy(table)
    inner = table
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    return table


@pytest.mark.parametrize("what", WRITERS)
@pytest.mark.first(2)
def test_a_file_of_ours_with_any_value_anywhere_is_read_or_refused(tmp_path: Path, what: str) -> None:
    write, read = WRITERS[what]
    path = write(tmp_path / "data")
    read(tmp_path / "data")
    table = json.loads(path.read_text(encoding="utf-8"))
    contents = [
        *(json.dumps(changed(table, place, value)) for place in places(table) for value in HOSTILE),
        *(json.dumps(value) for value in HOSTILE),
        *DEEP,
    ]
    assert len(contents) > 100
    for content in contents:
        path.write_text(content, encoding="utf-8")
        try:
            read(tmp_path / "data")
        except (ProblemError, DriverError):
            continue


def test_an_event_with_any_value_is_a_part_or_none(tmp_path: Path) -> None:
    run = {
        **dict.fromkeys(("software", "job", "machine", "strategy", "program"), ""),
        "job_sha256": JOB.sha256,
        "machine_sha256": MACHINE.sha256,
        "simulated": 1,
    }
    record = RunRecord(tmp_path, run)
    good: dict[str, object] = {"job": "ring", "ront_um": 2.0, "strategy": "cam", "stage": "full"}
    good |= {"inverted": "model", "compensation": 3}
    for kind in ("measured", "cut", "result"):
        for key in good:
            for value in HOSTILE:
                record.add(kind, {**good, key: value})
        record.add(kind, good)
    record.close()
    assert last_results(tmp_path, simulated=True)["ring"].ront_um == 2.0
    made = parts_made(cuts_of(tmp_path, asked_for(JOB, MACHINE, "", simulated=True)))
    assert made[0] is not None and made[0].compensation == "3"


@pytest.mark.parametrize("content", [*DEEP, "", "nul", b"\xff", "9" * 5000])
def test_what_is_no_json_of_ours_is_one_kind_of_error(content: str | bytes) -> None:
    with pytest.raises(ValueError, match=r"."):
        from_json(content)


def test_json_is_read_as_deep_as_our_files_are() -> None:
    assert from_json(json.dumps(nested(DEPTH_CAP - 1))) == nested(DEPTH_CAP - 1)


@pytest.mark.parametrize("home", [None, "", "relative"])
def test_without_any_home_the_data_folder_is_asked_for(
    console: Console, tmp_path: Path, monkeypatch: MonkeyPatch, home: str | None
) -> None:
    def nobody(_: int) -> None:
        raise KeyError("getpwuid(): uid not found")

    monkeypatch.setattr(pwd, "getpwuid", nobody)
    monkeypatch.setenv("HOME", home) if home is not None else monkeypatch.delenv("HOME", raising=False)
    monkeypatch.delenv("XDG_DATA_HOME", raising=False)
    said = console("jobs")
    assert (said.code, said.out, said.err.count("\n")) == (1, "", 1)
    assert "--data FOLDER" in said.err and "fault" not in said.err
    assert console("jobs", "--data", str(tmp_path)).code == 0


def test_a_home_that_is_not_told_is_that_of_the_user(monkeypatch: MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("HOME", raising=False)
    monkeypatch.delenv("XDG_DATA_HOME", raising=False)
    monkeypatch.setattr(pwd, "getpwuid", lambda _: pwd.struct_passwd(("n", "x", 1, 1, "", str(tmp_path), "")))
    assert data_folder() == tmp_path / ".local" / "share" / "trilobe"
