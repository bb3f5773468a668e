"""What `console ship` sends, for people and for JSON."""

from __future__ import annotations

import json
import sys
import time
from argparse import Namespace
from collections.abc import Callable
from datetime import datetime
from threading import Timer

from console.cli.library import data_of
from console.cli.output import show
from console.session.errors import require_extra
from console.site.shop.schema import migrate
from console.site.shop.shipping import SentRows, follow, ship
from console.text.catalogue import Catalogue
from profiles.files import printable
from profiles.problem import Problem

SAID_EACH_S = 2.0  # of a backlog that takes long
SLOW_S = 2.0  # without an answer of the database


def migrate_shop(options: Namespace, text: Catalogue) -> None:
    """Bring the database to the schema of this console, and print the steps that were made."""
    made = migrate(options.shop)
    show(
        options,
        lambda: {"migrations": [each.name for each in made]},
        lambda: [text("ship.migrated", name=each.name) for each in made] or [text("ship.migrated_nothing")],
    )


def ship_once(options: Namespace, text: Catalogue) -> None:
    """Send what is waiting, and print what that was."""
    slow = _slow(text)
    try:
        sent = ship(data_of(options), options.shop, again=options.again, told=_progress(text, slow))
    finally:
        slow.cancel()
    show(options, lambda: sent_fields(sent), lambda: [_sent_line(sent, text)])


def follow_on(options: Namespace, text: Catalogue) -> None:
    """Send until the user ends it; print a line for each pass that has sent anything, and of what is refused."""
    require_extra("psycopg", "shop")
    try:
        if not options.json:
            print(text("ship.following", seconds=f"{options.every:g}"))
        slow = _slow(text)
        told = _progress(text, slow)
        for found in follow(data_of(options), options.shop, period_s=options.every, told=told):
            slow.cancel()
            if isinstance(found, Problem):
                print(f"console: {text('warning')}: {_clock()}  {text.problem(found)}", file=sys.stderr)
            elif found.total and options.json:
                print(json.dumps(sent_fields(found)))
            elif found.total:
                print(f"{_clock()}  {_sent_line(found, text)}")
    except KeyboardInterrupt:  # the usual way to end it
        return


def _slow(text: Catalogue) -> Timer:
    """Begin to wait for the first sign of the database; without one it is said on stderr that it is waited for."""
    slow = Timer(SLOW_S, lambda: print(text("ship.waiting", seconds=f"{SLOW_S:g}"), file=sys.stderr, flush=True))
    slow.daemon = True
    slow.start()
    return slow


def _progress(text: Catalogue, slow: Timer) -> Callable[[SentRows], None]:
    """Return what says on stderr, now and then, how much of a backlog is left."""
    said_s = time.monotonic()

    def tell(sent: SentRows) -> None:
        nonlocal said_s
        slow.cancel()
        if sent.left and time.monotonic() - said_s >= SAID_EACH_S:
            said_s = time.monotonic()
            print(text("ship.progress", count=sent.total, left=sent.left), file=sys.stderr)

    return tell


def sent_fields(sent: SentRows) -> dict[str, object]:
    """Return what was sent, for JSON."""
    return {
        "lathe": sent.lathe.lathe_id,
        "name": sent.lathe.name,
        "rows": dict(sent.rows),
        "transactions": sent.transactions,
        "left": sent.left or 0,
        "recorded": sent.left is not None,
    }


def _sent_line(sent: SentRows, text: Catalogue) -> str:
    name = printable(sent.lathe.name)
    if sent.left is None:
        return text("ship.nothing_recorded", name=name)
    if not sent.total:
        return text("ship.nothing_new", name=name)
    kinds = (f"{text(f'ship.kind.{kind}')} {count}" for kind, count in sent.rows.items() if count)
    return text("ship.sent", name=name, count=sent.total, kinds=", ".join(kinds))


def _clock() -> str:
    return f"{datetime.now():%H:%M:%S}"
