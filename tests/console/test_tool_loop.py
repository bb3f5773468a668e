"""The loop of the tool as the controller has it, read by whoever looks at it."""

from __future__ import annotations

from pathlib import Path

import pytest

from console.session.station.commands import ReadLoop
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_machine
from tests.console.consoles import MACHINE, station_of


def test_the_gains_are_those_of_the_controller_whoever_has_written_them(tmp_path: Path) -> None:
    machine = load_machine(MACHINE).machine
    sim = SimulatedLathe(machine)
    owner = station_of(sim, tmp_path)
    owner.client.request("I130=600", lines=0)
    owner.client.request("I136=-1.5", lines=0)
    loop = owner.do(ReadLoop()).tool_loop
    assert loop is not None
    assert (loop.gains["I130"], loop.gains["I131"], loop.unmodelled) == (600.0, 4905.0, ("I136",))
    assert loop.servo_period_ms == pytest.approx(0.4427083730697632)
    assert loop.on(machine).controller.variables["I130"] == 600.0
    # It may be read by a console that only observes, and writes nothing.
    observer = station_of(sim, tmp_path / "other", locking=False)
    assert not observer.state.controls
    observer.line.heard = b""
    assert observer.do(ReadLoop()).tool_loop is not None
    assert b"=" not in observer.line.heard
