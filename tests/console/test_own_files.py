"""Every kind of file of our own: whatever one of its fields holds, it is read or refused with a problem."""

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

from console.session.data import calibrations, identified_responses, learned_store, stop_records
from console.session.data.calibrated_chuck import apply_calibrations
from console.session.data.history import last_results
from console.session.data.kept_files import data_folder
from console.session.data.learned_store import asked_for
from console.session.data.measured_part import cuts_of, parts_made
from console.session.data.records import RunRecord
from drivers.commissioning.stop_record import PriorMotion, StopEntry, StopMethod, StopRecord
from drivers.link.base import StopWay
from drivers.pmac.dialect import DIALECTS
from drivers.simulator.card.saved_state import Flash
from drivers.simulator.machine import SimulatedLathe
from profiles.calibration.wrench import fit_wrench
from profiles.compensations.learned_compensation import HoldsFor, LearnedCompensation, PartReading
from profiles.compensations.path import CutPath, LobedPath, PathHarmonic
from profiles.problem import ProblemError, ProfileError
from profiles.store import load_job, load_machine
from profiles.strict_values import DEPTH_CAP, from_json
from tests.console.commands import Console
from tests.console.test_identify_command import RESPONSE

LOADED = load_machine("lee-2001-lathe")
MACHINE = LOADED.machine
HOLDS = HoldsFor(job="j", job_sha256="a", machine="m", machine_sha256="b", simulated=True, strategy="pvt")
WAVE = PathHarmonic(lobes=3, amplitude_um=27.5, phase_deg=10.0)
PATH = LobedPath(mean_um=50.0, amplitude_um=27.5, lobes=3, phase_deg=10.0, overtones=(WAVE,))
LEARNED = LearnedCompensation(
    holds_for=HOLDS,
    version=1,
    parent=0,
    gain=0.5,
    path=CutPath(target=PATH, command=PATH),
    part=PartReading(version=0, fraction=1.0, target=WAVE, lobe=WAVE, lobe_sd_um=0.1, ront_um=5.0),
    date="2001-11-30T14:05:00Z",
)
CALIBRATION = calibrations.Calibration(
    kind="wrench",
    subject="m",
    subject_sha256="b",
    date="2001-11-30T14:05:00Z",
    file="w.csv",
    file_sha256="c",
    found={"sd_n": 1.0},
    chuck="SC-160",
)
ENTRY = StopEntry(
    way=StopMethod.ABORT, origin=PriorMotion.JOG, axis="tool", time_s=0.1, distance_mm=0.5, speed_mm_per_s=20.0
)
STOPS = StopRecord(
    machine=MACHINE.name,
    kind="PMAC1",
    version="1.17",
    key="k",
    measured_at=date(2001, 11, 30),
    address="tcp:10.0.0.7:1025",
    stop_way=StopWay.RESERVED,
    entries=(ENTRY,),
)


def learned(folder: Path) -> tuple[Path, Callable[[], object]]:
    file = learned_store.store(folder, LEARNED)
    return file, lambda: learned_store.versions(folder, HOLDS)


def response(folder: Path) -> tuple[Path, Callable[[], object]]:
    file = identified_responses.store(folder, RESPONSE)
    return file, lambda: identified_responses.load(file)


def calibration(folder: Path) -> tuple[Path, Callable[[], object]]:
    file = calibrations.store(folder, CALIBRATION)
    return file, lambda: calibrations.load(file, "m", "wrench")


def stops(folder: Path) -> tuple[Path, Callable[[], object]]:
    file = stop_records.store(folder, MACHINE, STOPS)
    return file, lambda: stop_records.load(folder, MACHINE)


def saved(folder: Path) -> tuple[Path, Callable[[], object]]:
    card = SimulatedLathe(MACHINE, dialect=DIALECTS[MACHINE.controller.family]).controller
    Flash(folder / "flash.json").save(card)
    return folder / "flash.json", lambda: Flash(folder / "flash.json").power_up(card)


def judged(folder: Path) -> tuple[Path, Callable[[], object]]:
    """A calibration as it is used: of a profile that leaves the line open, and of one that states it."""
    torque = [10.0, 20.0, 30.0, 40.0, 50.0]
    fit = fit_wrench(torque, [300.0 * each + 5.0 * (-1) ** i for i, each in enumerate(torque)], affine=True)
    found = {**asdict(fit), "profile": {"force_per_torque_n_per_n_m": 300.0}}
    own = replace(CALIBRATION, subject=MACHINE.name, found=found, chuck=MACHINE.chuck.name)
    file = calibrations.store(folder, own)
    line = ("chuck.force_per_torque_n_per_n_m", "chuck.force_offset_n")
    loaded = [replace(LOADED, machine=replace(MACHINE, assumed=assumed)) for assumed in ((), line)]
    return file, lambda: [apply_calibrations(each, folder) for each in loaded]


KINDS = [learned, response, calibration, judged, stops, saved]


def nested(levels: int) -> Any:
    value: Any = 0
    for _ in range(levels):
        value = [value]
    return value


