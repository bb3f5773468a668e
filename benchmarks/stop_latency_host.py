"""The console's side of `benchmarks.stop_latency`: a link under load, and a key that stops the machine.

python -m benchmarks.stop_latency_host ADDRESS (bare|nothing|looks|gather) PIPE [FILE [DATA (recorder|feed)]]:
opens the link and works on it in a thread of its own. A byte from the terminal is a stop: with FILE, which holds
the moments of a cut, pickled, through the console itself, which shows one of them at each tick, and with what
runs beside it in the folder DATA; else through a thread that only reads. To PIPE goes a time when all is ready,
and for each stop the time of its call: of CLOCK_MONOTONIC, in s, a double.
"""

from __future__ import annotations

import os
import pickle
import struct
import sys
import threading
import time
from collections.abc import Callable, Sequence
from datetime import datetime
from functools import partial
from itertools import count
from pathlib import Path

from console.flight.notes import Inbox
from console.flight.recorded_control import RecordedControl
from console.flight.recorded_forms import RecordedMoment, work_of
from console.flight.recorder import FlightRecorder
from console.screens.start import SWITCH_INTERVAL_S
from console.session.feed.observed_state import ObservedState
from console.session.feed.server import FeedServer
from console.session.station.commands import Command, Control
from console.session.station.state import StationState
from console.session.work import open_work
from console.text.catalogue import load
from console.tui.app import ConsoleApp
from console.tui.driver import StopDriver
from console.tui.keymap import PageName
from console.tui.theme import COLOUR
from drivers.clock import RealClock
from drivers.lathe.lathe import Lathe
from drivers.lathe.stop import KILL_ALL, StopPath
from drivers.link.address import SerialAddress, SimulatedAddress, parse_address
from drivers.link.base import Link
from drivers.link.opening import open_link
from drivers.link.passing import TappedLink
from drivers.pmac.client import PmacClient
from drivers.pmac.gathering.gather_client import DataGathering
from drivers.requests.side_line import SideLine
from profiles.store import load_job, load_machine

MACHINE = "lee-2001-lathe"
EXPERIMENT = "lee-2001-experiment-1"
LOOK_PERIOD_S = 0.023
DRAW_PERIOD_S = 0.05
SAMPLES = 2000
"""Of two channels: 4000 long words, listed over and over."""
CHANNELS = ("#1 actual", "#1 commanded")
CLOCK = datetime(2026, 11, 21, 10, 0)

Told = Callable[[float], None]
Stop = Callable[[], None]


class Endless:
    """A control that shows the moments of a cut over and over, and whose stop is the real one."""

    def __init__(self, moments: Sequence[StationState], stop: Stop) -> None:
        self.side: SideLine | None = None
        self._moments, self._stop = moments, stop
        self._ticks = count()
        self.state = moments[0]

    def now_s(self) -> float:
        """Return the time of the moment that is shown."""
        return self.state.at_s

    def post(self, intent: Command) -> bool:
        """Take no order."""
        return False

    def stop(self, reason: str) -> None:
        """Stop the machine."""
        self._stop()

    def kill(self, reason: str) -> None:
        """Stop it with the same byte."""
        self._stop()

    def beat(self) -> None:
        """Go on to the next moment."""
        self.state = self._moments[next(self._ticks) % len(self._moments)]


def bare_stop(device: str, told: Told) -> Stop:
    """Return the least that a stop can be: one write."""
    line = os.open(device, os.O_RDWR | os.O_NOCTTY)

    def stop() -> None:
        called_s = time.monotonic()
        os.write(line, KILL_ALL)
        told(called_s)

    return stop


def real_stop(link: Link, told: Told) -> Stop:
    """Return the one of the product. Each is the first: nothing is known of the drives, and it is a control-K."""

    def stop() -> None:
        path = StopPath(link)
        called_s = time.monotonic()
        path.stop("space")
        told(called_s)

    return stop


