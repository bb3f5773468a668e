"""What commands share that publish the state of one machine: which it is, how often, when it comes and goes."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from ipaddress import ip_address
from typing import TYPE_CHECKING

from console.cli.arguments import number, within
from console.cli.library import DEFAULT_MACHINE, data_of
from console.cli.output import tell
from console.cli.parser import Parser
from console.session.feed.request import LEAST_HZ, MOST_HZ
from console.text.catalogue import Catalogue

if TYPE_CHECKING:
    from console.session.exchange.data_items import Published
    from console.session.exchange.following import Follower

DEFAULT_HZ = 5.0
WAIT_S = 0.5  # for something new; a console that was killed is noticed at once


def add_rate(parser: Parser, text: Catalogue) -> None:
    """Add how often the state is read."""
    rate = within(number, LEAST_HZ, MOST_HZ, "usage.watch_rate", f"{LEAST_HZ:g} - {MOST_HZ:g}")
    rate_help = text("help.exchange_rate", default=f"{DEFAULT_HZ:g}")
    parser.add_argument("--rate", metavar="HZ", type=rate, default=DEFAULT_HZ, help=rate_help)


def machine_name(options: Namespace) -> str:
    """Return the name of the machine whose state is published."""
    name: str = options.machine or DEFAULT_MACHINE
    return name


def is_loopback(host: str) -> bool:
    """Whether only this computer reaches an address."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


@contextmanager
def followed(options: Namespace, text: Catalogue) -> Iterator[Follower]:
    """Yield who follows the consoles of the machine; what is wrong with one is a warning."""
    from console.session.exchange.following import Follower

    follower = Follower(
        data_of(options),
        options.rate,
        machine_name(options),
        bool(options.sim),
        lambda problem: tell([problem], text),
    )
    try:
        yield follower
    finally:
        follower.close()


def changes_of(follower: Follower, options: Namespace, text: Catalogue) -> Iterator[Published]:
    """Yield what is to be published, again and again; say when a console comes and when the last one is gone."""
    from console.session.data.kept_files import utc_now
    from console.session.exchange.data_items import published

    shown = published(None, utc_now())
    yield shown
    while True:
        heard = follower.wait(WAIT_S)
        before, newest = shown, None if heard is None else heard.published
        if newest is not None:
            shown = newest
        elif before.conditions is not None:  # the last console has gone
            shown = published(None, utc_now())
        if shown is before:
            continue
        if (shown.conditions is None) != (before.conditions is None):
            _say(shown, options, text)
        yield shown


def _say(shown: Published, options: Namespace, text: Catalogue) -> None:
    running = shown.conditions is not None
    if options.json:
        print(json.dumps({"schema": 1, "at_utc": shown.at_utc, "console": running}))
    else:
        word = text("exchange.found" if running else "exchange.gone")
        print(f"{datetime.now():%H:%M:%S}  {machine_name(options)}  {word}")
    sys.stdout.flush()
