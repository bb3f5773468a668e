"""From a stop key to its byte: the byte goes first, by a short way, and nothing that takes notes can hinder it."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from textual import events
from textual.message import Message

from console.flight.notes import Inbox
from console.flight.recorded_control import RecordedControl
from console.session.station.link.opening import Opened
from console.session.station.link_thread import LinkThread
from console.session.station.state import StationState
from console.text.catalogue import load
from console.tui.application.listening import ListeningApp
from console.tui.application.logged_control import LoggedControl
from console.tui.application.scan_collector import Collector
from console.tui.driver import StopDriver
from console.tui.gate import Situation
from console.tui.keymap import PageName
from console.tui.pace import Pace
from console.tui.theme import MONO
from console.tui.ui_context import UiContext
from drivers.lathe.stop import StopPath
from drivers.link.passing import RenewableLink, TappedLink
from drivers.link.tracing import TracedLink
from profiles.store import load_machine
from tests.console.consoles import MACHINE
from tests.drivers.test_recovery import Wire
from tests.tui.stage import answered_age

MOST_FRAMES = 11


def fails(*_: object) -> None:
    raise RuntimeError("nothing can be noted")


class Measured(Wire):
    """The connection; notes how many calls lie between the reading of the key and its byte."""

    def __init__(self) -> None:
        super().__init__()
        self.frames: list[int] = []

    def send_urgent(self, data: bytes) -> None:
        names, frame = [], sys._getframe()
        while frame is not None and frame.f_code.co_name != "read_keys":
            names.append(frame.f_code.co_name)
            frame = cast("Any", frame.f_back)
        self.frames.append(len(names))
        super().send_urgent(data)


class Screen:
    """The application, as far as the thread that reads keys calls it."""

    stop_now, kill_now = ListeningApp.stop_now, ListeningApp.kill_now

    def __init__(self, ui: UiContext) -> None:
        self.ui = ui

    def situation(self) -> Situation:
        return Situation(page=PageName.RUN, moving=True)


class Driver(StopDriver):
    """The thread that reads keys, without a terminal. `queue` is where its messages go."""

    def __init__(self, app: Screen) -> None:
        self._app = app  # type: ignore[assignment]
        self._pace, self._codes, self._stopped_s = Pace(), Collector(), float("-inf")
        self.age, self._drops, self.cursor_origin = answered_age(), False, None
        self.queue: list[Message] = []

    def send_message(self, message: Message) -> None:
        self.queue.append(message)

    def read_keys(self, *keys: str) -> None:
        for key in keys:
            self.process_message(events.Key(key, None))


def key_thread(monkeypatch: pytest.MonkeyPatch | None = None) -> tuple[Measured, Driver]:
    """The whole way as `console` builds it with a trace, an instructor's ear and a flight recorder."""
    wire, inbox, machine = Measured(), Inbox(time.monotonic), load_machine(MACHINE)
    tap: Any = inbox.put
    trace = SimpleNamespace(write=lambda line: None)
    if monkeypatch is not None:
        monkeypatch.setattr(Inbox, "put", fails)
        tap, trace = fails, SimpleNamespace(write=fails)
    link = TappedLink(TracedLink(TappedLink(RenewableLink(wire), tap), trace, time.monotonic), tap)
    thread = LinkThread("a lathe", True, lambda: cast("Opened", None))
    station = cast("Any", SimpleNamespace(state=StationState(machine="a lathe", simulated=True)))
    thread._opened = Opened(station=station, stop=StopPath(link), close=lambda: None)
    control = LoggedControl(RecordedControl(thread, inbox), fails, fails)  # type: ignore[arg-type]
    ui = UiContext(
        text=load("en"), palette=MONO, control=control, machine=machine, data=Path(), go=lambda page: None
    )
    ui.queued = True
    return wire, Driver(Screen(ui))


def test_a_stop_key_takes_a_short_way_to_its_byte() -> None:
    wire, driver = key_thread()
    driver.read_keys("space", "f9")
    assert len(wire.urgent) == 2
    assert max(wire.frames) <= MOST_FRAMES


def test_every_stop_goes_out_though_every_recorder_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    wire, driver = key_thread(monkeypatch)
    driver.read_keys("space", "f9", "f12")
    assert wire.urgent == [b"\x0b"] * 3
    assert [type(message).__name__ for message in driver.queue].count("StopSent") == 3
    assert not driver._app.ui.queued  # type: ignore[attr-defined]


@pytest.mark.parametrize("part", ["_pace", "_codes", "age"])
def test_a_fault_in_what_follows_a_stop_is_told_and_the_next_stop_goes_out(part: str) -> None:
    wire, driver = key_thread()
    setattr(driver, part, None)
    driver.read_keys("space", "space")
    assert len(wire.urgent) == 2
    assert [type(message).__name__ for message in driver.queue].count("KeyFault") == 2