def work_on(link: Link, load_of_link: str) -> Callable[[], object]:
    """Connect, and return what the link's thread is to do again and again."""
    machine, clock = load_machine(MACHINE).machine, RealClock()
    client = PmacClient(link, clock)
    if load_of_link == "nothing":
        return lambda: time.sleep(1.0)
    lathe = Lathe(client, machine, clock, StopPath(link))
    lathe.connect()
    if load_of_link == "looks":

        def look() -> None:
            began_s = time.monotonic()
            lathe.snapshot()
            time.sleep(max(began_s + LOOK_PERIOD_S - time.monotonic(), 0.0))

        return look
    gathering = DataGathering(client=client, dialect=client.dialect)
    plan = gathering.prepare(gathering.motor_channels(*CHANNELS), SAMPLES)
    gathering.start(plan)
    time.sleep(plan.duration_ms / 1000.0 + 0.1)
    gathering.stop()
    return lambda: gathering.fetch(plan)


def for_ever(work: Callable[[], object]) -> None:
    """Run the link's thread."""

    def run() -> None:
        while True:
            work()

    threading.Thread(target=run, name="link", daemon=True).start()


def show(
    moments: Sequence[StationState], stop: Stop, told: Told, record: Callable[[Control], Control] | None
) -> None:
    """Run the console itself on the page Run; it is ready when the preview of its job was computed."""
    app: ConsoleApp
    endless = Endless(moments, stop)

    def begin() -> None:
        app.go(PageName.RUN)
        app.set_interval(DRAW_PERIOD_S, app.tick)
        waiting = app.set_interval(DRAW_PERIOD_S, lambda: ready())

        def ready() -> None:
            if app.ui.work is not None and app.ui.work.preview is not None:
                waiting.stop()
                told(time.monotonic())

    app = ConsoleApp(
        text=load("en"),
        palette=COLOUR,
        control=endless if record is None else record(endless),
        machine=load_machine(MACHINE),
        data=Path(),
        begin=begin,
        local_time=lambda: CLOCK,
        ticking=False,
        driver_class=StopDriver,
    )
    app.ui.work = open_work(load_job(EXPERIMENT), load_machine(MACHINE))
    app.run(mouse=False)


def recording(data: Path, inbox: Inbox) -> Callable[[Control], Control]:
    """Return what starts a flight recorder before a control."""

    def record(control: Control) -> Control:
        work = work_of(open_work(load_job(EXPERIMENT), load_machine(MACHINE)))
        recorder = FlightRecorder(
            data, load_machine(MACHINE), lambda: RecordedMoment(state=control.state, page="run", work=work), inbox
        )
        recorder.start()
        return RecordedControl(control, inbox)

    return record


def publishing(data: Path) -> Callable[[Control], Control]:
    """Return what publishes the state of a control on its feed."""

    def publish(control: Control) -> Control:
        machine = load_machine(MACHINE).machine
        FeedServer(
            data, lambda: ObservedState(state=control.state, machine=machine, now_s=control.now_s())
        ).launch()
        return control

    return publish


def main() -> None:
    """Work until the process is ended."""
    where, load_of_link, pipe, *files = sys.argv[1:]

    def told(at_s: float) -> None:
        os.write(int(pipe), struct.pack("d", at_s))

    address, inbox = parse_address(where), Inbox(time.monotonic)
    assert not isinstance(address, SimulatedAddress)
    if load_of_link == "bare":
        assert isinstance(address, SerialAddress)
        stop = bare_stop(address.device, told)
    else:
        link = open_link(address)
        if files[2:] == ["recorder"]:
            link = TappedLink(link, inbox.put)
        stop = real_stop(link, told)
        for_ever(work_on(link, load_of_link))
    if files:
        sys.setswitchinterval(SWITCH_INTERVAL_S)
        beside = publishing if files[2:] == ["feed"] else partial(recording, inbox=inbox)
        record = beside(Path(files[1])) if files[1:] else None
        show(pickle.loads(Path(files[0]).read_bytes()), stop, told, record)
        return
    told(time.monotonic())
    while os.read(0, 1):
        stop()


if __name__ == "__main__":
    main()
