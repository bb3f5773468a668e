"""Identified responses on the disk: kept once each, to the last bit."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from console.session.data.identified import load, store
from drivers.cutting.strategy import Strategy
from drivers.identification.result import IdentifiedPoint, IdentifiedResponse, Origin, as_table, from_table
from profiles.problem import ProfileError

ORIGIN = Origin(
    machine="lee-2001-lathe",
    simulated=False,
    version="1.17",
    kind="PMAC1, X1",
    gains={"I130": 528.0, "I131": 4905.0, "I132": 4905.0, "I133": 811.0, "I134": 0.0, "I135": 0.0},
    servo_period_ms=0.4427083730697632,
)
POINT = IdentifiedPoint(
    frequency_hz=50.0,
    gain=0.8856,
    phase_deg=-51.7,
    gain_ci=0.0002,
    phase_ci_deg=0.015,
    coherence=0.99999,
    amplitude_um=25.0,
)
RESPONSE = IdentifiedResponse(
    origin=ORIGIN,
    path=Strategy.PVT,
    how="measured",
    delay_cycles=0,
    date="2001-11-30T14:05:00.000Z",
    points=(POINT,),
)


def test_what_was_kept_is_found_again_to_the_last_bit(tmp_path: Path) -> None:
    file = store(tmp_path, RESPONSE)
    assert file == tmp_path / "identified" / "lee-2001-lathe" / "pvt-20011130T140500000Z.json"
    assert load(file) == RESPONSE


@settings(max_examples=25)
@given(
    gain=st.floats(0.0, 10.0),
    phase_deg=st.floats(-180.0, 180.0),
    name=st.text(min_size=1, max_size=30),
    path=st.sampled_from([Strategy.PVT, Strategy.CAM, Strategy.TIMEBASE]),
)
def test_any_response_survives_the_file(gain: float, phase_deg: float, name: str, path: Strategy) -> None:
    point = replace(POINT, gain=gain, phase_deg=phase_deg)
    response = replace(RESPONSE, origin=replace(ORIGIN, machine=name), path=path, points=(point, POINT))
    assert from_table(json.loads(json.dumps(as_table(response)))) == response


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    file = store(tmp_path, RESPONSE)
    with pytest.raises(ProfileError) as refused:
        store(tmp_path, replace(RESPONSE, points=()))
    assert refused.value.problems[0].code == "file.exists"
    assert load(file) == RESPONSE


@pytest.mark.parametrize("name", ["../../outside", "..", ".", "a/b", "lathe 2", "선반", "\x00"])
def test_a_machine_of_any_name_keeps_to_its_folder(tmp_path: Path, name: str) -> None:
    kept = replace(RESPONSE, origin=replace(ORIGIN, machine=name))
    file = store(tmp_path / "data", kept)
    assert file.parent.parent == tmp_path / "data" / "identified"
    assert load(file) == kept


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"[]", b"null", b'{"schema": 1}', b"\xff", b"[" * 100_000],
)
def test_a_file_that_is_none_of_ours_is_named(tmp_path: Path, content: bytes) -> None:
    file = store(tmp_path, RESPONSE)
    file.write_bytes(content)
    with pytest.raises(ProfileError) as refused:
        load(file)
    (problem,) = refused.value.problems
    assert (problem.code, problem.where) == ("identify.file", str(file))


def test_a_point_without_a_number_is_no_point(tmp_path: Path) -> None:
    table = as_table(RESPONSE)
    del table["points"][0]["coherence"]
    with pytest.raises(ProfileError):
        from_table(table)


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "identified").write_text("", encoding="ascii")
    with pytest.raises(ProfileError) as refused:
        store(tmp_path, RESPONSE)
    assert refused.value.problems[0].code == "file.not_writable"


def changed(table: dict[str, Any], keys: tuple[str | int, ...], value: object) -> dict[str, Any]:
    inner: Any = table
    for key in keys[:-1]:
        inner = inner[key]
    inner[keys[-1]] = value
    return table


@pytest.mark.parametrize(
    ("keys", "value"),
    [
        (("points", 0, "amplitude_um"), math.inf),
        (("points", 0, "amplitude_um"), 0.0),
        (("points", 0, "gain"), "0.9"),
        (("points", 0, "phase_deg"), math.nan),
        (("points", 0, "coherence"), True),
        (("points", 0, "more"), 1.0),
        (("origin", "simulated"), "false"),
        (("origin", "simulated"), 0),
        (("origin", "gains", "I130"), "528"),
        (("origin", "servo_period_ms"), 0.0),
        (("origin", "version"), 1.17),
        (("delay_cycles",), 2.7),
        (("delay_cycles",), "2"),
        (("how",), "guessed"),
        (("date",), 20011130),
    ],
)
def test_a_value_of_another_type_is_refused_and_not_converted(
    tmp_path: Path, keys: tuple[str | int, ...], value: object
) -> None:
    file = store(tmp_path, RESPONSE)
    table = changed(json.loads(file.read_text(encoding="utf-8")), keys, value)
    file.write_text(json.dumps(table), encoding="utf-8")
    with pytest.raises(ProfileError) as refused:
        load(file)
    assert [(p.code, p.where) for p in refused.value.problems] == [("identify.file", str(file))]
