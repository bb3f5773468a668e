"""Publishes the state of one machine to a broker of MQTT: retained, with a last will, reconnecting by itself.

The thread of paho connects, and waits longer after each failure. Nobody waits for the broker: what it did not take
is not queued for ever; after a new connection it gets everything anew.
"""

from __future__ import annotations

import os
import stat
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from console.session.errors import SessionError
from console.session.feed.feed_state import FeedState
from console.site.exchange.mtconnect import AVAILABILITY, STATE, UNAVAILABLE, PublishedState, is_news, messages
from profiles.files import printable
from profiles.problem import Problem

if TYPE_CHECKING:
    from paho.mqtt.client import Client

KEEP_ALIVE_S = 20  # the broker sends the will after one and a half of it
LEAST_DELAY_S, MOST_DELAY_S = 1, 60  # between two tries to connect; doubled after each
MOST_QUEUED = 200  # messages that wait for a broker that does not take them
LEAVE_S = 2.0
ANSWER_S = 10.0  # a broker that has not answered by then is told; its connection is given up after KEEP_ALIVE_S
MOST_BYTES = 1024  # of a packet of a broker, which has nothing to send to who subscribes to nothing
NO_ANSWER, CLOSED = "no answer", "closed"
"""What `Tell` is told where a port takes the connection and never answers as a broker, or closes it before."""
AT_LEAST_ONCE = 1

Tell = Callable[[bool, str], None]
"""Is called in the thread of paho: whether it is connected, and why not."""


class Publisher:
    """Publishes what was given to `show` last, below `topic`."""

    def __init__(self, broker: Broker, topic: str, tell: Tell) -> None:
        """Raises SessionError: `mqtt.not_installed`, `mqtt.ca`."""
        self._topic, self._tell = topic, tell
        self._lock = threading.Lock()
        self._told: dict[str, bytes] = {}
        self._newest: tuple[PublishedState, FeedState | None] | None = None
        self._state: FeedState | None = None
        self._connected, self._closing, self._left = False, False, threading.Event()
        self._reason, self._answer = "", threading.Timer(0.0, self._no_answer)
        self._broker = broker
        self._client = _client(broker, self._refuse_packet)
        self._client.will_set(topic + AVAILABILITY, UNAVAILABLE, AT_LEAST_ONCE, retain=True)
        self._client.on_connect = self._on_connect
        self._client.on_disconnect = self._on_disconnect
        self._client.on_connect_fail = self._on_connect_fail
        self._client.on_pre_connect = self._on_pre_connect

    def start(self) -> None:
        """Begin to connect; returns at once, whether there is a broker or not. Raises OSError."""
        self._client.connect_async(self._broker.host, self._broker.port, KEEP_ALIVE_S)
        self._client.loop_start()

    def show(self, published: PublishedState, state: FeedState | None) -> None:
        """Publish what has changed; returns at once."""
        with self._lock:
            self._newest = published, state
            if self._connected:
                self._publish()

    def close(self) -> None:
        """Say that nothing is published any more, and leave."""
        with self._lock:
            was, self._connected = self._connected, False
        self._closing = True
        self._answer.cancel()
        if was:
            gone = self._client.publish(self._topic + AVAILABILITY, UNAVAILABLE, AT_LEAST_ONCE, retain=True)
            with suppress(ValueError, RuntimeError):  # the connection has gone meanwhile: the will says the same
                gone.wait_for_publish(LEAVE_S)
        self._client.disconnect()
        if was:
            self._left.wait(
                LEAVE_S
            )  # the thread of paho is a daemon: a broker that does not answer holds up nobody

    def _publish(self) -> None:
        """Send what the broker does not have yet. What cannot be queued is sent with the next change."""
        if self._newest is None:
            return
        published, state = self._newest
        for key, payload in messages(published, state).items():
            if self._told.get(key) == payload or (
                key in self._told and key == STATE and not is_news(state, self._state)
            ):
                continue
            if self._client.publish(self._topic + key, payload, AT_LEAST_ONCE, retain=True).rc != 0:
                return
            self._told[key] = payload
            if key == STATE:
                self._state = state

    def _on_pre_connect(self, client: Client, data: Any) -> None:
        self._answer.cancel()
        self._reason, self._answer = NO_ANSWER, threading.Timer(ANSWER_S, self._no_answer)
        self._answer.daemon = True
        self._answer.start()

    def _no_answer(self) -> None:
        self._tell(False, NO_ANSWER)

    def _refuse_packet(self, size: int) -> None:
        self._reason = f"a packet of {size} bytes, allowed <= {MOST_BYTES}"

    def _on_connect(self, client: Client, data: Any, flags: Any, reason: Any, properties: Any) -> None:
        self._answer.cancel()
        self._reason = ""
        if reason.is_failure:
            self._reason = str(reason)
            self._tell(False, self._reason)
            return
        with self._lock:
            self._told, self._connected = {}, True
            self._publish()
        self._tell(True, "")

    def _on_disconnect(self, client: Client, data: Any, flags: Any, reason: Any, properties: Any) -> None:
        with self._lock:
            self._connected = False
        if self._reason == NO_ANSWER and not self._answer.finished.is_set():
            self._reason = CLOSED
        self._answer.cancel()
        if not self._closing:
            self._tell(False, self._reason or str(reason))
        self._left.set()

    def _on_connect_fail(self, client: Client, data: Any) -> None:
        late = self._answer.finished.is_set()  # and told already
        self._answer.cancel()
        error = sys.exception()  # paho calls this where it has caught it
        reason = getattr(error, "strerror", None) or str(error or "")
        self._tell(False, NO_ANSWER if late else printable(reason))