WRONG: tuple[object, ...] = (
    *(
        None,
        "",
        "word",
        "false",
        "\x1b[2J",
        "9" * 400,
        True,
        -1,
        0,
        2.5,
        1e-320,
        1e308,
        math.inf,
        math.nan,
        10**400,
    ),
    *([], [1], {}, {"a": 1}, nested(10), nested(DEPTH_CAP + 1), nested(600)),
)
DEEP = ("[" * 100_000, '{"schema":' * 50_000, f'{{"schema": {"[" * 900}{"]" * 900}}}')


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.first(3)
def test_any_value_anywhere_is_read_or_refused(
    tmp_path: Path, kind: Callable[[Path], tuple[Path, Callable[[], object]]]
) -> None:
    file, read = kind(tmp_path)
    table = json.loads(file.read_text(encoding="utf-8"))
    read()
    for place in places(table):
        for value in (*WRONG, KeyError):
            write(file, changed(table, place, value))
            if value is KeyError and place == ("schema",) and kind is not saved:
                assert refused(read), place
                continue
            refused(read)
    for content in (*(json.dumps(value) for value in WRONG), *DEEP):
        file.write_text(content, encoding="utf-8")
        refused(read)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("schema", [99, 0, "1", 1.0, True, None, []])
def test_an_unknown_schema_is_refused_with_what_is_read(
    tmp_path: Path, kind: Callable[[Path], tuple[Path, Callable[[], object]]], schema: object
) -> None:
    file, read = kind(tmp_path)
    write(file, changed(json.loads(file.read_text(encoding="utf-8")), ("schema",), schema))
    assert refused(read) == ["stops.unknown_schema" if kind is stops else "schema.unsupported"]


def refused(read: Callable[[], object]) -> list[str]:
    """Return the codes of the refusal; anything else that is raised fails the test."""
    try:
        read()
    except ProblemError as refusal:
        assert isinstance(refusal, ProfileError)
        assert all(problem.where for problem in refusal.problems)
        return [problem.code for problem in refusal.problems]
    return []


def write(file: Path, table: dict[str, Any]) -> None:
    if "sha256" in table and "entries" in table:
        file.write_bytes(stop_records.with_checksum({k: v for k, v in table.items() if k != "sha256"}))
    else:
        file.write_text(json.dumps(table), encoding="utf-8")


def places(table: object, above: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Yield where every field stands, of lists and of numbered things the first."""
    if isinstance(table, dict):
        for key, value in list(table.items())[: 2 if all(k.isdigit() for k in table) else None]:
            yield (*above, key)
            yield from places(value, (*above, key))
    elif isinstance(table, list) and table:
        yield (*above, 0)
        yield from places(table[0], (*above, 0))


def changed(table: dict[str, Any], place: tuple[str | int, ...], value: object) -> dict[str, Any]:
    copied = copy.deepcopy(table)
    inner: Any = copied
    for key in place[:-1]:
        inner = inner[key]
    if value is KeyError:
        del inner[place[-1]]
    else:
        inner[place[-1]] = value
    return copied


def test_an_event_with_any_value_is_a_part_or_none(tmp_path: Path) -> None:
    job = load_job("lee-2001-experiment-1")
    run = dict.fromkeys(("software", "job", "machine", "strategy", "program"), "")
    hashes = {"job_sha256": job.sha256, "machine_sha256": LOADED.sha256, "simulated": 1}
    record = RunRecord(tmp_path, {**run, **hashes})
    good: dict[str, object] = {"job": "ring", "ront_um": 2.0, "strategy": "cam", "stage": "full"}
    good |= {"inverted": "model", "compensation": 3}
    for kind in ("measured", "cut", "result"):
        for key in good:
            for value in WRONG:
                record.add(kind, {**good, key: value})
        record.add(kind, good)
    record.close()
    assert last_results(tmp_path, simulated=True)["ring"].ront_um == 2.0
    made = parts_made(cuts_of(tmp_path, asked_for(job, LOADED, "", simulated=True)))
    assert made[0] is not None and made[0].compensation == "3"


def test_json_is_read_as_deep_as_our_files_are_and_no_deeper() -> None:
    for content in (*DEEP, "", "nul", b"\xff", "9" * 5000):
        with pytest.raises(ValueError, match=r"."):
            from_json(content)
    assert from_json(json.dumps(nested(DEPTH_CAP - 1))) == nested(DEPTH_CAP - 1)


def test_without_any_home_the_data_folder_is_asked_for(
    console: Console, tmp_path: Path, monkeypatch: MonkeyPatch
) -> None:
    """A home that is not told is that of the user."""
    monkeypatch.delenv("XDG_DATA_HOME", raising=False)
    monkeypatch.delenv("HOME", raising=False)
    monkeypatch.setattr(pwd, "getpwuid", lambda _: pwd.struct_passwd(("n", "x", 1, 1, "", str(tmp_path), "")))
    assert data_folder() == tmp_path / ".local" / "share" / "trilobe"

    def nobody(_: int) -> None:
        raise KeyError("getpwuid(): uid not found")

    monkeypatch.setattr(pwd, "getpwuid", nobody)
    for home in (None, "", "relative"):
        if home is not None:
            monkeypatch.setenv("HOME", home)
        said = console("jobs")
        assert (said.code, said.out, said.err.count("\n")) == (1, "", 1)
        assert "--data FOLDER" in said.err and "fault" not in said.err
    assert console("jobs", "--data", str(tmp_path)).code == 0
