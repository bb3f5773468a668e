"""The card would not end a motion any more, or lets it go on without a host: the console keeps to the policy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from console.session.cut import run
from console.session.station.commands import EndCut, Jog
from console.session.station.state import Activity
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.pmac.heartbeat.plc import Policy
from tests.matrix import rig as rigs
from tests.matrix.checks import Kind, kind_of
from tests.matrix.faults import Row
from tests.matrix.rig import Rig, build_rig, compact_machine, planned_once
from tests.matrix.situations import Begun, Situation, enter

Build = Callable[[Policy], Rig]
DEAD = Row(name="", fault="stranger-writes", given={"line": "DISABLE PLC20"})


@pytest.fixture
def build(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Build:
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
    told(rig)
    assert begun.at_s is not None
    return begun.at_s


def told(rig: Rig) -> None:
    assert rig.state.activity is Activity.STOPPED
    assert [alarm.problem.code for alarm in rig.state.alarms] == ["heartbeat.plc_silent"]


def stop_s(rig: Rig, since_s: float) -> float:
    """When the first stop behind a moment was sent, of the time of the machine."""
    stops = (sent.at_s for sent in rig.wire.sent if kind_of(sent) in (Kind.ABORT, Kind.KILL))
    return next(at_s for at_s in stops if at_s > since_s)


def tool_is_out(rig: Rig) -> bool:
    plan = rig.context.plan
    assert plan is not None
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
    told(rig)
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
