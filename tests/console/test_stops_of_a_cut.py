"""Stops at rest, in a cut and on a table: once in the record, the way back, and what is known of the blank."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from datetime import date
from pathlib import Path

import pytest
from pytest import MonkeyPatch

from console.cli.machine.card_access import ConnectedController
from console.cli.machine.doctor_checks import keep_stops, stop_checks
from console.session.data.records import killed_runs
from console.session.data.stop_records import load
from console.session.stages import Stage
from console.session.station.commands import (
    ConfirmClamping,
    DisableDrives,
    Disarm,
    EndCut,
    Jog,
    Recover,
    Retract,
    Start,
)
from console.session.station.progress import CutStage
from console.session.station.state import Activity, StationState
from drivers.commissioning.proofs.stopping import MeasuredStops
from drivers.commissioning.stop_record import PriorMotion, StopEntry, StopMethod, needed_stops
from drivers.cutting.planning import Strategy
from drivers.errors import LinkError
from drivers.lathe.snapshot import AxisName
from drivers.link.base import StopWay
from profiles.findings import Severity
from profiles.problem import Problem
from profiles.store import load_machine
from tests.console.floor import LOGGED, Floor, experiment_1, in_turn, set_up_once
from tests.drivers.commissioned import commissioned


@pytest.mark.parametrize("key", ["space", "escape", "f12"])
@pytest.mark.first(1)
def test_a_stop_key_at_rest_needs_no_reset_and_ends_what_was_armed(aligned: Floor, key: str) -> None:
    """Rule S5: a stop that was pressed by accident costs as little as can be."""
    aligned.arm(experiment_1())
    aligned.idle(2.0)
    before, sent = aligned.state, aligned.stop.count
    aligned.stop.stop(key)
    after = aligned.idle()
    assert aligned.stop.count > sent
    assert after.activity is Activity.READY and after.stop is None and after.armed is None
    assert [problem.code for problem in after.refusals] == ["session.stopped_at_rest"]
    assert before.snapshot is not None and after.snapshot is not None
    assert after.snapshot.loops_closed == before.snapshot.loops_closed
    aligned.arm(experiment_1())
    assert aligned.state.armed is not None
    aligned.stop.kill("f9")
    killed = aligned.idle()
    assert killed.activity is Activity.STOPPED and killed.stop is not None, "the drives are disabled by it"


def test_directly_after_a_motion_it_is_a_stop_of_that_motion(aligned: Floor) -> None:
    """Somebody who stops between two steps of a jog means the jog: F2 is asked for."""
    aligned.do(Jog(axis=AxisName.CARRIAGE, distance=-0.1))
    aligned.stop.stop("space")
    assert aligned.idle().activity is Activity.STOPPED
    assert aligned.do(Recover()).activity is Activity.READY


def test_a_stop_in_a_cut_tells_when_all_stood_still_and_when_that_was_proven(aligned: Floor) -> None:
    """The proof takes longer than the stop: by the polls the spindle turned until `still_s`, and no longer."""
    aligned.arm(experiment_1())
    spindle: dict[float, float] = {}
    aligned.looks.append(lambda seen: spindle.update({seen.at_s: seen.spindle.position}))
    aligned.when(lambda _: in_turn(aligned, 5.0), lambda: aligned.stop.stop("space"))
    stop = aligned.do(Start()).stop
    assert stop is not None and stop.still_s is not None and stop.rest_s is not None
    assert stop.sent_s < stop.still_s < stop.rest_s - 0.3
    after, before = ([at for s, at in spindle.items() if (s >= stop.still_s) is later] for later in (True, False))
    assert max(after) - min(after) <= 2.0 and abs(before[-1] - after[0]) > 2.0


@pytest.mark.parametrize(
    ("key", "drives_on", "seconds"),
    [
        ("space", True, 12.0),
        *(pytest.param(key, on, 60.0, marks=pytest.mark.long) for key in ("space", "f12") for on in (True, False)),
    ],
)
def test_a_stop_key_held_at_rest_is_one_stop(aligned: Floor, key: str, drives_on: bool, seconds: float) -> None:
    """A terminal repeats a held key some 30 times a second, after a quarter to two thirds of a second."""
    if not drives_on:
        aligned.do(DisableDrives())
    aligned.idle(2.0)
    before, wait = aligned.state, aligned.sim.wait
    assert before.snapshot is not None
    repeats = (0.66 + n / 30.0 for n in range(round((seconds - 0.7) * 30)))
    presses = [before.at_s + first for first in (0.0, *repeats)]
    pending = list(presses)

    def held(seconds: float) -> None:
        end_s = aligned.sim.now_s() + seconds
        while pending and pending[0] <= end_s:
            wait(max(pending.pop(0) - aligned.sim.now_s(), 0.0))
            aligned.stop.stop(key)
        wait(max(end_s - aligned.sim.now_s(), 0.0))

    aligned.sim.wait = held  # type: ignore[method-assign]
    sent = aligned.stop.count
    while pending:
        aligned.sim.wait(0.1)
        aligned.station.step()
    after = aligned.idle(1.0)
    assert aligned.stop.count - sent == len(presses)
    assert "machine.not_at_rest" not in [alarm.problem.code for alarm in after.alarms]
    assert after.activity is Activity.READY and after.stop is None
    assert after.stops - before.stops <= 2, "the key was pressed once"
    assert after.snapshot is not None and after.snapshot.loops_closed == before.snapshot.loops_closed


@pytest.fixture
def floor(tmp_path: Path, in_copies: None) -> Floor:
    return set_up_once(tmp_path)


def stopped_in_the_part(floor: Floor) -> None:
    """Arm it, start it, and stop it in the part."""
    floor.arm(experiment_1())
    floor.when(lambda _: in_the_part(floor), lambda: floor.stop.stop("space"))
    floor.do(Start())


def in_the_part(floor: Floor) -> bool:
    cut = floor.state.cut
    return cut is not None and cut.stage is CutStage.CUT and cut.turn > 5.0


def events(floor: Floor) -> list[tuple[str, bool | None]]:
    """What is in the record behind the start, each with whether rest was proven."""
    with closing(sqlite3.connect(floor.context.records / "records.sqlite3")) as database:
        events = database.execute("SELECT kind, data FROM events ORDER BY number").fetchall()
    found = [(kind, data) for kind, data in events if kind not in LOGGED]
    assert [kind for kind, _ in found[:2]] == ["armed", "started"]
    return [(kind, json.loads(data).get("proven")) for kind, data in found[2:]]


def test_a_stop_that_is_asked_for_again_and_again_is_one_stop_until_going_on(floor: Floor) -> None:
    stopped_in_the_part(floor)
    for _ in range(2):
        floor.stop.stop("space")
        floor.idle()
    assert events(floor) == [("stopped", True)]
    floor.stop.kill("escape")
    floor.idle()
    floor.idle()
    assert events(floor) == [("stopped", True), ("killed", True)]
    floor.do(Recover())
    floor.stop.stop("space")
    floor.idle()
    assert events(floor)[2:] == [("stopped", True)], "after going on it is another"
    floor.station.close("quit")
    assert len(events(floor)) == 3


def test_rest_that_is_proven_late_is_no_other_stop(floor: Floor, monkeypatch: MonkeyPatch) -> None:
    def silent() -> None:
        raise LinkError(Problem(code="link.silent"))

    with monkeypatch.context() as broken:
        broken.setattr(floor.lathe, "wait_for_rest", silent)
        stopped_in_the_part(floor)
        floor.idle()
    floor.idle()
    assert events(floor) == [("stopped", False), ("at_rest", None)]


TODAY = date(2026, 3, 1)
MACHINE = load_machine("lee-2001-lathe").machine


def alarms(floor: Floor) -> list[str]:
    return [alarm.problem.code for alarm in floor.state.alarms if alarm.active]


def test_an_armed_cut_is_disarmed_and_the_operator_is_told_once(floor: Floor) -> None:
    job = experiment_1()
    floor.link.stop_way = StopWay.RESERVED
    assert floor.arm(job).armed is not None
    assert alarms(floor) == []
    floor.link.stop_way = StopWay.LOST
    floor.idle()
    assert (floor.idle().armed, alarms(floor)) == (None, ["stops.connection_lost"])
    assert [alarm.count for alarm in floor.state.alarms] == [1]
    floor.link.stop_way = StopWay.RESERVED
    floor.idle()
    assert alarms(floor) == []


def test_a_cut_that_was_armed_before_is_not_begun(floor: Floor) -> None:
    job = experiment_1()
    floor.arm(job)
    before = floor.state.snapshot
    floor.link.stop_way = StopWay.LOST
    floor.do(Start())
    assert [problem.code for problem in floor.state.refusals] == ["stops.connection_lost"]
    assert before is not None and floor.state.snapshot is not None
    assert [axis.commanded_position for axis in floor.state.snapshot.axes] == [
        axis.commanded_position for axis in before.axes
    ]


@pytest.mark.parametrize("way", StopWay)
def test_a_record_is_kept_with_the_way_of_its_stops(tmp_path: Path, way: StopWay) -> None:
    made = commissioned(MACHINE)
    version, kind = made.client.query("VERSION", "TYPE")
    card = ConnectedController(
        client=made.client,
        stop=made.stop,
        clock=made.sim,
        machine=MACHINE,
        address="ethernet:lathe",
        simulated=False,
        version=version,
        kind=kind,
        data=tmp_path,
    )
    stops = tuple(_stop(*each) for each in needed_stops(MACHINE))
    proven = MeasuredStops(entries=stops)
    keep_stops(card, proven, TODAY)
    made.link.stop_way = way
    keep_stops(card, proven, TODAY)
    kept = load(tmp_path, MACHINE)
    assert (None if kept is None else kept.stop_way) == (None if way is StopWay.LOST else way)
    told = {check.code: check.severity for check in stop_checks(card, TODAY)}
    target = {
        StopWay.DIRECT: {"stop_record": Severity.OK},
        StopWay.RESERVED: {"stop_connection": Severity.OK, "stop_record": Severity.OK},
        StopWay.LOST: {"stop_connection": Severity.REFUSAL, "stops_no_record": Severity.WARNING},
    }
    assert told == target[way]


def _stop(way: StopMethod, origin: PriorMotion, axis: str) -> StopEntry:
    if axis == "spindle":
        return StopEntry(way=way, origin=origin, axis=axis, time_s=0.1, distance_deg=30.0, speed_rpm=100.0)
    return StopEntry(way=way, origin=origin, axis=axis, time_s=0.1, distance_mm=0.2, speed_mm_per_s=10.0)


JOB = experiment_1()


def as_its_profile_says(floor: Floor) -> bool:
    return floor.lathe.verify() == ()


def test_arming_it_twice_and_taking_it_back_leaves_the_card_as_it_was(floor: Floor) -> None:
    for _ in range(2):
        assert floor.arm(JOB, Strategy.TIMEBASE).armed is not None, floor.state.refusals
    floor.do(Disarm())
    assert as_its_profile_says(floor)
    assert floor.arm(JOB, Strategy.PVT).armed is not None, floor.state.refusals


def test_after_a_stop_in_the_cut_f8_puts_it_back(floor: Floor) -> None:
    assert floor.arm(JOB, Strategy.TIMEBASE).armed is not None
    floor.when(
        lambda _: floor.state.cut is not None and floor.state.cut.stage is CutStage.CUT,
        lambda: floor.stop.stop("space"),
    )
    floor.do(Start())
    floor.idle()
    state = floor.do(Recover(), Retract())
    assert state.stop is None and state.refusals == (), state.alarms
    assert as_its_profile_says(floor)
    assert floor.arm(JOB, Strategy.PVT).armed is not None, floor.state.refusals


def in_turn_20(floor: Floor) -> bool:
    cut = floor.state.cut
    return cut is not None and cut.stage is CutStage.CUT and cut.turn > 20.0


def cut_to_mm(state: StationState) -> float:
    assert state.touched is not None
    assert state.touched.of_mm == JOB.cut_length_mm
    return state.touched.to_mm


def hold(floor: Floor) -> None:
    assert floor.station.post(EndCut())


def left_in_the_part(floor: Floor) -> StationState:
    """Stopped behind turn 20, after F2 and with the tool out."""
    floor.arm(JOB)
    floor.when(lambda _: in_turn_20(floor), lambda: floor.stop.stop("space"))
    return floor.do(Start(), Recover(), Retract())


@pytest.mark.long
def test_how_far_the_blank_is_cut_is_known_until_another_one_is_clamped(aligned: Floor) -> None:
    assert aligned.state.touched is None
    left = left_in_the_part(aligned)
    (mark_mm,) = left.marks_mm
    # 20 turns of 0.05 mm, and the turn in which it was stopped.
    assert 1.0 < cut_to_mm(left) < 1.1
    assert cut_to_mm(left) == pytest.approx(mark_mm, abs=0.05)
    aligned.arm(JOB)
    aligned.when(lambda _: aligned.state.cut is not None, lambda: aligned.stop.stop("space"))
    again = aligned.do(Start())
    assert again.cut is not None and again.cut.stage is CutStage.POSITION
    assert (again.touched, again.marks_mm) == (left.touched, left.marks_mm)
    fresh = aligned.do(Recover(), DisableDrives(), ConfirmClamping(job=JOB))
    assert (fresh.touched, fresh.marks_mm) == (None, ())


@pytest.mark.long
def test_a_hold_leaves_a_blank_cut_in_part_and_a_cut_in_air_one_as_it_was(aligned: Floor) -> None:
    aligned.arm(JOB, stage=Stage.AIR)
    assert aligned.do(Start()).touched is None
    aligned.arm(JOB)
    aligned.when(lambda _: in_turn_20(aligned), lambda: hold(aligned))
    held = aligned.do(Start())
    assert held.cut is not None and held.cut.stage is CutStage.HELD
    assert 1.0 < cut_to_mm(held) < 1.2


@pytest.mark.parametrize(
    ("axis", "distance"), [(AxisName.CARRIAGE, 0.01), (AxisName.TOOL, -0.01), (AxisName.SPINDLE, 0.1)]
)
def test_a_jog_step_is_over_before_a_person_presses_again(aligned: Floor, axis: AxisName, distance: float) -> None:
    """Presses 0.45 s apart are all taken: 0.1 s is left for the keyboard and the line."""
    began_s = aligned.sim.now_s()
    aligned.do(Jog(axis=axis, distance=distance))
    assert aligned.sim.now_s() - began_s < 0.35


@pytest.mark.parametrize("retracted", [False, True])
@pytest.mark.first(1)
def test_a_tool_left_in_the_part_is_told(aligned: Floor, monkeypatch: MonkeyPatch, retracted: bool) -> None:
    monkeypatch.setattr(aligned.context, "shop", None)  # as on a real machine: nobody else sees the chuck
    machine = aligned.context.machine.name
    if retracted:
        left_in_the_part(aligned)
    else:
        aligned.arm(JOB)
        aligned.when(lambda _: in_turn_20(aligned), lambda: aligned.stop.stop("SIGHUP"))
        aligned.do(Start())
    assert killed_runs(aligned.context.records, machine, simulated=False) == ()
    aligned.station.close("SIGHUP")
    told = killed_runs(aligned.context.records, machine, simulated=False)
    assert [problem.code for problem in told] == ([] if retracted else ["record.left_in_part"])
    assert killed_runs(aligned.context.records, machine, simulated=False) == (), "told once"
