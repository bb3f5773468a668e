"""A console whose machine was taken: it keeps no lease for the other's motions, and stops none of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from console.session.station.commands import EnableDrives, Home, Jog, Recover, TakeControl
from drivers.errors import RefusedError
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_machine
from tests.console.consoles import MACHINE, STOPS, console_of, station_of
from tests.console.test_owning import jogs

HANDLERS: dict[str, Callable[[Lathe], object]] = {
    "home": lambda lathe: lathe.home(),
    "jog": lambda lathe: lathe.jog_by(AxisName.CARRIAGE, -1000.0),
    "start": lambda lathe: lathe.program.start(2, 0.0),
}


@pytest.mark.parametrize("order", HANDLERS)
def test_a_refused_motion_leaves_no_lease_behind(tmp_path: Path, order: str) -> None:
    machine = load_machine(MACHINE).machine
    sim = SimulatedLathe(machine)
    first, second = (console_of(sim, machine, tmp_path / name) for name in ("here", "there"))
    jogs(first, [])
    second.owning.take_control()
    first.lathe.snapshot()
    first.hear()
    with pytest.raises(RefusedError):
        HANDLERS[order](first.lathe)
    for _ in range(4):
        sim.wait(0.1)
        first.lathe.snapshot()
    assert b"M70=" not in first.hear()


def test_a_console_that_slept_through_a_take_over_leaves_the_new_owner_alone(tmp_path: Path) -> None:
    sim = SimulatedLathe(load_machine(MACHINE).machine)
    asleep, other = station_of(sim, tmp_path / "here"), station_of(sim, tmp_path / "there")
    asleep.do(EnableDrives())
    asleep.do(Home())
    slept: list[Snapshot] = []

    def sleep(snapshot: Snapshot) -> None:
        if snapshot.moving and not slept:
            slept.append(snapshot)
            sim.wait(2.0)  # its motion is ended by the card meanwhile
            other.do(TakeControl())
            other.do(Recover())
            other.client.request("M70=9000 P1003=1 #3J=60000")
            asleep.hear()

    asleep.looks.append(sleep)
    asleep.do(Jog(axis=AxisName.CARRIAGE, distance=40.0))
    said = asleep.hear()
    assert slept and not [stop for stop in STOPS if stop in said], said
    assert b"P1003=0" not in said and b"M70=" not in said
    assert "heartbeat.lapsed" in [alarm.problem.code for alarm in asleep.state.alarms]
    assert other.lathe.snapshot().moving


def test_a_home_search_that_somebody_else_stops_is_told_at_once(tmp_path: Path) -> None:
    sim = SimulatedLathe(load_machine(MACHINE).machine)
    ready, other = station_of(sim, tmp_path / "here"), station_of(sim, tmp_path / "there")
    ready.do(EnableDrives())
    began_s: list[float] = []

    def stop(snapshot: Snapshot) -> None:
        if snapshot.moving and not began_s:
            began_s.append(sim.now_s())
            other.look()
            other.stop.stop("space")

    ready.looks.append(stop)
    ready.do(Home())
    assert sim.now_s() - began_s[0] < 10.0
    assert "machine.home_ended" in [alarm.problem.code for alarm in ready.state.alarms]
