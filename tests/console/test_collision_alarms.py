"""What the simulated tool runs into is told to the operator: each collision once, until a new blank is there."""

from __future__ import annotations

import json
import re
import sqlite3
from pathlib import Path

import pytest

from console.session.station.alarms import Priority, collision_problems
from console.session.station.commands import Acknowledge, ConfirmClamping, DisableDrives, Home, Start
from console.session.station.state import Activity, StationState
from console.text.catalogue import load
from drivers.lathe.snapshot import AxisName
from drivers.pmac.client import PmacClient
from drivers.simulator.plant.workshop_view import CollisionKind
from profiles.store import load_machine
from tests.console.floor import Floor, experiment_1, open_floor
from tests.drivers.test_collisions import printed_program


@pytest.fixture
def floor(tmp_path: Path) -> Floor:
    """The printed program goes 8 mm along the part and needs the room of the whole lathe."""
    return open_floor(tmp_path, machine=load_machine("lee-2001-lathe"))


@pytest.fixture
def aligned(floor: Floor) -> Floor:
    floor.set_up(experiment_1(8.0))
    return floor


def told(state: StationState) -> dict[str, tuple[int, bool]]:
    """The alarms of collisions: how often each was raised, and whether it was seen."""
    return {
        alarm.problem.code: (alarm.count, alarm.acknowledged)
        for alarm in state.alarms
        if alarm.problem.code.startswith("simulator.met_")
    }


def plunge(floor: Floor) -> StationState:
    """The printed program of the paper, to its literal last line: 2 mm further in. Another host runs it."""
    client = PmacClient(floor.link, floor.sim)
    floor.lathe.jog_to(AxisName.CARRIAGE, 174_000.0)
    client.download(printed_program())
    client.request("&1B1R")
    floor.idle(2.0)
    assert told(floor.state) == {}
    client.request("M26=1")
    for _ in range(40):
        state = floor.idle(0.1)
    assert state.snapshot is not None and state.snapshot.at_rest
    return state


@pytest.fixture
def too_late(monkeypatch: pytest.MonkeyPatch) -> None:
    """A console that does not stop what another host moves, which it would do within 0.1 s."""
    monkeypatch.setattr("console.session.station.station.unasked_motion", lambda snapshot: None)


@pytest.mark.long
@pytest.mark.usefixtures("too_late")
def test_the_last_line_of_the_printed_program_is_an_alarm_once_for_each_collision(aligned: Floor) -> None:
    state = plunge(aligned)
    # The spindle is being stopped when the tool goes in: more than 1 mm a turn first, and then none.
    met = ("simulator.met_infeed", "simulator.met_standing_part", "simulator.met_too_deep")
    assert told(state) == dict.fromkeys(met, (1, False))
    assert {alarm.priority for alarm in state.alarms} == {Priority.HIGH}
    for _ in ("controller.zero_shifted", met[0]):
        assert aligned.station.post(Acknowledge())
    assert sorted(acknowledged for _, acknowledged in told(aligned.state).values()) == [False, False, True]
    for _ in met[1:]:
        assert aligned.station.post(Acknowledge())
    # It has happened, whoever has seen it: it stays, and is not raised anew.
    assert told(aligned.idle(3.0)) == dict.fromkeys(met, (1, True))


@pytest.mark.long
@pytest.mark.usefixtures("too_late")
def test_a_new_blank_has_met_nothing_and_can_meet_again(aligned: Floor) -> None:
    plunge(aligned)
    for _ in aligned.state.alarms:
        assert aligned.station.post(Acknowledge())
    aligned.do(Home())
    aligned.do(DisableDrives())
    assert told(aligned.do(ConfirmClamping(job=experiment_1(8.0)))) == {}
    aligned.set_up(experiment_1(8.0))
    again = set(told(plunge(aligned)))
    assert again == {"simulator.met_infeed", "simulator.met_standing_part", "simulator.met_too_deep"}


def test_a_collision_in_a_cut_is_told_before_its_end_and_kept_in_the_record(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A tool that takes nothing, put to an ordinary cut."""
    floor, job = open_floor(tmp_path), experiment_1(6.0)
    monkeypatch.setattr("drivers.simulator.plant.collision.TOOL_TAKES_MM", -0.05)
    floor.set_up(job)
    late_s: list[float] = []

    def look(_: object) -> None:
        if floor.state.activity is Activity.CUTTING and floor.sim.collisions and not told(floor.state):
            late_s.append(floor.sim.now_s() - floor.sim.collisions[0].time_ms / 1000.0)

    floor.looks.append(look)
    floor.arm(job)
    state = floor.do(Start())
    assert max(late_s) < 1.1
    assert floor.sim.now_s() - floor.sim.collisions[0].time_ms / 1000.0 > 5.0
    assert told(state) == {"simulator.met_too_deep": (1, False)}
    with sqlite3.connect(tmp_path / "records.sqlite3") as database:
        events = database.execute("SELECT data FROM events WHERE kind = 'collision'").fetchall()
    assert [json.loads(data)["met"] for (data,) in events] == ["too_deep"]


@pytest.mark.parametrize("language", ["en", "ko"])
def test_every_kind_has_a_sentence_of_its_own_for_the_alarm_row(language: str) -> None:
    text = load(language)
    sentences = [text.problem(problem) for problem in collision_problems(CollisionKind)]
    assert len(set(sentences)) == len(CollisionKind)
    assert all(re.search("simulated|시뮬레이션", sentence) for sentence in sentences)
