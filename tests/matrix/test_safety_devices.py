"""A safety device drops, the PLC dies, another host was there: the next order that moves is refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from pytest import MonkeyPatch

from console.session.cut import run
from console.session.station.commands import Command, DisableDrives, EnableDrives, EndCut, Home, Jog, Start
from console.session.station.state import Activity
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.pmac.heartbeat.plc import Policy
from tests.console.floor import known
from tests.matrix import rig as rigs
from tests.matrix.cell import JITTER, Kind, kind_of, way
from tests.matrix.faults import Row
from tests.matrix.rig import MOTORS, Begun, Rig, Situation, build_rig, compact_machine, enter, planned_once

OPEN = "WY:$7F0,0"
CLOSED = "WY:$7F0,8"
JOG = Jog(axis=AxisName.CARRIAGE, distance=1.0)
TOLD = ("safety.not_good", "safety.guard")


def write(rig: Rig, line: str) -> None:
    """Let the hardware do what it does, by hand."""
    Row(name="", fault="stranger-writes", given={"line": line}).inject(rig.sim)


@pytest.fixture
def rig(tmp_path: Path, monkeypatch: MonkeyPatch) -> Rig:
    """A machine whose controller sees its guard, closed at the beginning."""
    loaded = compact_machine()
    guarded = replace(loaded.machine, safety=replace(loaded.machine.safety, inputs=("guard->Y:$7F0,3=1",)))
    monkeypatch.setattr(rigs, "compact_machine", lambda: replace(loaded, machine=guarded))
    monkeypatch.setattr(run, "plan_cut", planned_once)
    made = build_rig(tmp_path)
    write(made, CLOSED)
    return made


def drops(rig: Rig, situation: Situation) -> None:
    enter(situation, Begun(rig=rig, fault=lambda: write(rig, OPEN)))
    for _ in range(4):
        rig.step()


def told(rig: Rig) -> list[tuple[str, str]]:
    return [(alarm.problem.code, alarm.problem.key) for alarm in rig.state.alarms if alarm.active]


def ordered(rig: Rig, order: Command) -> tuple[list[Kind], list[tuple[str, str]]]:
    """Give an order; return what was sent for it, looks apart, and why it was refused."""
    sent = len(rig.wire.sent)
    assert rig.station.post(order), rig.state.refusals
    rig.station.step()
    kinds = [kind for kind in map(kind_of, rig.wire.sent[sent:]) if kind is not None]
    return kinds, [(problem.code, problem.key) for problem in rig.state.refusals]


@pytest.mark.parametrize("situation", [Situation.JOGGING, Situation.HOMING, Situation.CUTTING])
def test_what_moves_is_ended_and_the_device_is_told(rig: Rig, situation: Situation) -> None:
    drops(rig, situation)
    assert rig.state.activity is Activity.STOPPED
    assert told(rig) == [TOLD]


def test_with_the_drives_on_it_is_told_and_nothing_moves_until_it_is_well_again(rig: Rig) -> None:
    drops(rig, Situation.IDLE)
    assert (rig.state.activity, told(rig), rig.state.stop) == (Activity.READY, [TOLD], None)
    for order in (JOG, Home(), EnableDrives()):
        assert ordered(rig, order) == ([], [TOLD])
    write(rig, CLOSED)
    rig.step()
    assert told(rig) == []
    assert ordered(rig, JOG)[1] == []


def test_what_was_armed_is_not_started(rig: Rig) -> None:
    drops(rig, Situation.ARMED)
    assert (rig.state.armed, told(rig)) == (None, [TOLD])


def test_between_two_looks_it_is_found_by_the_start(rig: Rig) -> None:
    enter(Situation.ARMED, Begun(rig=rig, fault=lambda: write(rig, OPEN)))
    assert ordered(rig, Start()) == ([], [TOLD])


def test_one_that_takes_the_drives_with_it_is_told(rig: Rig) -> None:
    def trip() -> None:
        write(rig, OPEN)
        for motor in rig.sim.controller.motors.values():
            motor.kill()

    enter(Situation.IDLE, Begun(rig=rig, fault=trip))
    rig.step()
    assert TOLD in told(rig)


def test_with_the_drives_off_a_guard_may_be_open_but_they_stay_off(rig: Rig) -> None:
    drops(rig, Situation.OFF)
    assert (rig.state.activity, told(rig)) == (Activity.READY, [])
    assert ordered(rig, EnableDrives()) == ([], [TOLD])
    assert ordered(rig, DisableDrives())[1] == []


Build = Callable[[Policy], Rig]
DEAD = Row(name="", fault="stranger-writes", given={"line": "DISABLE PLC20"})


@pytest.fixture
def build(tmp_path: Path, monkeypatch: MonkeyPatch) -> Build:
    def of(policy: Policy) -> Rig:
        loaded = compact_machine()
        machine = replace(loaded.machine, heartbeat=replace(loaded.machine.heartbeat, policy=policy.value))
        monkeypatch.setattr(rigs, "compact_machine", lambda: replace(loaded, machine=machine))
        return build_rig(tmp_path)

    monkeypatch.setattr(run, "plan_cut", planned_once)
    return of


def dies(rig: Rig, situation: Situation) -> float:
    """Have the PLC ended; return when that was."""
    begun = Begun(rig=rig, fault=lambda: DEAD.inject(rig.sim))
    enter(situation, begun)
    told_silent(rig)
    assert begun.at_s is not None
    return begun.at_s


def told_silent(rig: Rig) -> None:
    assert rig.state.activity is Activity.STOPPED
    assert [alarm.problem.code for alarm in rig.state.alarms] == ["heartbeat.plc_silent"]


def stop_s(rig: Rig, since_s: float) -> float:
    """When the first stop behind a moment was sent, of the time of the machine."""
    stops = (sent.at_s for sent in rig.wire.sent if kind_of(sent) in (Kind.ABORT, Kind.KILL))
    return next(at_s for at_s in stops if at_s > since_s)


def tool_is_out(rig: Rig) -> bool:
    plan = known(rig.context.plan)
    return rig.sim.controller.motors[1].position == pytest.approx(plan.setup.retracted, abs=5.0)


def test_a_jog_is_stopped_and_told_within_half_a_second(build: Build) -> None:
    rig = build(Policy.RETRACT)
    enter(Situation.IDLE, Begun(rig=rig, fault=lambda: None))
    died_s: list[float] = []

    def die(look: Snapshot) -> None:
        if look.moving and not died_s:
            died_s.append(rig.sim.now_s())
            DEAD.inject(rig.sim)

    rig.looks.append(die)
    assert rig.station.post(Jog(axis=AxisName.CARRIAGE, distance=8.0))  # for 0.8 s
    rig.station.step()
    told_silent(rig)
    assert stop_s(rig, died_s[0]) - died_s[0] < 0.5


def test_a_cut_ends_with_its_own_retract_before_anything_is_stopped(build: Build) -> None:
    rig = build(Policy.RETRACT)
    died_s = dies(rig, Situation.CUTTING)
    held_s = next(sent.at_s for sent in rig.wire.sent if sent.line == "M26=1" and sent.at_s > died_s)
    assert held_s - died_s < 0.5
    assert not rig.sim.since(stop_s(rig, died_s))[0].running, "the program had ended by itself"
    assert tool_is_out(rig)


def test_a_cut_that_is_to_stop_is_stopped_at_once(build: Build) -> None:
    rig = build(Policy.STOP)
    died_s = dies(rig, Situation.CUTTING)
    assert stop_s(rig, died_s) - died_s < 0.5
    assert rig.state.stop is not None and rig.state.stop.of_cut


def test_a_cut_that_is_to_go_on_goes_on_and_it_is_told_at_once(build: Build) -> None:
    rig = build(Policy.FINISH)
    alarmed: list[bool] = []
    rig.looks.append(lambda look: alarmed.append(bool(rig.state.alarms)) if look.program_running else None)
    died_s = dies(rig, Situation.CUTTING)
    assert alarmed.count(True) > 20, "told while it went on"
    assert not any(sent.line == "M26=1" for sent in rig.wire.sent if sent.at_s > died_s)
    assert not rig.sim.since(stop_s(rig, died_s))[0].running
    assert tool_is_out(rig)


def test_a_hold_is_passed_on_also_when_the_lease_of_a_cut_that_goes_on_has_run_out(build: Build) -> None:
    rig = build(Policy.FINISH)
    asked_s: list[float] = []

    def ask(_: Snapshot) -> None:
        if begun.at_s is not None and not asked_s and rig.sim.now_s() > begun.at_s + 0.5:
            asked_s.append(rig.sim.now_s())
            assert rig.station.post(EndCut())

    begun = Begun(rig=rig, fault=lambda: rig.sim.wait(0.45))  # this host sleeps longer than a lease
    rig.looks.append(ask)
    enter(Situation.CUTTING, begun)
    assert "heartbeat.lapsed" in [alarm.problem.code for alarm in rig.state.alarms]
    passed_on_s = [sent.at_s for sent in rig.wire.sent if sent.line == "M26=1" and sent.at_s >= asked_s[0]]
    assert len(passed_on_s) == 1 and passed_on_s[0] - asked_s[0] < 0.1
    ended_s = stop_s(rig, asked_s[0])
    assert not rig.sim.since(ended_s)[0].running, "the program had ended by itself"
    assert tool_is_out(rig)


def refusals(situation: Situation, order: Command, line: str, records: Path) -> tuple[str, ...]:
    """Give an order after a stranger's line; return why it is refused. Nothing may have moved."""
    rig = build_rig(records)
    row = Row(name="", fault="stranger-writes", given={"line": line})
    enter(situation, Begun(rig=rig, fault=lambda: row.inject(rig.sim)))
    rig.step()
    begun_s = rig.sim.now_s()
    if rig.station.post(order):
        rig.station.step()
    moments = rig.sim.since(begun_s)
    moved = [axis for place, axis in enumerate(MOTORS) if way(moments, place) > JITTER[axis]]
    assert moved == []
    return tuple(problem.code for problem in rig.state.refusals)


