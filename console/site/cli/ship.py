"""`console ship`: what is recorded at this lathe, sent to the PostgreSQL database of the shop."""

from __future__ import annotations

from argparse import Namespace

from console.cli.arguments import number, number_parser_within
from console.cli.parser import Parser
from console.text.catalogue import Catalogue

LEAST_S, MOST_S, PERIOD_S = 1.0, 3600.0, 5.0


def add(parser: Parser, text: Catalogue) -> None:
    """Add the database, and what to do there."""
    parser.add_argument("--shop", metavar="DSN", default="", help=text("help.shop"))
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--once", action="store_true", help=text("help.ship.once"))
    how.add_argument("--migrate", action="store_true", help=text("help.ship.migrate"))
    how.add_argument("--again", action="store_true", help=text("help.ship.again"))
    every = number_parser_within(number, LEAST_S, MOST_S, "usage.ship_every", f"{LEAST_S:g} - {MOST_S:g}")
    parser.add_argument("--every", metavar="S", type=every, default=PERIOD_S, help=text("help.ship.every"))


def main(options: Namespace, text: Catalogue) -> int:
    """Send once, or until the user ends it; or bring the database to the schema of this console."""
    from console.site.cli.ship_report import follow_on, migrate_shop, ship_once

    if options.migrate:
        migrate_shop(options, text)
    elif options.once or options.again:
        ship_once(options, text)
    else:
        follow_on(options, text)
    return 0
