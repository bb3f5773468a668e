"""A safety device drops: the hardware ends what moves, the console says which, and orders no motion any more."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from console.session.cut import run
from console.session.station.commands import Command, DisableDrives, EnableDrives, Home, Jog, Start
from console.session.station.state import Activity
from drivers.lathe.snapshot import AxisName
from tests.matrix import rig as rigs
from tests.matrix.checks import Kind, kind_of
from tests.matrix.faults import Row
from tests.matrix.rig import Rig, build_rig, compact_machine, planned_once
from tests.matrix.situations import Begun, Situation, enter

OPEN = "WY:$7F0,0"
CLOSED = "WY:$7F0,8"
JOG = Jog(axis=AxisName.CARRIAGE, distance=1.0)
TOLD = ("safety.not_good", "safety.guard")


def write(rig: Rig, line: str) -> None:
    """Let the hardware do what it does, by hand."""
    Row(name="", fault="stranger-writes", given={"line": line}).inject(rig.sim)


@pytest.fixture
def rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Rig:
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