@pytest.mark.parametrize(
    ("situation", "order", "line", "code"),
    [
        (Situation.ARMED, Start(), "P1000=7", "owner.observer"),
        (Situation.IDLE, JOG, "P1000=7", "owner.observer"),
        (Situation.ARMED, Start(), "I130=264", "controller.setting"),
        (Situation.ARMED, Start(), "I113=400000", "controller.setting"),
        (Situation.ARMED, Start(), "OPEN PROG 2 CLEAR X0 CLOSE", "controller.program_differs"),
        (Situation.ARMED, Start(), "P23=5", "controller.constant_differs"),
        (Situation.ARMED, Start(), "P11=P11+500", "controller.constant_differs"),
        (Situation.ARMED, Start(), "P12=P12*4 P15=P15*4", "controller.constant_differs"),
        (Situation.ARMED, Start(), "#1K", "session.not_armed"),
        (Situation.ARMED, Start(), "^K", "session.not_armed"),
        (Situation.ARMED, Start(), "$$$", "session.not_armed"),
        (Situation.IDLE, JOG, "#3K", "alignment.drives_off"),
        (Situation.IDLE, JOG, "^K", "alignment.drives_off"),
        (Situation.ARMED, Start(), "DISABLE PLC20", "heartbeat.plc_silent"),
        (Situation.IDLE, JOG, "DISABLE PLC20", "heartbeat.plc_silent"),
        (Situation.IDLE, JOG, "I5=0", "heartbeat.plcs_forbidden"),
    ],
)
def test_the_next_is_refused(situation: Situation, order: Command, line: str, code: str, tmp_path: Path) -> None:
    assert code in refusals(situation, order, line, tmp_path)
