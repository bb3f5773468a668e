"""Publishes the state of one machine to a broker of MQTT: retained, with a last will, reconnecting by itself.

The thread of paho connects, and waits longer after each failure. Nobody waits for the broker: what it did not take
is not queued for ever; after a new connection it gets everything anew.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from console.session.errors import SessionError
from console.session.exchange.broker import Broker
from console.session.exchange.data_items import UNAVAILABLE, Published
from console.session.exchange.topics import AVAILABILITY, STATE, is_news, messages
from console.session.feed.feed_state import FeedState
from profiles.files import printable
from profiles.problem import Problem

if TYPE_CHECKING:
    from paho.mqtt.client import Client

KEEP_ALIVE_S = 20  # the broker sends the will after one and a half of it
LEAST_DELAY_S, MOST_DELAY_S = 1, 60  # between two tries to connect; doubled after each
MOST_QUEUED = 200  # messages that wait for a broker that does not take them
LEAVE_S = 2.0
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
        self._newest: tuple[Published, FeedState | None] | None = None
        self._state: FeedState | None = None
        self._connected, self._left = False, threading.Event()
        self._broker = broker
        self._client = _client(broker)
        self._client.will_set(topic + AVAILABILITY, UNAVAILABLE, AT_LEAST_ONCE, retain=True)
        self._client.on_connect = self._on_connect
        self._client.on_disconnect = self._on_disconnect
        self._client.on_connect_fail = self._on_connect_fail

    def start(self) -> None:
        """Begin to connect; returns at once, whether there is a broker or not. Raises OSError."""
        self._client.connect_async(self._broker.host, self._broker.port, KEEP_ALIVE_S)
        self._client.loop_start()

    def show(self, published: Published, state: FeedState | None) -> None:
        """Publish what has changed; returns at once."""
        with self._lock:
            self._newest = published, state
            if self._connected:
                self._publish()

    def close(self) -> None:
        """Say that nothing is published any more, and leave."""
        with self._lock:
            was, self._connected = self._connected, False
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
            if self._told.get(key) == payload or (key in self._told and key == STATE and not self._is_news(state)):
                continue
            if self._client.publish(self._topic + key, payload, AT_LEAST_ONCE, retain=True).rc != 0:
                return
            self._told[key] = payload
            if key == STATE:
                self._state = state

    def _is_news(self, state: FeedState | None) -> bool:
        return is_news(state, self._state)

    def _on_connect(self, client: Client, data: Any, flags: Any, reason: Any, properties: Any) -> None:
        if reason.is_failure:
            self._tell(False, str(reason))
            return
        with self._lock:
            self._told, self._connected = {}, True
            self._publish()
        self._tell(True, "")

    def _on_disconnect(self, client: Client, data: Any, flags: Any, reason: Any, properties: Any) -> None:
        with self._lock:
            was, self._connected = self._connected, False
        self._left.set()
        if was:
            self._tell(False, str(reason))

    def _on_connect_fail(self, client: Client, data: Any) -> None:
        error = sys.exception()  # paho calls this where it has caught it
        reason = getattr(error, "strerror", None) or str(error or "")
        self._tell(False, printable(reason))


def _client(broker: Broker) -> Client:
    try:
        from paho.mqtt.client import Client, MQTTv311
        from paho.mqtt.enums import CallbackAPIVersion
    except ImportError as error:
        raise SessionError(Problem(code="mqtt.not_installed")) from error
    client = Client(CallbackAPIVersion.VERSION2, protocol=MQTTv311)
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
