"""`console mqtt`: the state of a machine for a broker of MQTT."""

from __future__ import annotations

import json
import os
import sys
from argparse import ArgumentTypeError, Namespace
from datetime import datetime
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from console.cli.arguments import add_shared, host_port
from console.cli.library import data_of
from console.cli.parser import Parser
from console.site.cli.followed_machine import add_rate, changes_of, follow_machine, log, machine_name
from console.text.catalogue import Catalogue
from drivers.simulator.hosts.control_address import is_loopback

if TYPE_CHECKING:
    from console.site.exchange.publisher import Broker

PREFIX = "trilobe"


def add(parser: Parser, text: Catalogue) -> None:
    """Add the broker, how it is reached, and the machine."""
    parser.add_argument(
        "--broker", metavar="HOST[:PORT]", type=_host_and_port, required=True, help=text("help.mqtt_broker")
    )
    parser.add_argument("--tls", action="store_true", help=text("help.mqtt_tls"))
    parser.add_argument("--ca", metavar="FILE", type=Path, help=text("help.mqtt_ca"))
    parser.add_argument("--credentials", metavar="FILE", type=Path, help=text("help.mqtt_credentials"))
    topic_help = text("help.mqtt_topic", default=PREFIX)
    parser.add_argument("--topic", metavar="TOPIC", type=_topic, default=PREFIX, help=topic_help)
    add_shared(parser, text, "machine", command="mqtt")
    add_shared(parser, text, "sim", command="mtconnect")
    add_rate(parser, text)


def main(options: Namespace, text: Catalogue) -> int:
    """Publish until the user ends it."""
    from console.site.exchange.mtconnect import device_name, topic_of
    from console.site.exchange.publisher import Publisher

    data_of(options)  # refuses a folder that this account may not read
    broker = _broker(options)
    if broker.password is not None and not broker.tls and not is_loopback(broker.host):
        print(f"console: {text('warning')}: {text('mqtt.in_the_clear')}", file=sys.stderr)
    machine = machine_name(options)
    topic = topic_of(options.topic, device_name(machine, bool(options.sim)))
    publisher = Publisher(broker, topic, _ConnectionReporter(broker, topic, options, text))
    try:
        publisher.start()
        with follow_machine(machine, options, text) as follower:
            for published, state in changes_of(follower, machine, options, text):
                publisher.show(published, state)
    except KeyboardInterrupt:  # the usual way to end it
        pass
    finally:
        publisher.close()
    return 0


class _ConnectionReporter:
    """Says when the connection comes and goes; of tries that fail for one reason only the first."""

    def __init__(self, broker: Broker, topic: str, options: Namespace, text: Catalogue) -> None:
        self._broker, self._topic, self._text = broker, topic, text
        self._options, self._json = options, bool(options.json)
        self._last: tuple[bool, str] | None = None
        self._lock = Lock()

    def __call__(self, connected: bool, reason: str) -> None:
        from console.site.exchange.publisher import CLOSED, NO_ANSWER

        with self._lock:
            if (connected, reason) == self._last:
                return
            self._last = connected, reason
        log(self._options, f"{self._broker} {'connected' if connected else f'not connected: {reason}'}")
        if self._json:
            told = {"schema": 1, "broker": str(self._broker), "topic": self._topic, "connected": connected}
            print(json.dumps({**told, "reason": reason or None}), flush=True)
            return
        key = {NO_ANSWER: "mqtt.no_answer", CLOSED: "mqtt.closed"}.get(reason)
        reason = self._text(key) if key else reason
        key = "mqtt.connected" if connected else "mqtt.not_connected"
        line = self._text(
            key, broker=self._broker, topic=self._topic, reason=f" ({self._text.words(reason)})" if reason else ""
        )
        print(f"{datetime.now():%H:%M:%S}  {line}", flush=True)


def _broker(options: Namespace) -> Broker:
    from console.site.exchange.publisher import PORT, TLS_PORT, Broker, credentials

    tls = bool(options.tls or options.ca)
    host, port = options.broker
    user, password = credentials(os.environ, options.credentials)
    return Broker(
        host=host, port=port or (TLS_PORT if tls else PORT), tls=tls, ca=options.ca, user=user, password=password
    )


def _host_and_port(word: str) -> tuple[str, int | None]:
    """Parse HOST or HOST:PORT; a broker without a port has the usual one."""
    if ":" in word.rpartition("]")[2]:
        address = host_port(word)
        if address.port == 0:
            raise ArgumentTypeError(Parser.text("usage.mqtt_port", value=word))
        return address.host, address.port
    return host_port(f"{word}:0").host, None


def _topic(word: str) -> str:
    """Parse the first levels of the topics: no wildcard, no empty level."""
    if not all(word.split("/")) or set(word) & set("+#\0") or word.startswith("$"):
        raise ArgumentTypeError(Parser.text("usage.mqtt_topic", value=word))
    return word
