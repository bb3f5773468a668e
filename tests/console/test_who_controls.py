"""An observer is shown who controls the machine; the console in control reads and shows nothing of the kind."""

from __future__ import annotations

import os
import socket
from datetime import UTC, datetime, timedelta
from pathlib import Path

from console.session.station.commands import TakeControl
from console.session.station.link.onlookers import Onlookers
from console.session.station.state import StationState
from console.text.catalogue import load
from console.tui.frame import observing, onlookers
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_machine
from tests.console.consoles import MACHINE, WithStation, station_of


def looks(console: WithStation, times: int = 8) -> None:
    for _ in range(times):
        console.sim.wait(0.3)
        console.look()


def test_an_observer_is_shown_name_computer_and_since_when(tmp_path: Path) -> None:
    """Rule R2: one console controls, with name, computer and time; the others see that."""
    sim = SimulatedLathe(load_machine(MACHINE).machine)
    kim = station_of(sim, tmp_path / "here", name="kim")
    lee = station_of(sim, tmp_path / "there", name="lee")
    looks(lee)
    by = lee.state.held_by
    assert by is not None and (by.number, by.name) == (kim.number, "kim")
    assert by.host == socket.gethostname().partition(".")[0][:15]
    now = datetime.now(UTC)
    assert abs(60 * by.minute - now.timestamp()) < 120.0
    shown = observing(load("en"), lee.state, now)
    assert "kim@" in shown and f"since {datetime.fromtimestamp(60 * by.minute, UTC):%H:%M}" in shown
    tomorrow = observing(load("en"), lee.state, now + timedelta(days=1))
    assert f"{now:%Y-%m-}" in tomorrow
    kim.hear()
    looks(kim)
    assert kim.look().held_by is None and b"P1012" not in kim.hear()
    lee.do(TakeControl())
    looks(kim)
    looks(lee)
    after = kim.state.held_by
    assert after is not None and after.name == "lee"
    (alarm,) = kim.state.alarms  # as on the first row, and raised once
    assert (alarm.problem.code, alarm.count) == ("owner.ousted", 1)
    assert f"({after.name}@{after.host})" in load("en").problem(alarm.problem)
    assert f"{after.name}@{after.host}" in observing(load("en"), kim.state, now)
    assert lee.look().held_by is None


def test_a_console_that_does_not_sign_is_shown_by_its_number(tmp_path: Path) -> None:
    sim = SimulatedLathe(load_machine(MACHINE).machine)
    silent = station_of(sim, tmp_path / "here")
    lee = station_of(sim, tmp_path / "there", name="lee")
    looks(lee, 30)
    assert lee.state.held_by is None and str(silent.number) in observing(load("en"), lee.state, datetime.now(UTC))
    lee.hear()
    looks(lee)
    assert b"P1012" not in lee.hear(), "it is not asked for ever"


def test_the_console_in_control_counts_who_looks_on(tmp_path: Path) -> None:
    """Processes, because a lock of a process does not keep out its own."""
    address, asked, ended = "tcp:lathe:1025", os.pipe(), os.pipe()
    observer = os.fork()
    if not observer:
        there = Onlookers(tmp_path, address)
        there._looks_on = True
        there.see()
        os.write(asked[1], b"x")
        os.read(ended[0], 1)
        os._exit(0)
    here = Onlookers(tmp_path, address)
    assert os.read(asked[0], 1)
    here.see()
    seen = here.count
    os.write(ended[1], b"x")
    os.waitpid(observer, 0)
    here.see()
    assert (seen, here.count) == (1, 0)
    here._looks_on = True
    here.see()
    assert here.count == 0
    shown = onlookers(load("en"), StationState(onlookers=1))
    assert "1 console looks on" in str(shown) and onlookers(load("en"), StationState()) == ()


def test_when_the_console_in_control_has_gone_the_alarm_of_it_ends_and_t_is_named(tmp_path: Path) -> None:
    sim = SimulatedLathe(load_machine(MACHINE).machine)
    kim = station_of(sim, tmp_path)
    lee = station_of(sim, tmp_path)
    looks(lee)
    assert "owner.beside" in lee.alarms
    kim.station.close("quit")
    looks(lee)
    assert lee.alarms == ["owner.free"] and "press t" in load("en").problem(lee.state.alarms[0].problem)
    assert "owner.beside" not in [alarm.problem.code for alarm in lee.state.alarms]
    lee.do(TakeControl())
    assert "owner.free" not in lee.alarms
