"""A line of the feed: what it says of a moment, what it never says, and which lines ask for it."""

from __future__ import annotations

import json
import math
import re
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.session.feed.observed_state import RUN, ObservedState
from console.session.feed.report import line_of, report
from console.session.feed.request import LEAST_HZ, MOST_HZ, asked_hz, request_line
from console.session.station.progress import CutStage
from console.session.station.state import Activity, StationState, StopState
from drivers.lathe.console_role import ConsoleRole, Signature
from drivers.simulator.plant.workshop_view import Truth, WorkshopView
from profiles.store import load_machine
from tests.tui import scenes

LATHE = "lee-2001-lathe"
DOCUMENT = Path(__file__).parents[3] / "docs" / "feed.md"
CUTTING = replace(scenes.machine(Activity.CUTTING), cut=scenes.cut(), spindle_rpm=1000.314)


def said(state: StationState, **more: Any) -> dict[str, Any]:
    """The values of a line, as a reader has them."""
    observed = ObservedState(state=state, machine=load_machine(LATHE).machine, now_s=state.at_s, **more)
    found: dict[str, Any] = json.loads(
        line_of(asdict(report(observed, process=7, operator="kim", at_utc="2026-01-01T00:00:00Z")))
    )
    return found


def test_a_cut_is_told_in_millimetres_and_degrees() -> None:
    line = said(CUTTING, job="ring", run_id="ab12", parts=3)
    machine = load_machine(LATHE).machine
    radius_mm = machine.tool.home_radius_mm - 243_827.0 / machine.tool.counts_per_mm
    angle_deg = (10_351.0 / machine.spindle.counts_per_rev * 360.0) % 360.0
    assert line["axes"] == {
        "tool_radius_mm": pytest.approx(radius_mm, abs=1e-5),
        "carriage_mm": pytest.approx(41_287.0 / machine.carriage.counts_per_mm, abs=1e-5),
        "spindle_deg": pytest.approx(angle_deg, abs=1e-3),
    }
    assert line["cut"] == {"stage": "cut", "turn": 83.2, "turns": 160.0, "left_s": 4.6}
    assert (line["spindle_rpm"], line["tool_error_um"], line["parts"]) == (1000.314, -0.587, 3)
    assert (line["execution"], line["mode"], line["job"], line["run_id"]) == (
        "active",
        "automatic",
        "ring",
        "ab12",
    )
    assert line["controlled_by"]["name"] == "kim"


def test_the_next_step_has_its_key_and_what_is_against_it() -> None:
    ready = replace(scenes.machine(Activity.READY), alignment=scenes.ALIGNED)
    arm = said(ready, work=scenes.signed())["next"]
    assert (arm["word"], arm["key"], arm["why"]) == ("run.arm", "run.arm", [])
    assert (arm["force_n"], arm["radius_mm"], arm["left_s"]) == (1314.0, 26.0, None)
    jaw = said(replace(ready, alignment=scenes.AT_JAW), work=scenes.signed())["next"]
    assert (jaw["word"], jaw["key"]) == ("align.jaw_enable", "align.enable")
    assert [each["code"] for each in jaw["why"]] == ["alignment.no_jaw", "alignment.no_touch_off"]
    enabled = said(replace(ready, alignment=scenes.AT_JAW, jog_enabled=True), work=scenes.signed())["next"]
    assert (enabled["word"], enabled["key"]) == ("align.jaw", "align.take")
    assert said(ready)["next"]["word"] == "run.no_job"
    assert said(CUTTING, work=scenes.signed())["next"] == {**arm, "word": "run.cutting", "key": None}
    assert said(CUTTING, program=RUN)["next"] is None


def test_what_is_not_known_or_not_to_be_known_is_in_no_line() -> None:
    left = replace(scenes.cut(), stage=CutStage.RETRACT, tool_error_um=-2069.7)
    assert said(replace(CUTTING, cut=left))["tool_error_um"] is None, "on its way out it has none"
    for spoilt in (math.nan, math.inf):
        assert said(replace(CUTTING, spindle_rpm=spoilt))["spindle_rpm"] is None
    truth = Truth(jaw_1_deg=123.456, zero_radius_mm=234.567, reachable_um=345.678)
    view = WorkshopView(jaw_1_past_mark_deg=-45.678, tool_gap_mm=56.789)
    assert said(replace(CUTTING, seen=view, truth=truth)) == said(CUTTING)
    assert CUTTING.snapshot is not None
    plain = replace(CUTTING.snapshot.tool, flags=frozenset())
    unhomed = replace(CUTTING, snapshot=replace(CUTTING.snapshot, tool=plain, spindle=plain, carriage=plain))
    assert set(said(unhomed)["axes"].values()) == set(said(StationState())["axes"].values()) == {None}


def test_every_value_is_documented_and_every_documented_one_is_there() -> None:
    documented = re.findall(
        r"^\| `([a-z_]+)` ", DOCUMENT.read_text(encoding="utf-8").partition("## Metrics")[0], re.M
    )
    assert documented == list(said(CUTTING))


STOPPED = StopState(reason="space", killed=False, sent_s=1.0)


@pytest.mark.parametrize(
    ("state", "execution"),
    [
        (StationState(), "unavailable"),
        (replace(CUTTING, activity=Activity.LOST), "unavailable"),
        (scenes.machine(Activity.READY), "ready"),
        (scenes.machine(Activity.HOMING), "active"),
        (replace(scenes.machine(Activity.STOPPED), stop=STOPPED), "stopped"),
    ],
)
def test_the_execution_is_a_word_of_mtconnect(state: StationState, execution: str) -> None:
    assert said(state)["execution"] == execution


def test_alarms_have_number_priority_and_state_of_the_page_alarms() -> None:
    alarms, log = scenes.alarmed()
    numbers = {(entry.problem.code, entry.problem.key): entry.number for entry in log.alarms.standing}
    found = said(replace(CUTTING, alarms=alarms), numbers=numbers)["alarms"]
    assert {(each["number"], each["code"]) for each in found} >= {(2, "machine.fault"), (4, "record.lost")}
    assert [(each["priority"], each["state"]) for each in found if each["code"] == "machine.fault"] == [
        ("high", "new")
    ]
    assert {each["state"] for each in found} == {"new", "returned", "acknowledged"}
    assert all(each["text"].isprintable() and len(each["text"]) > 20 for each in found)


def test_who_controls_is_named_as_far_as_known() -> None:
    other = replace(CUTTING, standing=ConsoleRole.OBSERVER, holder=0)
    assert said(other)["controlled_by"] is None
    signed = Signature(number=12, name="lee", host="cell-2", minute=0)
    held = said(replace(other, holder=12, held_by=signed))
    assert (held["controls"], held["controlled_by"]) == (False, {"number": 12, "name": "lee", "host": "cell-2"})


@given(st.floats(LEAST_HZ, MOST_HZ))
def test_the_rate_that_is_asked_for_is_given(hz: float) -> None:
    assert asked_hz(request_line(hz)) == pytest.approx(hz, abs=6e-4)


@given(st.binary(max_size=120))
def test_any_other_line_asks_for_no_rate(line: bytes) -> None:
    hz = asked_hz(line)
    assert hz is None or LEAST_HZ <= hz <= MOST_HZ
    if hz is not None and line.strip():
        assert line.startswith(b"rate ")


@pytest.mark.parametrize(
    "line", [b"rate 0", b"rate 11", b"rate -1", b"rate nan", b"rate 1e1", b"rate", b"stop", b"rate 5\nx"]
)
def test_a_rate_out_of_range_is_refused_not_clamped(line: bytes) -> None:
    assert asked_hz(line) is None
