"""The adapter for MTConnect agents at a real socket, line by line, and beside a console that is killed."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import pytest

from console.session.feed.feed_state import FeedState
from console.session.feed.observed_state import ObservedState
from console.session.feed.place import claim_place
from console.session.feed.report import report
from console.session.feed.server import FeedServer
from console.session.station.state import Activity, StationState
from console.site.exchange.adapter import MOST_CLIENTS, Adapter
from console.site.exchange.mtconnect import publish_state
from drivers.lathe.console_role import ConsoleRole
from profiles.store import load_machine
from tests.preloaded import Preloaded, completed
from tests.trainee import console, console_at

pytestmark = [pytest.mark.system, pytest.mark.timeout(120)]

MACHINE = load_machine("lee-2001-lathe").machine
READY = StationState(activity=Activity.READY, machine=MACHINE.name)
TIMEOUT_S = 20.0


class Shown:
    """Is observed by a feed; a test changes what it is."""

    def __init__(self, state: StationState) -> None:
        self.state, self.parts = state, 0

    def observed(self) -> ObservedState:
        return ObservedState(state=self.state, machine=MACHINE, now_s=0.0, job="ring", parts=self.parts)


class Agent:
    """A client of the adapter that reads a line at a time."""

    def __init__(self, address: str, kept_bytes: int | None = None) -> None:
        """Connect; the system keeps so much of what is not read."""
        host, _, port = address.rpartition(":")
        self.link = socket.socket()
        if kept_bytes is not None:
            self.link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, kept_bytes)
        self.link.settimeout(TIMEOUT_S)
        self.link.connect((host, int(port)))
        self._stream = self.link.makefile("rb")

    def line(self) -> str:
        return self._stream.readline().decode().rstrip("\n")

    def fields(self) -> list[str]:
        """The next line without its timestamp."""
        return self.line().split("|")[1:]

    def until(self, *fields: str) -> list[str]:
        """Read lines until one has these fields beside each other."""
        wanted = f"|{'|'.join(fields)}|"
        while line := self.line():
            if wanted in f"{line}|":
                return line.split("|")[1:]
        raise AssertionError(f"the adapter has ended; no {fields}")

    def ping(self) -> None:
        self.link.sendall(b"* PING\n")

    def close(self) -> None:
        self._stream.close()
        self.link.close()


@pytest.fixture
def adapter() -> Iterator[Adapter]:
    found = Adapter("127.0.0.1", 0, heartbeat_s=0.5, unread_s=0.5)
    yield found
    found.close()


@contextmanager
def serving(data: Path, *more: str) -> Iterator[tuple[Preloaded, str]]:
    """Start `console mtconnect`; yield it with its address."""
    words = ["mtconnect", "--listen", "127.0.0.1:0", "--rate", "10", "--json", "--data", str(data), *more]
    with Preloaded([sys.executable, "-m", "console", *words], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            told = json.loads(process.stdout.readline())
            assert (told["machine"], told["simulated"]) == ("lee-2001-lathe", "--sim" in more)
            yield process, told["listening"]
        finally:
            process.kill()


def state_line(parts: int) -> FeedState:
    observed = Shown(READY)
    observed.parts = parts
    return report(observed.observed(), process=1, operator="kim", at_utc="2026-01-01T00:00:00Z")


def test_a_ping_is_answered_with_how_often_it_has_to_come(adapter: Adapter) -> None:
    agent = Agent(adapter.start())
    agent.ping()
    assert agent.line() == "* PONG 500"
    for _ in range(3):
        agent.ping()
        assert agent.line() == "* PONG 500"
    began_s = time.monotonic()
    assert agent.line() == ""  # no ping for twice that: it is dropped
    assert 0.9 < time.monotonic() - began_s < 10.0
    agent.close()


def test_who_never_pings_is_served_all_the_same(adapter: Adapter) -> None:
    agent = Agent(adapter.start())
    adapter.show(publish_state(None, "2026-01-01T00:00:00Z"))
    assert agent.fields()[:2] == ["avail", "UNAVAILABLE"]
    time.sleep(1.2)  # longer than the timeout of one that pings; nothing is simulated here
    agent.link.sendall(b"what is this?\n")  # no command of the protocol: ignored
    adapter.show(publish_state(state_line(1), ""))
    agent.until("part_count", "1")
    agent.close()


def test_who_does_not_read_is_dropped_and_holds_up_nobody(adapter: Adapter) -> None:
    address = adapter.start()
    stalled, agent = Agent(address, 4096), Agent(address)
    long_name = "x" * 20_000  # of a job, so that what the system keeps is full soon
    began_s, parts = time.monotonic(), 0
    while parts < 20 or time.monotonic() - began_s < 2.0:
        parts += 1
        adapter.show(publish_state(replace(state_line(parts), job=f"{long_name}{parts}"), ""))
        agent.until("part_count", str(parts))
    with suppress(ConnectionError):
        while stalled.link.recv(1_000_000):  # else this would time out
            pass
    for each in (stalled, agent):
        each.close()


def test_a_line_without_an_end_is_dropped(adapter: Adapter) -> None:
    agent = Agent(adapter.start())
    with suppress(ConnectionError):
        for _ in range(1000):
            agent.link.sendall(b"x" * 10_000)
        raise AssertionError("it is read for ever")
    agent.close()


def test_who_comes_beyond_the_most_is_dropped(adapter: Adapter) -> None:
    address = adapter.start()
    adapter.show(publish_state(None, "2026-01-01T00:00:00Z"))
    with ExitStack() as held:
        for _ in range(MOST_CLIENTS):
            agent = Agent(address)
            held.callback(agent.close)
            assert agent.fields()[0] == "avail"
        further = Agent(address)
        with suppress(ConnectionError):
            assert further.line() == ""
        further.close()


def test_an_agent_follows_consoles_that_come_and_go(tmp_path: Path) -> None:
    shown = Shown(READY)
    with serving(tmp_path, "--sim") as (_, address):
        agent, other = Agent(address), Agent(address)
        assert agent.fields()[:4] == ["avail", "UNAVAILABLE", "execution", "UNAVAILABLE"]
        assert [agent.fields() for _ in range(3)] == [
            [key, "UNAVAILABLE", "", "", "", ""] for key in ("communications", "motion", "system")
        ]
        for turn in range(2):  # the second time it comes back by itself
            server = FeedServer(tmp_path, shown.observed)
            server.launch()
            values = agent.until("avail", "AVAILABLE")
            assert dict(zip(values[::2], values[1::2], strict=True))["program"] == "ring"
            assert [agent.fields() for _ in range(3)] == [
                [key, "NORMAL", "", "", "", ""] for key in ("communications", "motion", "system")
            ]
            shown.parts += 1
            assert agent.fields() == ["part_count", str(turn + 1)]
            other.until("part_count", str(turn + 1))
            server.close()
            agent.until("avail", "UNAVAILABLE")
            agent.until("system", "UNAVAILABLE")
        for each in (agent, other):
            each.close()


def test_a_simulated_console_is_not_told_as_the_real_machine(tmp_path: Path) -> None:
    real, sim = Shown(replace(READY, simulated=False)), Shown(READY)
    real.parts, sim.parts = 1, 1000
    servers = [FeedServer(tmp_path, each.observed) for each in (real, sim)]
    for server in servers:
        server.launch()
    for more, parts in ((), "1"), (("--sim",), "1000"):
        with serving(tmp_path, *more) as (_, address):
            agent = Agent(address)
            values = agent.until("avail", "AVAILABLE")
            assert values[values.index("part_count") + 1] == parts
            agent.close()
    for server in servers:
        server.close()


def test_of_two_consoles_on_a_machine_that_is_told_which_controls_it(tmp_path: Path) -> None:
    owner, observer = Shown(READY), Shown(replace(READY, standing=ConsoleRole.OBSERVER, holder=12))
    owner.parts, observer.parts = 5, 0
    servers = [FeedServer(tmp_path, each.observed) for each in (observer, owner)]
    with serving(tmp_path, "--sim") as (_, address):
        agent = Agent(address)
        for server in servers:
            server.launch()
        agent.until("part_count", "5")
        servers[1].close()
        agent.until("part_count", "0")
        agent.close()
    servers[0].close()


def test_garbage_in_a_feed_is_told_once_and_is_no_state(tmp_path: Path) -> None:
    with ExitStack() as opened:
        listening = claim_place(tmp_path, opened)
        listening.listen()
        with serving(tmp_path, "--sim") as (process, address):
            agent = Agent(address)
            agent.until("avail", "UNAVAILABLE")
            link, _ = listening.accept()
            opened.enter_context(link)
            link.sendall(b'{"schema": 1, "machine": "lee-2001-lathe", "simulated": true, "execution": 7}\n')
            server = FeedServer(tmp_path, Shown(READY).observed)  # another console works it all the same
            server.launch()
            opened.callback(server.close)
            agent.until("avail", "AVAILABLE")
            agent.close()
            assert process.poll() is None


def test_a_console_that_is_halted_becomes_unavailable(tmp_path: Path) -> None:
    halted = os.fork()
    if halted == 0:
        FeedServer(tmp_path, Shown(READY).observed).launch()
        signal.pause()
        os._exit(0)
    try:
        with serving(tmp_path, "--sim") as (_, address):
            agent = Agent(address)
            agent.until("avail", "AVAILABLE")
            os.kill(halted, signal.SIGSTOP)
            agent.until("avail", "UNAVAILABLE")
            os.kill(halted, signal.SIGCONT)
            agent.until("avail", "AVAILABLE")
            agent.close()
    finally:
        os.kill(halted, signal.SIGKILL)
        os.waitpid(halted, 0)


def test_a_port_that_is_taken_is_refused_in_one_line(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        where = f"127.0.0.1:{taken.getsockname()[1]}"
        refused = completed(["mtconnect", "--listen", where, "--data", str(tmp_path)], 30.0)
    assert (refused.returncode, refused.stdout, refused.stderr.count("\n")) == (1, "", 1)
    assert "choose another port" in refused.stderr


@pytest.mark.long
def test_a_killed_console_at_a_terminal_becomes_unavailable_and_comes_back(tmp_path: Path) -> None:
    with serving(tmp_path, "--sim") as (process, address):
        agent = Agent(address)
        agent.until("avail", "UNAVAILABLE")
        with console(tmp_path, "en", 80, 24, short_ways=True) as terminal:
            trainee = console_at(terminal)
            agent.until("avail", "AVAILABLE")
            trainee.switches_on()
            trainee.starts_homing()
            agent.until("execution", "ACTIVE")
            trainee.press("space")
            agent.until("execution", "STOPPED")
            terminal.signal(signal.SIGKILL)
            agent.until("avail", "UNAVAILABLE")
        with console(tmp_path, "en", 80, 24, short_ways=True) as terminal:
            trainee = console_at(terminal)
            agent.until("avail", "AVAILABLE")
            process.send_signal(signal.SIGKILL)  # and the console does not mind
            while agent.line():
                pass
            trainee.press("ctrl+q")
            assert terminal.wait_exit(20.0) == 0
        agent.close()


def test_two_lathes_with_one_profile_are_two_devices_that_stay_what_they_are(tmp_path: Path) -> None:
    def uuid(folder: str) -> str:
        done = completed(["mtconnect", "--devices", "--data", str(tmp_path / folder)], 30.0)
        assert done.returncode == 0, done.stderr
        return done.stdout.partition('uuid="')[2].partition('"')[0]

    first = uuid("one")
    assert first.endswith(".lee-2001-lathe") and uuid("one") == first != uuid("two")
