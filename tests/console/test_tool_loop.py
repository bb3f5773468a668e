"""The loop of the tool as the controller has it, read by whoever looks at it."""

from __future__ import annotations

from pathlib import Path

import pytest

from console.session.data.health import kept_tests
from console.session.station.commands import CheckHealth, EnableDrives, Home, ReadLoop
from console.session.station.state import Activity
from drivers.lathe.snapshot import Snapshot
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_machine
from tests.console.consoles import MACHINE, station_of


def test_the_gains_are_those_of_the_controller_whoever_has_written_them(tmp_path: Path) -> None:
    machine = load_machine(MACHINE).machine
    sim = SimulatedLathe(machine)
    owner = station_of(sim, tmp_path)
    owner.client.request("I130=600", lines=0)
    owner.client.request("I136=-1.5", lines=0)
    owner.client.request("I168=40", lines=0)
    loop = owner.do(ReadLoop()).tool_loop
    assert loop is not None
    assert (loop.gains["I130"], loop.gains["I131"], loop.unmodelled) == (600.0, 4905.0, ("I168",))
    assert loop.gains["I136"] == -1.5, "the model has the notch filter"
    assert loop.servo_period_ms == pytest.approx(0.4427083730697632)
    assert loop.on(machine).controller.variables["I130"] == 600.0
    # It may be read by a console that only observes, and writes nothing.
    observer = station_of(sim, tmp_path / "other", locking=False)
    assert not observer.state.controls
    observer.line.heard = b""
    assert observer.do(ReadLoop()).tool_loop is not None
    assert b"=" not in observer.line.heard


def test_the_tool_is_tested_and_identified_from_the_screen_as_by_the_commands(tmp_path: Path) -> None:
    owner = station_of(SimulatedLathe(load_machine(MACHINE).machine), tmp_path)
    owner.do(CheckHealth(step_um=25.0))
    assert (owner.refusals, owner.state.tested) == (["machine.not_enabled", "machine.not_homed"], "")
    owner.do(EnableDrives())
    owner.do(Home())
    owner.do(CheckHealth(step_um=60.0))
    assert owner.refusals == ["identify.amplitude"] and owner.state.activity is Activity.READY
    state = owner.do(CheckHealth(step_um=25.0))
    assert (owner.refusals, owner.alarms, state.activity) == ([], [], Activity.READY)
    (kept,) = kept_tests(tmp_path, MACHINE, 5)
    assert kept.result is not None and state.tested == kept.file.name == "health-000001.json"
    assert kept.result.sine.gain == pytest.approx(kept.result.model.gain, rel=0.002)
    assert state.snapshot is not None and state.snapshot.loops_closed and state.snapshot.at_rest


def test_a_stop_ends_a_test_and_leaves_the_machine_stopped_with_its_drives_off(tmp_path: Path) -> None:
    owner = station_of(SimulatedLathe(load_machine(MACHINE).machine), tmp_path)
    owner.do(EnableDrives())
    owner.do(Home())
    begun_s = owner.sim.now_s()
    seen: list[Activity] = []

    def stopping(snapshot: Snapshot) -> None:
        seen.append(owner.state.activity)
        if owner.sim.now_s() > begun_s + 1.6 and owner.stop.reason is None:
            owner.stop.stop("space")

    owner.looks.append(stopping)
    owner.do(CheckHealth(step_um=25.0))
    assert Activity.TESTING in seen
    owner.looks.remove(stopping)
    state = owner.look()
    assert state.stop is not None and state.stop.reason == "space" and state.stop.rest_s is not None
    assert state.activity is Activity.STOPPED and kept_tests(tmp_path, MACHINE, 5) == ()
    assert state.snapshot is not None and state.snapshot.loops_open
    assert owner.client.request("LIST PROG998") in ((), ("",), ("RET",))
