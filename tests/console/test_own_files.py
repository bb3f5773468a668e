"""Every kind of file of our own: whatever one of its fields holds, it is read or refused with a problem."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from datetime import date
from pathlib import Path
from typing import Any

import pytest

from console.session.data import calibrations, identified, learned_store, stop_records
from drivers.commissioning.stop_record import Origin, StopEntry, StopRecord, Way
from drivers.link.base import StopWay
from drivers.pmac.dialect import DIALECTS
from drivers.simulator.card.saved_state import Flash
from drivers.simulator.machine import SimulatedLathe
from profiles.compensations.learned import HoldsFor, LearnedCompensation, PartRead
from profiles.compensations.path import CutPath, LobedPath, PathHarmonic
from profiles.problem import ProblemError, ProfileError
from profiles.store import load_machine
from tests.console.test_identify_command import RESPONSE

MACHINE = load_machine("lee-2001-lathe").machine
HOLDS = HoldsFor(job="j", job_sha256="a", machine="m", machine_sha256="b", simulated=True, strategy="pvt")
WAVE = PathHarmonic(lobes=3, amplitude_um=27.5, phase_deg=10.0)
PATH = LobedPath(mean_um=50.0, amplitude_um=27.5, lobes=3, phase_deg=10.0, overtones=(WAVE,))
LEARNED = LearnedCompensation(
    holds_for=HOLDS,
    version=1,
    parent=0,
    gain=0.5,
    path=CutPath(target=PATH, command=PATH),
    part=PartRead(version=0, fraction=1.0, target=WAVE, lobe=WAVE, lobe_sd_um=0.1, ront_um=5.0),
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
ENTRY = StopEntry(way=Way.ABORT, origin=Origin.JOG, axis="tool", time_s=0.1, distance_mm=0.5, speed_mm_per_s=20.0)
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
    file = identified.store(folder, RESPONSE)
    return file, lambda: identified.load(file)


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


KINDS = [learned, response, calibration, stops, saved]
WRONG: tuple[object, ...] = (None, "", "word", True, -1, 2.5, [], [1], {}, {"a": 1}, float("inf"), 10**400)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.first(2)
def test_a_field_of_a_wrong_type_or_a_missing_one_is_read_or_refused(
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
    copy: dict[str, Any] = json.loads(json.dumps(table))
    inner: Any = copy
    for key in place[:-1]:
        inner = inner[key]
    if value is KeyError:
        del inner[place[-1]]
    else:
        inner[place[-1]] = value
    return copy
