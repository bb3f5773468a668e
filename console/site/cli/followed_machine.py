"""What commands share that publish the state of one machine: which it is, how often, when it comes and goes."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from typing import TYPE_CHECKING

from console.cli.arguments import number, number_parser_within
from console.cli.library import data_of, profile_of
from console.cli.output import tell
from console.cli.parser import Parser
from console.session.feed.request import LEAST_HZ, MOST_HZ
from console.text.catalogue import Catalogue
from drivers.simulator.hosts.control_address import is_loopback

if TYPE_CHECKING:
    from console.session.feed.feed_state import FeedState
    from console.session.feed.following import Follower
    from console.site.exchange.mtconnect import PublishedState

DEFAULT_HZ = 5.0
WAIT_S = 0.5  # for something new; a console that was killed is noticed at once


def add_rate(parser: Parser, text: Catalogue) -> None:
    """Add how often the state is read."""
    rate = number_parser_within(number, LEAST_HZ, MOST_HZ, "usage.watch_rate", f"{LEAST_HZ:g} - {MOST_HZ:g}")
    rate_help = text("help.exchange_rate", default=f"{DEFAULT_HZ:g}")
    parser.add_argument("--rate", metavar="HZ", type=rate, default=DEFAULT_HZ, help=rate_help)


def machine_name(options: Namespace) -> str:
    """Return the name of the machine whose state is published: that in its profile, by which consoles call it."""
    return profile_of(options).machine.name


def warn_open(host: str, bound: str, text: Catalogue) -> None:
    """Warn of an address that other computers reach: neither SHDR nor the metrics know a password."""
    if not is_loopback(host):
        print(f"console: {text('warning')}: {text('exchange.open', address=bound)}", file=sys.stderr)


@contextmanager
def follow_machine(machine: str, options: Namespace, text: Catalogue) -> Iterator[Follower]:
    """Yield who follows the consoles of the machine; what is wrong with one is a warning."""
    from console.session.feed.following import Follower

    follower = Follower(
        data_of(options),
        options.rate,
        lambda state: (state.machine, state.simulated) == (machine, bool(options.sim)),
        lambda problem: tell([problem], text),
    )
    try:
        yield follower
    finally:
        follower.close()


def changes_of(
    follower: Follower, machine: str, options: Namespace, text: Catalogue
) -> Iterator[tuple[PublishedState, FeedState | None]]:
    """Yield what is to be published, with its state, again and again; say when consoles come and are gone."""
    from console.session.data.kept_files import utc_now
    from console.site.exchange.mtconnect import publish_state

    shown, last = publish_state(None, utc_now()), None
    yield shown, None
    while True:
        heard = follower.wait(WAIT_S)
        if heard is last:
            continue
        before, last = shown, heard
        # Without a state the last console has gone.
        shown = publish_state(None, utc_now()) if heard is None else publish_state(heard.state, "")
        if (shown.conditions is None) != (before.conditions is None):
            _say(shown, machine, options, text)
        yield shown, None if heard is None else heard.state


def log(options: Namespace, text: str) -> None:
    """Add a line to the log of the program."""
    from console.session.program_log import note

    note(data_of(options), f"{options.command}  {text}")


def _say(shown: PublishedState, machine: str, options: Namespace, text: Catalogue) -> None:
    running = shown.conditions is not None
    log(options, f"{machine}: {'a console publishes' if running else 'no console publishes'}")
    if options.json:
        print(json.dumps({"schema": 1, "at_utc": shown.at_utc, "console": running}))
    else:
        word = text("exchange.found" if running else "exchange.gone")
        print(f"{datetime.now():%H:%M:%S}  {machine}  {word}")
    sys.stdout.flush()
