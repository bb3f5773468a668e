"""A real broker of MQTT, Mosquitto, on a port of its own; and a reader of it."""

from __future__ import annotations

import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import Empty, SimpleQueue

import pytest
from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion

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
