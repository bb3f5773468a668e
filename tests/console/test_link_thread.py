"""The thread behind the screen, and a controller that falls silent or whose time is held."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from pytest import MonkeyPatch

from console.session.station import link_thread
from console.session.station.alarms import Priority
from console.session.station.commands import Acknowledge, Command, EnableDrives, Home, Start
from console.session.station.link.opening import OpenMachine
from console.session.station.link_thread import LinkThread
from console.session.station.state import Activity, StationState
from drivers.errors import LinkError
from drivers.lathe import heartbeat
from drivers.lathe.heartbeat import RATE, RATE_READINGS
from drivers.lathe.snapshot import Snapshot
from drivers.simulator.plant.workshop_view import WorkshopView
from profiles.problem import Problem
from tests.console.floor import Floor, experiment_1, in_turn, open_floor

SOON_S = 10.0


def opened(floor: Floor, close: Callable[[], None] = lambda: None) -> OpenMachine:
    return OpenMachine(station=floor.station, stop=floor.stop, close=close)


def thread(open_machine: Callable[[], OpenMachine]) -> LinkThread:
    return LinkThread("a lathe", True, open_machine)


def wait_until(condition: Callable[[], bool]) -> None:
    """Wait for the other thread."""
    pause = threading.Event()
    for _ in range(int(SOON_S / 0.005)):
        if condition():
            return
        pause.wait(0.005)
    raise AssertionError("it did not come")


@pytest.fixture
def floor(tmp_path: Path) -> Floor:
    return open_floor(tmp_path)


@pytest.fixture
def link(floor: Floor) -> Iterator[LinkThread]:
    """Connected to the machine, and ready."""
    connected = thread(lambda: opened(floor))
    connected.start()
    connected.open()
    wait_until(lambda: connected.state.activity is Activity.READY)
    yield connected
    connected.end("over")
    assert connected.join(SOON_S)


def ordered(link: LinkThread, intent: Command) -> None:
    """Order something; the machine may still be at its last look."""
    wait_until(lambda: link.post(intent))


@pytest.mark.parametrize("act", [LinkThread.stop, LinkThread.kill])
def test_a_stop_before_the_machine_comes_first(act: Callable[[LinkThread, str], None], floor: Floor) -> None:
    go = threading.Event()

    def open_slowly() -> OpenMachine:
        assert go.wait(SOON_S)
        return opened(floor)

    link = thread(open_slowly)
    link.start()
    link.open()
    act(link, "space")
    go.set()
    wait_until(lambda: link.state.activity is Activity.STOPPED)
    state = link.state
    assert state.stop is not None and state.stop.reason == "space" and state.stop.rest_s is not None
    assert not link.post(EnableDrives())
    assert not floor.lathe.has_moved
    link.end("over")
    assert link.join(SOON_S) and link.rested


def test_an_order_before_the_machine_is_there_is_refused() -> None:
    link = thread(lambda: pytest.fail("opened without being asked"))
    assert not link.post(EnableDrives())
    link.start()
    assert not link.post(Acknowledge())
    assert link.state.activity is Activity.CONNECTING
    link.end("over")
    assert link.join(SOON_S) and link.rested


def test_the_end_stops_what_moves_and_leaves_the_drives_off(link: LinkThread, floor: Floor) -> None:
    ordered(link, EnableDrives())
    wait_until(lambda: link.state.activity is Activity.READY and link.state.alignment.drives_on)
    seen: list[StationState] = []

    def end() -> None:
        seen.append(link.state)
        link.end("SIGTERM")

    floor.when(lambda snapshot: not snapshot.at_rest, end)
    ordered(link, Home())
    assert link.join(SOON_S) and link.rested
    assert seen[0].moving
    stop = link.state.stop
    assert stop is not None and stop.reason == "SIGTERM" and stop.killed and stop.rest_s is not None
    snapshot = floor.lathe.snapshot()
    assert snapshot.at_rest and snapshot.loops_open and not snapshot.homed


def test_signals_that_keep_coming_do_not_keep_the_machine_from_being_proven_at_rest(floor: Floor) -> None:
    """Each stop begins the proof of rest anew: those of further signals would use up the time for it."""
    link = LinkThread("a lathe", True, lambda: opened(floor), give_up=lambda _: None)
    link.start()
    link.open()
    wait_until(lambda: link.state.activity is Activity.READY)
    ordered(link, EnableDrives())
    wait_until(lambda: link.state.activity is Activity.READY and link.state.alignment.drives_on)
    begun: list[float] = []

    def again(snapshot: Snapshot) -> None:
        if begun or not snapshot.at_rest:
            begun.append(floor.sim.now_s())
            link.end("SIGTERM", must_leave=True)

    floor.looks.append(again)
    ordered(link, Home())
    assert link.join(SOON_S) and link.rested
    assert begun[-1] - begun[0] < 3.0, "ramp, drives off, and both proven"


def test_an_end_between_an_order_and_its_beginning_lets_nothing_move(floor: Floor) -> None:
    """A signal may come when the order is taken and the activity is still that of rest."""
    link = LinkThread("a lathe", True, lambda: opened(floor), give_up=lambda _: None)
    link.start()
    link.open()
    wait_until(lambda: link.state.activity is Activity.READY)
    step = floor.station.step

    def late_step() -> None:
        if floor.station.post(EnableDrives()):
            link.end("SIGTERM", must_leave=True)
        step()

    floor.station.step = late_step  # type: ignore[method-assign]
    assert link.join(SOON_S) and link.rested
    assert floor.lathe.snapshot().loops_open
    assert not floor.lathe.has_moved


@pytest.mark.parametrize(
    ("fault", "code"),
    [
        (LinkError(Problem(code="simulator.not_started", value="no room")), "simulator.not_started"),
        (RuntimeError("something else"), "session.fault"),
    ],
)
def test_a_machine_that_cannot_be_opened_says_why(fault: Exception, code: str) -> None:
    def fail() -> OpenMachine:
        raise fault

    link = thread(fail)
    link.start()
    link.open()
    wait_until(lambda: link.state.activity is Activity.LOST)
    assert [alarm.problem.code for alarm in link.state.alarms] == [code]
    assert link.state.machine == "a lathe"
    assert not link.post(EnableDrives())
    link.stop("space")
    link.end("quit")
    # Nothing was opened, so nothing moves because of it.
    assert link.join(SOON_S) and link.rested


def test_a_machine_that_is_switched_on_later_is_connected_by_itself(
    floor: Floor, monkeypatch: MonkeyPatch
) -> None:
    monkeypatch.setattr(link_thread, "CONNECT_AGAIN_S", 0.01)
    receive, silent = floor.link.receive, True

    def heard(timeout_s: float) -> bytes:
        came = receive(timeout_s)
        return b"" if silent else came

    floor.link.receive = heard  # type: ignore[method-assign]
    link = thread(lambda: opened(floor))
    link.start()
    link.open()
    wait_until(lambda: link.state.activity is Activity.LOST)
    silent = False
    wait_until(lambda: link.state.activity is Activity.READY)
    assert [alarm.problem.code for alarm in link.state.alarms] == ["link.silent"]
    link.end("over")
    assert link.join(SOON_S) and link.rested and not floor.lathe.has_moved


def test_a_link_that_is_lost_in_motion_is_not_left_as_if_at_rest(link: LinkThread, floor: Floor) -> None:
    ordered(link, EnableDrives())
    wait_until(lambda: link.state.activity is Activity.READY and link.state.alignment.drives_on)

    def cut_the_cable() -> None:
        def gone(*_: object) -> bytes:
            raise LinkError(Problem(code="link.lost", value="unplugged"))

        floor.link.send = floor.link.send_urgent = floor.link.receive = gone  # type: ignore[assignment,method-assign]

    floor.when(lambda snapshot: not snapshot.at_rest, cut_the_cable)
    ordered(link, Home())
    wait_until(lambda: link.state.activity is Activity.LOST)
    link.end("quit")
    assert link.join(SOON_S) and not link.rested


def test_a_fault_of_the_thread_itself_stops_the_machine_and_is_told(floor: Floor) -> None:
    closed: list[str | None] = []
    link = thread(lambda: opened(floor, lambda: closed.append(floor.stop.reason)))

    def broken() -> None:
        raise ZeroDivisionError("oops")

    floor.station.step = broken  # type: ignore[method-assign]
    link.start()
    link.open()
    wait_until(lambda: link.state.activity is Activity.LOST)
    # The stop went out before the link was closed.
    assert closed == ["fault"] and floor.stop.killed
    assert "session.fault" in [alarm.problem.code for alarm in link.state.alarms]
    link.end("quit")
    assert link.join(SOON_S) and not link.rested


def test_a_screen_that_cannot_leave_does_not_keep_the_process(floor: Floor) -> None:
    given_up: list[int] = []
    link = LinkThread("a lathe", True, lambda: opened(floor), leave_s=0.01, give_up=given_up.append)
    link.start()
    link.open()
    wait_until(lambda: link.state.activity is Activity.READY)
    link.end("quit")
    assert link.join(SOON_S) and link.rested
    # The operator leaves: the screen may take its time. A signal comes: it may not.
    assert given_up == []
    link.end("SIGHUP", must_leave=True)
    wait_until(lambda: given_up == [1])


def test_a_signal_in_the_midst_of_a_call_does_not_wait_for_itself(link: LinkThread) -> None:
    """A handler runs in the middle of whatever the main thread does with the link."""
    handled: list[int] = []

    def handle(number: int, _: object) -> None:
        handled.append(number)
        link.stop("SIGALRM")

    before = signal.signal(signal.SIGALRM, handle)
    signal.setitimer(signal.ITIMER_REAL, 0.0005, 0.0005)
    try:
        while len(handled) < 200:
            link.post(Acknowledge())
            link.beat()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    wait_until(lambda: link.state.stop is not None)


SILENT_S = 3.0


class Silence:
    """A link on which nobody answers for some seconds; what is sent meanwhile is lost."""

    def __init__(self, floor: Floor, patch: MonkeyPatch) -> None:
        self._floor, self.began_s = floor, float("inf")
        self._receive = floor.link.receive
        patch.setattr(floor.link, "receive", self.receive)
        for name in ("send", "send_urgent"):
            patch.setattr(floor.link, name, self._sending(getattr(floor.link, name)))

    @property
    def is_on(self) -> bool:
        return self.began_s <= self._floor.sim.now_s() < self.began_s + SILENT_S

    def receive(self, timeout_s: float) -> bytes:
        if not self.is_on:
            return self._receive(timeout_s)
        self._floor.sim.wait(timeout_s)
        return b""

    def _sending(self, send: Callable[[bytes], None]) -> Callable[[bytes], None]:
        return lambda data: None if self.is_on else send(data)


def test_a_silence_in_motion_is_lost_within_a_second(tmp_path: Path, monkeypatch: MonkeyPatch) -> None:
    """Once it answers, nobody is told that it does not: what is left is to see it at rest."""
    floor = open_floor(tmp_path, owned=True)
    floor.do(EnableDrives())
    silence = Silence(floor, monkeypatch)
    told: list[tuple[float, StationState]] = []
    tell = floor.context.tell

    def listen(**changes: object) -> None:
        tell(**changes)
        told.append((floor.sim.now_s(), floor.context.state))

    monkeypatch.setattr(floor.context, "tell", listen)

    def begin() -> None:
        silence.began_s = floor.sim.now_s()

    floor.when(lambda seen: "desired_velocity_zero" not in seen.tool.flags, begin)
    floor.station.post(Home())
    floor.station.step()
    began_s = silence.began_s
    moving = next(state for at_s, state in reversed(told) if at_s <= began_s and state.snapshot is not None)
    assert not moving.is_unanswered(began_s + 0.3) and moving.is_unanswered(began_s + 0.75)
    lost_s = next(at_s for at_s, state in told if state.activity is Activity.LOST)
    assert lost_s - began_s < 1.0
    again = [state for at_s, state in told if at_s > began_s + SILENT_S]
    answered = next(place for place, state in enumerate(again) if state.snapshot is not moving.snapshot)
    assert {state.activity for state in again[answered + 1 :]} <= {Activity.STOPPING, Activity.STOPPED}
    assert floor.state.activity is Activity.STOPPED


def holding(floor: Floor, held_s: list[float]) -> None:
    """Have the lathe report this much held time."""
    look = floor.sim.look

    def held() -> WorkshopView:
        return replace(look(), held_s=held_s[0])

    floor.sim.look = held  # type: ignore[method-assign]


def test_time_that_is_held_in_a_cut_is_told_once_and_at_rest_not_at_all(aligned: Floor) -> None:
    held_s = [0.0]
    holding(aligned, held_s)
    aligned.idle(2.0)
    held_s[0] = 3.0
    assert aligned.idle(2.0).alarms == ()
    aligned.arm(experiment_1())
    aligned.when(lambda _: in_turn(aligned, 5.0), lambda: held_s.__setitem__(0, 4.2))
    assert aligned.do(Start()).cut_done
    (alarm,) = aligned.idle().alarms
    assert (alarm.problem.code, alarm.problem.value) == ("simulator.held", "1.2 s")
    assert (alarm.priority, alarm.count) == (Priority.LOW, 1)


@pytest.mark.parametrize("held", [True, False])
def test_held_time_judges_no_watchdog(aligned: Floor, held: bool, monkeypatch: MonkeyPatch) -> None:
    readings = count()

    def read(*_: Any) -> Any:
        next(readings)

    monkeypatch.setattr(heartbeat, "read_heartbeat", read)
    monkeypatch.setattr(heartbeat, "heartbeat_problems", lambda *_: (Problem(code=RATE),))
    times = count()
    held_s = (lambda: float(next(times))) if held else None
    guard = heartbeat.Heartbeat(aligned.lathe._client, aligned.sim, aligned.context.machine, held_s=held_s)
    _, problems = guard._read_heartbeat()
    assert [problem.code for problem in problems] == ([] if held else [RATE])
    assert next(readings) == RATE_READINGS
