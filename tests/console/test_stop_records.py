"""The stop record on the disk, the one that a simulator measures at once, and what is said before an arm."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.session.data.stop_records import (
    load,
    record_path,
    simulated_record,
    stop_record_problems,
    store,
    with_checksum,
    withdraw,
)
from console.text.catalogue import load as load_words
from drivers.commissioning.stop_record import Origin, StopEntry, StopRecord, Way, needed_stops
from drivers.link.base import StopWay
from drivers.pmac.dialect import PMAC
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError
from profiles.store import load_machine
from profiles.words.sentences import Sentences, words_of
from tests.drivers.commissioned import Commissioned, commissioned

TODAY = date(2026, 3, 1)
MACHINE = load_machine("lee-2001-lathe").machine


@pytest.fixture(scope="module")
def simulated() -> StopRecord:
    return simulated_record(MACHINE, PMAC, TODAY)


def said(card: Commissioned, data: Path | None, *, simulator: bool = False, now: date = TODAY) -> list[str]:
    found = stop_record_problems(card.client, card.machine, card.dialect, data, simulator, now)
    return [problem.code for problem in found]


def test_a_simulator_measures_its_own_at_once(simulated: StopRecord) -> None:
    assert {(e.way, e.origin, e.axis) for e in simulated.entries} == needed_stops(MACHINE)
    assert said(commissioned(MACHINE), None, simulator=True) == []


def test_a_simulator_that_somebody_has_changed_is_not_armed() -> None:
    card = commissioned(MACHINE)
    card.tell("I115=20")
    assert said(card, None, simulator=True) == ["stops.other_settings"]


def test_a_simulated_machine_that_nothing_would_end_has_no_complete_record() -> None:
    variables = {**MACHINE.controller.variables, "I5": 0.0}
    card = commissioned(replace(MACHINE, controller=replace(MACHINE.controller, variables=variables)))
    assert said(card, None, simulator=True) == ["stops.incomplete"]


def test_a_machine_of_iron_needs_a_record_of_its_own(tmp_path: Path, simulated: StopRecord) -> None:
    card = commissioned(MACHINE)
    assert said(card, tmp_path) == ["stops.no_record"]
    assert said(card, None) == ["stops.no_record"]
    store(tmp_path, MACHINE, simulated)
    assert said(card, tmp_path) == []
    assert said(card, tmp_path, now=TODAY + timedelta(days=181)) == ["stops.expired"]
    store(tmp_path, MACHINE, replace(simulated, stop_way=StopWay.RESERVED))
    assert said(card, tmp_path) == ["stops.other_way"]
    store(tmp_path, MACHINE, simulated)
    card.tell("I235=100")
    assert said(card, tmp_path) == ["stops.other_settings"]
    withdraw(tmp_path, MACHINE)
    assert said(card, tmp_path) == ["stops.no_record"]
    withdraw(tmp_path, MACHINE)


def test_nothing_is_armed_while_the_connection_for_stops_is_lost(tmp_path: Path, simulated: StopRecord) -> None:
    card = commissioned(MACHINE)
    store(tmp_path, MACHINE, replace(simulated, stop_way=StopWay.RESERVED))
    for way, target in ((StopWay.LOST, ["stops.connection_lost"]), (StopWay.RESERVED, [])):
        card.link.stop_way = way
        assert said(card, tmp_path) == target


def test_what_is_stored_comes_back(tmp_path: Path, simulated: StopRecord) -> None:
    assert load(tmp_path, MACHINE) is None
    path = store(tmp_path, MACHINE, simulated)
    assert path == tmp_path / "stops" / "lee-2001-lathe.json"
    assert load(tmp_path, MACHINE) == simulated
    store(tmp_path, MACHINE, replace(simulated, measured_at=TODAY + timedelta(days=1)))
    loaded = load(tmp_path, MACHINE)
    assert loaded is not None
    assert loaded.measured_at == date(2026, 3, 2)


@pytest.mark.parametrize("name", ["../lathe", "a/b", "선반 2", "..", "x" * 40])
def test_a_name_leads_to_a_file_in_the_folder(tmp_path: Path, name: str) -> None:
    machine: MachineProfile = replace(MACHINE, name=name)
    assert record_path(tmp_path, machine).resolve().parent == tmp_path / "stops"


@pytest.mark.parametrize(
    "change",
    [
        lambda values: values.clear(),
        lambda values: values.update(stop_way="by post"),
        lambda values: values.pop("stop_way"),
        lambda values: values.update(measured_at="yesterday"),
        lambda values: values.update(entries=[{"way": "abort"}]),
        lambda values: values["entries"][0].update(way="shout"),
        lambda values: values["entries"][0].update(time_s="long"),
        lambda values: values["entries"][0].update(time_s=True),
        lambda values: values["entries"][0].update(time_s=float("nan")),
        lambda values: values["entries"][0].update(time_s=float("inf")),
        lambda values: values["entries"][0].update(time_s=-0.1),
        lambda values: values.update(version=1.17),
        lambda values: values["entries"][0].update(time_s=10**400),
        lambda values: values.update(address=5),
        lambda values: values.update(more=1),
    ],
)
def test_a_file_that_is_no_record_is_told_and_arms_nothing(
    tmp_path: Path, simulated: StopRecord, change: object
) -> None:
    path = store(tmp_path, MACHINE, simulated)
    values = json.loads(path.read_text(encoding="utf-8"))
    assert callable(change)
    change(values)
    write(path, values)
    assert said(commissioned(MACHINE), tmp_path) == ["stops.unreadable"]


def write(path: Path, values: dict[str, Any]) -> None:
    """Write a file whose checksum is right, whatever is in it."""
    values.pop("sha256", None)
    path.write_bytes(with_checksum(values))


def test_the_checksum_is_that_of_the_file_without_it(tmp_path: Path, simulated: StopRecord) -> None:
    content = store(tmp_path, MACHINE, simulated).read_bytes()
    digest = json.loads(content)["sha256"]
    assert hashlib.sha256(content.replace(digest.encode(), b"")).hexdigest() == digest


def test_a_record_with_a_right_checksum_is_judged_by_its_numbers(tmp_path: Path, simulated: StopRecord) -> None:
    path = store(tmp_path, MACHINE, simulated)
    values = json.loads(path.read_text(encoding="utf-8"))
    write(path, values)
    assert said(commissioned(MACHINE), tmp_path) == []
    for entry in values["entries"]:
        entry["time_s"] = 0
    write(path, values)
    assert said(commissioned(MACHINE), tmp_path) == ["stops.impossible"] * len(simulated.entries)


@given(st.data())
def test_one_flipped_digit_is_seen(
    tmp_path_factory: pytest.TempPathFactory, simulated: StopRecord, data: st.DataObject
) -> None:
    folder = tmp_path_factory.mktemp("data")
    path = store(folder, MACHINE, simulated)
    text = path.read_text(encoding="utf-8")
    places = [found.start() for found in re.finditer(r"\d", text)]
    place = data.draw(st.sampled_from(places))
    digit = str((int(text[place]) + data.draw(st.integers(1, 9))) % 10)
    path.write_text(text[:place] + digit + text[place + 1 :], encoding="utf-8")
    with pytest.raises(ProfileError) as refusal:
        load(folder, MACHINE)
    assert refusal.value.problems[0].code.startswith("stops.")


@pytest.mark.parametrize("schema", [0, 2, 1.0, "1", None])
def test_a_record_of_another_version_is_to_be_measured_again(
    tmp_path: Path, simulated: StopRecord, schema: object
) -> None:
    path = store(tmp_path, MACHINE, simulated)
    values = json.loads(path.read_text(encoding="utf-8"))
    values["schema"] = schema
    del values["sha256"]
    path.write_text(json.dumps(values), encoding="utf-8")
    (problem,) = stop_problems(tmp_path)
    assert problem.code == "stops.unknown_schema"
    for language in ("en", "ko"):
        told = load_words(language).problem(problem)
        assert "console doctor --machine lee-2001-lathe --prove" in told, told


def stop_problems(data: Path) -> tuple[Problem, ...]:
    card = commissioned(MACHINE)
    return stop_record_problems(card.client, card.machine, card.dialect, data, False, TODAY)


def test_the_record_of_another_machine_or_link_arms_nothing(tmp_path: Path, simulated: StopRecord) -> None:
    sister = replace(MACHINE, name="its-sister")
    measured = store(tmp_path, sister, replace(simulated, machine=sister.name))
    measured.rename(record_path(tmp_path, MACHINE))
    (problem,) = stop_problems(tmp_path)
    assert (problem.code, problem.value, problem.limit) == ("stops.other_machine", "its-sister", MACHINE.name)
    store(tmp_path, MACHINE, replace(simulated, address="ethernet:10.0.0.7"))
    (problem,) = stop_problems(tmp_path)
    assert (problem.code, problem.value, problem.limit) == ("stops.other_address", "ethernet:10.0.0.7", "memory")


@given(content=st.binary(max_size=60))
def test_whatever_is_in_the_file_is_a_record_or_a_refusal(
    tmp_path_factory: pytest.TempPathFactory, content: bytes
) -> None:
    folder = tmp_path_factory.mktemp("data")
    path = record_path(folder, MACHINE)
    path.parent.mkdir(parents=True)
    path.write_bytes(content)
    with pytest.raises(ProfileError):
        load(folder, MACHINE)


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path, simulated: StopRecord) -> None:
    (tmp_path / "stops").write_text("", encoding="ascii")
    with pytest.raises(ProfileError) as refusal:
        store(tmp_path, MACHINE, simulated)
    assert refusal.value.problems[0].code == "file.not_writable"


def test_an_entry_has_the_unit_of_its_axis(simulated: StopRecord) -> None:
    for entry in simulated.entries:
        assert isinstance(entry, StopEntry)
        turned = entry.distance_deg is not None and entry.speed_rpm is not None
        moved = entry.distance_mm is not None and entry.speed_mm_per_s is not None
        assert (turned, moved) == ((True, False) if entry.axis == "spindle" else (False, True))
        if entry.axis == "spindle":
            assert entry.speed_rpm == pytest.approx(1000.0 if entry.origin is Origin.CUT else 100.0, rel=1e-4)
    assert {e.way for e in simulated.entries} == set(Way)


def test_a_file_that_was_cut_short_is_told_by_its_line_and_in_no_programmers_words(
    tmp_path: Path, simulated: StopRecord
) -> None:
    path = store(tmp_path, MACHINE, simulated)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    line = whole[: len(whole) // 2].count(b"\n") + 1
    with pytest.raises(ProfileError) as caught:
        load(tmp_path, MACHINE)
    (problem,) = caught.value.problems
    assert problem.code == "stops.unreadable" and problem.value.endswith(f": {line}")
    korean = Sentences(words_of("ko")).problem(problem)
    assert f": {line}" in korean and "damaged" not in korean and "Expecting" not in korean
