"""`console mqtt` at a real broker: retained values, last will, a broker that goes and comes, TLS, passwords."""

from __future__ import annotations

import json
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

import pytest
from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion

from console.session.feed.observed_state import ObservedState
from console.session.feed.server import FeedServer
from console.session.station.state import Activity, StationState
from console.site.exchange import publisher
from console.site.exchange.mtconnect import ITEMS, device_name, topic_of
from console.site.exchange.publisher import CLOSED, NO_ANSWER, Broker, Publisher
from profiles.store import load_machine
from tests.preloaded import Preloaded, completed

pytestmark = [pytest.mark.system, pytest.mark.timeout(120)]


PROGRAM = shutil.which("mosquitto") or shutil.which("/usr/sbin/mosquitto")
TIMEOUT_S = 30.0

needs_mosquitto = pytest.mark.skipif(
    PROGRAM is None, reason="Mosquitto is not installed (Debian and Ubuntu: apt-get install mosquitto)"
)


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as found:
        port: int = found.getsockname()[1]
        return port


@contextmanager
def broker(folder: Path, port: int, *settings: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run a broker at a port of this computer until the end."""
    assert PROGRAM is not None
    configuration = folder / f"mosquitto-{port}.conf"
    lines = [
        f"listener {port} 127.0.0.1",
        "user root",
        "persistence false",
        *(settings or ["allow_anonymous true"]),
    ]
    configuration.write_text("\n".join(lines) + "\n")
    with subprocess.Popen([PROGRAM, "-c", str(configuration)], stderr=subprocess.DEVNULL) as process:
        try:
            _wait_for(port)
            yield process
        finally:
            process.kill()


def _wait_for(port: int) -> None:
    until_s = time.monotonic() + TIMEOUT_S
    while time.monotonic() < until_s:
        with suppress(OSError), socket.create_connection(("127.0.0.1", port), 1.0):
            return
        time.sleep(0.02)
    raise TimeoutError("the broker does not listen")


class Subscriber:
    """Reads everything below `trilobe/` from a broker; `kept` has the newest payload of each topic."""

    def __init__(self, port: int, prepare: Callable[[Client], object] = lambda client: None) -> None:
        self.kept: dict[str, bytes] = {}
        self.retained: set[str] = set()
        self._came: SimpleQueue[tuple[str, bytes, bool]] = SimpleQueue()
        self._client = Client(CallbackAPIVersion.VERSION2)
        prepare(self._client)
        self._client.on_message = lambda _, __, got: self._came.put((got.topic, bytes(got.payload), got.retain))
        self._client.on_connect = lambda client, *_: client.subscribe("trilobe/#", 1)
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()

    def until(self, topic: str, payload: bytes | Callable[[bytes], bool]) -> None:
        """Read until a topic has this payload, or one of this kind."""
        fits = payload if callable(payload) else payload.__eq__
        until_s = time.monotonic() + TIMEOUT_S
        while topic not in self.kept or not fits(self.kept[topic]):
            try:
                name, came, retained = self._came.get(timeout=max(0.01, until_s - time.monotonic()))
            except Empty:
                raise AssertionError(f"{topic} is {self.kept.get(topic)!r}, not {payload!r}") from None
            self.kept[name] = came
            if retained:
                self.retained.add(name)

    def close(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()


MACHINE = load_machine("lee-2001-lathe").machine
READY = StationState(activity=Activity.READY, machine=MACHINE.name)
TOPIC = "trilobe/lee-2001-lathe-SIM/"
PASSWORD = "hunter2-of-lathe-3"


class Shown:
    """Is observed by a feed; a test changes what it is."""

    def __init__(self) -> None:
        self.state, self.parts = READY, 0

    def observed(self) -> ObservedState:
        return ObservedState(state=self.state, machine=MACHINE, now_s=0.0, job="ring", parts=self.parts)


@contextmanager
def publishing(
    data: Path, port: int, *more: str, environment: dict[str, str] | None = None
) -> Iterator[subprocess.Popen[str]]:
    """Run `console mqtt`; its output is read through `told`."""
    words = ["mqtt", "--broker", f"127.0.0.1:{port}", "--sim", "--rate", "10", "--data", str(data), *more]
    command = [sys.executable, "-m", "console", *words]
    out = subprocess.PIPE
    with Preloaded(command, stdout=out, stderr=subprocess.STDOUT, text=True, env=environment) as process:
        try:
            yield process
        finally:
            process.kill()


def told(process: subprocess.Popen[str], word: str) -> str:
    """Read lines of the program until one has a word; return it."""
    assert process.stdout is not None
    for line in process.stdout:
        if word in line:
            return line
    raise AssertionError(f"the program has ended without {word!r}")


@pytest.fixture
def shown(tmp_path: Path) -> Iterator[Shown]:
    found = Shown()
    server = FeedServer(tmp_path, found.observed)
    server.launch()
    yield found
    server.close()


@needs_mosquitto
def test_who_subscribes_later_has_every_value_and_a_killed_publisher_is_unavailable(
    tmp_path: Path, shown: Shown
) -> None:
    port = free_port()
    with broker(tmp_path, port):
        with publishing(tmp_path, port) as process:
            assert TOPIC in told(process, "connected: mqtt://127.0.0.1")
            first = Subscriber(port)
            first.until(f"{TOPIC}avail", b"AVAILABLE")
            shown.parts = 3
            first.until(f"{TOPIC}state", lambda payload: json.loads(payload)["parts"] == 3)
            later = Subscriber(port)
            later.until(f"{TOPIC}part_count", b"3")
            later.until(f"{TOPIC}avail", b"AVAILABLE")
            later.until(f"{TOPIC}state", bool)
            keys = {item.key for item in ITEMS} | {"communications", "motion", "system", "state"}
            assert {topic.removeprefix(TOPIC) for topic in later.retained} == keys
            assert later.kept[f"{TOPIC}program"] == b"ring"
            state: dict[str, Any] = json.loads(later.kept[f"{TOPIC}state"])
            assert (state["schema"], state["parts"], state["simulated"]) == (1, 3, True)
            assert json.loads(later.kept[f"{TOPIC}system"]) == {"level": "NORMAL", "active": []}
            process.send_signal(signal.SIGKILL)
            later.until(f"{TOPIC}avail", b"UNAVAILABLE")  # the last will
            gone = Subscriber(port)
            gone.until(f"{TOPIC}avail", b"UNAVAILABLE")  # and it is retained
        with publishing(tmp_path, port):
            gone.until(f"{TOPIC}avail", b"AVAILABLE")
        for each in (first, later, gone):
            each.close()


@needs_mosquitto
def test_a_console_that_ends_is_unavailable_and_its_state_is_gone(tmp_path: Path) -> None:
    port, found = free_port(), Shown()
    with broker(tmp_path, port), publishing(tmp_path, port) as process:
        told(process, "connected")
        reader = Subscriber(port)
        reader.until(f"{TOPIC}avail", b"UNAVAILABLE")
        for _ in range(2):  # it comes back by itself
            server = FeedServer(tmp_path, found.observed)
            server.launch()
            reader.until(f"{TOPIC}avail", b"AVAILABLE")
            assert reader.kept[f"{TOPIC}state"]
            server.close()
            reader.until(f"{TOPIC}avail", b"UNAVAILABLE")
            reader.until(f"{TOPIC}state", b"")
            reader.until(f"{TOPIC}execution", b"UNAVAILABLE")
        reader.close()
        process.send_signal(signal.SIGINT)
        assert process.wait(20.0) == 0


@needs_mosquitto
def test_a_broker_that_goes_and_comes_gets_everything_anew(tmp_path: Path, shown: Shown) -> None:
    port = free_port()
    with publishing(tmp_path, port) as process:
        told(process, "not connected")  # there is no broker yet: it is no fault
        for parts in (1, 2):
            with broker(tmp_path, port):
                told(process, " connected: ")
                shown.parts = parts
                reader = Subscriber(port)
                reader.until(f"{TOPIC}part_count", str(parts).encode())
                reader.until(f"{TOPIC}program", b"ring")
                reader.close()
            told(process, "not connected")


def certificates(folder: Path) -> tuple[Path, Path, Path]:
    """A CA, and a certificate of 127.0.0.1 with its key."""
    openssl = shutil.which("openssl")
    if openssl is None:
        pytest.skip("openssl, which makes the certificates of this test, is not installed")
    ca, ca_key, key, request, made = (
        folder / name for name in ("ca.pem", "ca.key", "key.pem", "request.pem", "made.pem")
    )
    names = folder / "names.cnf"
    names.write_text("subjectAltName=IP:127.0.0.1\n")
    new_key = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    signed = ["-extfile", names, "-out", made]
    for words in (
        ["req", "-x509", *new_key, "-subj", "/CN=test CA", "-days", "2", "-keyout", ca_key, "-out", ca],
        ["req", *new_key, "-subj", "/CN=127.0.0.1", "-keyout", key, "-out", request],
        ["x509", "-req", "-in", request, "-CA", ca, "-CAkey", ca_key, "-CAcreateserial", "-days", "2", *signed],
    ):
        subprocess.run([openssl, *map(str, words)], check=True, capture_output=True)
    return ca, made, key


@needs_mosquitto
def test_tls_and_a_password_that_is_in_no_output(tmp_path: Path, shown: Shown) -> None:
    ca, certificate, key = certificates(tmp_path)
    passwords = tmp_path / "passwords"
    made = ["mosquitto_passwd", "-b", "-c", str(passwords), "lathe", PASSWORD]
    subprocess.run(made, check=True, capture_output=True)
    settings = [f"cafile {ca}", f"certfile {certificate}", f"keyfile {key}"]
    settings += ["allow_anonymous false", f"password_file {passwords}"]
    secret, port = tmp_path / "mqtt-secret", free_port()
    secret.touch(0o600)
    secret.write_text(f"lathe\n{PASSWORD}\n")
    with broker(tmp_path, port, *settings):
        said = []
        with publishing(tmp_path, port, "--ca", str(ca), "--credentials", str(secret)) as process:
            said.append(told(process, " connected: mqtts://"))

            def prepare(client: Any) -> None:
                client.tls_set(str(ca))
                client.username_pw_set("lathe", PASSWORD)

            reader = Subscriber(port, prepare)
            reader.until(f"{TOPIC}avail", b"AVAILABLE")
            reader.close()
            said.append(Path(f"/proc/{process.pid}/cmdline").read_text())
        secret.write_text(f"lathe\nwrong-{PASSWORD}\n")
        with publishing(tmp_path, port, "--ca", str(ca), "--credentials", str(secret)) as process:
            said.append(told(process, "not connected"))
            assert "authori" in said[-1].lower() or "user name or password" in said[-1].lower()
        with publishing(tmp_path, port, "--tls") as process:  # the system does not know this CA
            said.append(told(process, "not connected"))
            assert "certificate" in said[-1].lower()
    assert all(PASSWORD not in line for line in said)


@needs_mosquitto
def test_user_and_password_from_the_environment(tmp_path: Path, shown: Shown) -> None:
    passwords, port = tmp_path / "passwords", free_port()
    made = ["mosquitto_passwd", "-b", "-c", str(passwords), "lathe", PASSWORD]
    subprocess.run(made, check=True, capture_output=True)
    environment = {"PATH": "/usr/bin", "TRILOBE_MQTT_USER": "lathe", "TRILOBE_MQTT_PASSWORD": PASSWORD}
    with broker(tmp_path, port, "allow_anonymous false", f"password_file {passwords}"):
        with publishing(tmp_path, port, environment=environment) as process:
            told(process, " connected: ")


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["--broker", "nowhere:99999"], 2, "65535"),
        (["--broker", "nowhere:0"], 2, "port 0"),
        (["--broker", "127.0.0.1", "--topic", "a/#"], 2, "cannot begin a topic"),
        (["--broker", "127.0.0.1", "--credentials", "missing"], 1, "missing cannot be read"),
        (["--broker", "127.0.0.1", "--ca", "missing.pem"], 1, "missing.pem"),
        ([], 2, "--broker"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(words: list[str], code: int, said: str, tmp_path: Path) -> None:
    refused = completed(["mqtt", *words, "--data", str(tmp_path)], 30.0)
    assert (refused.returncode, refused.stdout, refused.stderr.count("\n")) == (code, "", 1)
    assert said in refused.stderr


def test_a_simulated_state_goes_to_topics_of_its_own() -> None:
    assert topic_of("trilobe", device_name("lathe-3", False)) == "trilobe/lathe-3/"
    assert topic_of("trilobe", device_name("lathe-3", True)) == "trilobe/lathe-3-SIM/"
    assert topic_of("trilobe", "a/b+#") == "trilobe/a%2Fb%2B%23/"


# A broker that closes, stays silent, or announces too much before it has answered: it is told, and bounded.


CONNACK = b"\x20\x02\0\0"  # MQTT 3.1.1, 3.2: accepted
LARGEST = b"\x30\xff\xff\xff\x7f"  # 2.2.3: a PUBLISH of 268 435 455 bytes, the largest that there is
TOLD_S = 20.0

Talk = Callable[[socket.socket], object]
Told = SimpleQueue[tuple[bool, str]]


@contextmanager
def published_to(talk: Talk) -> Iterator[Told]:
    """A publisher at a port where each connection is talked to like this; what it tells."""
    told: Told = SimpleQueue()
    taken: list[socket.socket] = []

    def serve(listening: socket.socket) -> None:
        with suppress(OSError):
            while True:
                taken.append(listening.accept()[0])
                with suppress(OSError):
                    talk(taken[-1])

    with socket.create_server(("127.0.0.1", 0)) as listening:
        threading.Thread(target=serve, args=(listening,), daemon=True).start()
        broker = Broker(host="127.0.0.1", port=listening.getsockname()[1])
        made = Publisher(broker, "trilobe/lathe/", lambda *each: told.put(each))
        made.start()
        try:
            yield told
        finally:
            made.close()
            for each in taken:
                each.close()


def close(connection: socket.socket) -> None:
    connection.recv(100)
    connection.close()


def flood(connection: socket.socket) -> None:
    connection.recv(100)
    connection.sendall(CONNACK + LARGEST)
    while True:
        connection.sendall(bytes(1_000_000))


def test_a_port_that_closes_before_it_answers_is_told() -> None:
    with published_to(close) as told:
        assert told.get(timeout=TOLD_S) == (False, CLOSED)


def test_a_port_that_says_nothing_is_told_long_before_it_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(publisher, "ANSWER_S", 0.05)
    with published_to(lambda connection: None) as told:
        assert told.get(timeout=TOLD_S / 2.0) == (False, NO_ANSWER)


def test_a_packet_that_is_too_large_ends_the_connection_and_is_not_kept() -> None:
    tracemalloc.start()
    try:
        with published_to(flood) as told:
            assert told.get(timeout=TOLD_S) == (True, "")
            connected, reason = told.get(timeout=TOLD_S)
            assert not connected and "268435455 bytes" in reason
        _, most_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most_bytes < 20e6