def _client(broker: Broker, refuse_packet: Callable[[int], object]) -> Client:
    """Return a client that closes the connection where a packet is announced that is larger than allowed."""
    try:
        from paho.mqtt.client import Client, MQTTv311
        from paho.mqtt.enums import CallbackAPIVersion
    except ImportError as error:
        raise SessionError(Problem(code="mqtt.not_installed")) from error

    class Bounded(Client):
        def _sock_recv(self, bufsize: int) -> bytes:  # of a packet: as many bytes as are missing
            if bufsize > MOST_BYTES:
                refuse_packet(bufsize)
                raise ConnectionError
            return super()._sock_recv(bufsize)

    client = Bounded(CallbackAPIVersion.VERSION2, protocol=MQTTv311)
    client.max_queued_messages_set(MOST_QUEUED)
    client.reconnect_delay_set(LEAST_DELAY_S, MOST_DELAY_S)
    if broker.tls:
        _use_tls(client, broker.ca)
    if broker.user is not None:
        client.username_pw_set(broker.user, broker.password)
    return client


def _use_tls(client: Client, ca: Path | None) -> None:
    try:
        client.tls_set(None if ca is None else str(ca))
    except OSError as error:  # an SSLError is one: no certificates in the file
        value = error.strerror or str(error)
        raise SessionError(Problem(code="mqtt.ca", where=printable(str(ca)), value=value)) from error


USER, PASSWORD = "TRILOBE_MQTT_USER", "TRILOBE_MQTT_PASSWORD"
PORT, TLS_PORT = 1883, 8883
LONGEST_FILE = 4096
OF_OTHERS = stat.S_IRWXG | stat.S_IRWXO


@dataclass(frozen=True, slots=True, kw_only=True)
class Broker:
    """A broker; the password is in no text of it. `ca` are the certificates that it is checked with.

    With `tls` and without `ca` those of the system count.
    """

    host: str
    port: int
    tls: bool = False
    ca: Path | None = None
    user: str | None = None
    password: str | None = field(default=None, repr=False)

    def __str__(self) -> str:
        return f"{'mqtts' if self.tls else 'mqtt'}://{self.host}:{self.port}"


def credentials(environment: Mapping[str, str], file: Path | None) -> tuple[str | None, str | None]:
    """Return user and password: the two lines of a file, else the variables; None where there are none.

    Raises SessionError: `mqtt.credentials`, the file cannot be read; `mqtt.credentials_open`, other accounts can;
    `mqtt.credentials_form`, it has no two lines.
    """
    if file is None:
        return environment.get(USER) or None, environment.get(PASSWORD) or None
    where = printable(str(file))
    try:
        with file.open("rb") as opened:
            if os.fstat(opened.fileno()).st_mode & OF_OTHERS:
                raise SessionError(Problem(code="mqtt.credentials_open", where=where))
            lines = opened.read(LONGEST_FILE).decode("utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        value = error.strerror or str(error) if isinstance(error, OSError) else "UTF-8"
        raise SessionError(Problem(code="mqtt.credentials", where=where, value=value)) from None
    if len(lines) != 2 or not all(lines):
        raise SessionError(Problem(code="mqtt.credentials_form", where=where))
    return lines[0], lines[1]
