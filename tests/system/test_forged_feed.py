"""A console that publishes what is no state, beside a sound one: no reader stops, and each says it once."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, replace
from http.client import HTTPConnection
from itertools import cycle
from pathlib import Path

import pytest

from console.session.feed.feed_state import FeedState
from console.session.feed.following import Follower
from console.session.feed.place import claim_place
from console.session.feed.report import line_of
from console.site.cli import metrics
from console.text.catalogue import load
from drivers.link.address import TcpAddress
from tests.fuzz.of_feed import FORGED, sound_states
from tests.preloaded import Preloaded
from tests.system.site.test_mtconnect import Agent

pytestmark = [pytest.mark.system, pytest.mark.timeout(120)]

TIMEOUT_S = 20.0
SOUND = replace(sound_states()[1], machine="lee-2001-lathe", simulated=True)
NEXT = "next\nlathe"
"""A job whose name would begin a line."""


def forged_lines() -> Iterator[bytes]:
    """Yield lines that are no state, in turn: each value of a state replaced, nonsense, and no JSON."""
    table = json.loads(line_of(asdict(SOUND)))
    spoilt = [{**table, name: {"forged": True}} for name in table]
    odd = [
        {**table, "axes": {**table["axes"], "spindle_deg": value}} for value in FORGED if isinstance(value, str)
    ]
    yield from cycle([*(json.dumps(each).encode() + b"\n" for each in (*spoilt, *odd)), b"\xff\n", b"{}\n"])


@contextmanager
def publishing(data: Path, state: FeedState, *, broken: bool) -> Iterator[Callable[[FeedState], None]]:
    """Publish a state ten times a second to whoever connects, or what is none; yield what changes it."""
    newest, over = [state], threading.Event()

    def serve(link: socket.socket) -> None:
        forged = forged_lines()
        with link, suppress(OSError):
            while not over.wait(0.1):
                link.sendall(next(forged) if broken else line_of(asdict(newest[0])))

    def accept(listening: socket.socket) -> None:
        with suppress(OSError):
            while True:
                threading.Thread(target=serve, args=(listening.accept()[0],), daemon=True).start()

    with ExitStack() as opened:
        listening = claim_place(data, opened)
        listening.listen()
        opened.callback(over.set)
        threading.Thread(target=accept, args=(listening,), daemon=True).start()
        yield lambda fresh: newest.__setitem__(0, fresh)


@contextmanager
def reading(data: Path, *words: str) -> Iterator[Preloaded]:
    """Run a command that reads feeds; its warnings go to a file in the data folder."""
    command = [sys.executable, "-m", "console", *words, "--data", str(data)]
    with (data / "said").open("w") as said:
        with Preloaded(command, stdout=subprocess.PIPE, stderr=said, text=True) as process:
            try:
                yield process
                assert process.poll() is None, (data / "said").read_text()
            finally:
                process.kill()
    told = (data / "said").read_text()
    assert told.count("sent no state of schema 1") == 1, told
    assert "Traceback" not in told and "internal" not in told


def until(process: Preloaded, word: str) -> str:
    assert process.stdout is not None
    return next(line for line in process.stdout if word in line)


@pytest.fixture
def fed(tmp_path: Path) -> Iterator[tuple[Path, Callable[[FeedState], None]]]:
    with publishing(tmp_path, SOUND, broken=True), publishing(tmp_path, SOUND, broken=False) as show:
        yield tmp_path, show


def test_watch_goes_on_and_no_text_makes_a_line(fed: tuple[Path, Callable[[FeedState], None]]) -> None:
    data, show = fed
    with reading(data, "watch", "--rate", "10") as process:
        until(process, "ring")
        show(replace(SOUND, job=NEXT, parts=5))
        assert r"next\nlathe" in until(process, "parts 5")


def test_mtconnect_goes_on(fed: tuple[Path, Callable[[FeedState], None]]) -> None:
    data, show = fed
    with reading(data, "mtconnect", "--listen", "127.0.0.1:0", "--json", "--sim") as process:
        agent = Agent(json.loads(until(process, "listening"))["listening"])
        agent.until("part_count", str(SOUND.parts))
        show(replace(SOUND, job=NEXT, parts=5))
        agent.until("part_count", "5")
        agent.close()


def scraped(port: int) -> str:
    connection = HTTPConnection("127.0.0.1", port, timeout=TIMEOUT_S)
    connection.request("GET", "/metrics")
    answer = connection.getresponse()
    assert answer.status == 200
    return answer.read().decode()


def test_metrics_of_other_consoles_go_on(fed: tuple[Path, Callable[[FeedState], None]]) -> None:
    data, show = fed
    with reading(data, "metrics", "--listen", "127.0.0.1:0") as process:
        port = int(until(process, "listening").rpartition(":")[2].partition("/")[0])
        show(replace(SOUND, job=NEXT, parts=5))
        until_s = time.monotonic() + TIMEOUT_S
        while "} 5.0\n" not in (found := scraped(port)):
            assert time.monotonic() < until_s, found
        assert r'job="next\\nlathe"' in found and "trilobe_consoles 1.0" in found


def test_a_slow_or_endless_client_of_metrics_holds_up_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(metrics, "CLIENT_S", 1.0)
    here = TcpAddress(host="127.0.0.1", port=0)
    server = metrics._server(here, lambda head: metrics.response(head, (), [], load("en")))
    port = int(server.start(here).rpartition(":")[2])
    try:
        began_s = time.monotonic()
        slow = [socket.create_connection(("127.0.0.1", port), TIMEOUT_S) for _ in range(4)]
        for each in slow:
            each.sendall(b"G")
        for _ in range(3):
            assert "trilobe_consoles 0.0" in scraped(port)
        assert time.monotonic() - began_s < 0.9, "one after the other they would take 4 s"
        with pytest.raises(ConnectionError):
            for _ in range(10_000):
                slow[0].sendall(b"x" * metrics.LONGEST_HEAD)
        for each in slow[1:]:
            with suppress(ConnectionError):  # it was dropped meanwhile
                each.sendall(b"E")  # a byte now and then is no request, either
                assert each.recv(1) == b""
        for each in slow:
            each.close()
    finally:
        server.close()


def test_a_line_with_the_name_of_another_machine_takes_nobody_away(tmp_path: Path) -> None:
    codes: list[str] = []
    with publishing(tmp_path, SOUND, broken=False) as publish:
        wanted = Follower(
            tmp_path,
            10.0,
            lambda state: state.machine == SOUND.machine,
            lambda problem: codes.append(problem.code),
        )
        assert [heard.state.machine for heard in wanted.settle()] == [SOUND.machine]
        publish(replace(SOUND, machine="another"))
        while not codes:
            wanted.wait(0.1)
        publish(replace(SOUND, activity="homing"))
        until_s = time.monotonic() + TIMEOUT_S
        while (
            all(heard.state.activity != "homing" for heard in wanted.newest_states())
            and time.monotonic() < until_s
        ):
            wanted.wait(0.1)
        assert [heard.state.activity for heard in wanted.newest_states()] == ["homing"]
        wanted.close()
    assert codes == ["feed.not_one"]


@pytest.mark.parametrize("command", ["metrics", "mtconnect"])
def test_an_address_that_other_computers_reach_is_warned_about(command: str, tmp_path: Path) -> None:
    words = [sys.executable, "-m", "console", command, "--listen", "0.0.0.0:0", "--data", str(tmp_path)]
    with Preloaded(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert "0.0.0.0" in (line := process.stderr.readline()) and "open to other computers" in line
        process.kill()


def test_who_scrapes_names_this_computer(monkeypatch: pytest.MonkeyPatch) -> None:
    def status(host: str, *hosts: str) -> bytes:
        head = f"GET /metrics HTTP/1.1\r\nHost: {host}\r\n\r\n".encode()
        return metrics.response(head, hosts, [], load("en")).split(b" ", 2)[1]

    numbers = [status(each, metrics.NUMBERS) for each in ("192.168.7.3:9301", "[fe80::1]:9301", "localhost")]
    assert numbers == [b"200"] * 3
    assert status("lathe-3:9301", metrics.NUMBERS) == b"421"
    assert (status("lathe-3:9301"), status("lathe-3:9301", "lathe-3")) == (b"421", b"200")
