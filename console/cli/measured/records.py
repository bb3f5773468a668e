"""`console records`: list recorded runs, show one in full, export them; of this lathe, or of the shop."""

from __future__ import annotations

import argparse
import sys
from argparse import Namespace
from collections.abc import Callable
from datetime import datetime, timedelta
from importlib import import_module

from console.cli.arguments import WRONG_USAGE, number_parser_within, whole_number
from console.cli.commands import add_actions
from console.cli.parser import Parser
from console.rings import is_installed
from console.text.catalogue import Catalogue

ACTIONS = ("list", "show", "debrief", "export")
SHOWN, MOST_SHOWN = 20, 100_000
SHOP = "console.site.cli.shop_records"


def add(parser: Parser, text: Catalogue) -> None:
    """Add the actions, each with its arguments."""
    actions = add_actions(parser, "records", ACTIONS, text)
    for name in ("show", "debrief"):
        actions[name].add_argument("run", metavar="RUN", help=text("help.records.run"))
    actions["export"].add_argument("folder", metavar="FOLDER", help=text("help.records.folder"))
    for name in ("list", "export"):
        action = actions[name]
        action.add_argument("--job", metavar="NAME", help=text("help.records.job"))
        # Not the machine that a configuration names: without the option, the runs on all of them.
        of_machine = text("help.records.machine")
        action.add_argument("--machine", metavar="NAME", dest="of_machine", help=of_machine)
        action.add_argument("--since", metavar="DATE", type=_date, help=text("help.records.since"))
        action.add_argument("--until", metavar="DATE", type=_end_of, help=text("help.records.until"))
        action.add_argument("--failed", action="store_true", help=text("help.records.failed"))
    for action in actions.values() if is_installed(SHOP) else ():
        action.add_argument("--shop", metavar="DSN", help=text("help.records.shop"))
        action.add_argument("--lathe", metavar="NAME", help=text("help.records.lathe"))
    limit = number_parser_within(whole_number, 1, MOST_SHOWN, "usage.records_limit", MOST_SHOWN)
    shown = text("help.records.limit", default=SHOWN)
    actions["list"].add_argument("--limit", metavar="N", type=limit, default=SHOWN, help=shown)
    exported = text("help.records.export_limit")
    actions["export"].add_argument("--limit", metavar="N", type=limit, default=MOST_SHOWN, help=exported)
    for name in ("traces", "telemetry"):
        actions["export"].add_argument(f"--{name}", action="store_true", help=text(f"help.records.{name}"))


def main(options: Namespace, text: Catalogue) -> int:
    """List, show, debrief or export what is recorded; nothing is changed."""
    from console.cli.measured.records_export import export
    from console.cli.measured.records_report import debrief_run, list_runs, show_run

    acts: dict[str, Callable[[Namespace, Catalogue], None]] = {
        "list": list_runs,
        "show": show_run,
        "debrief": debrief_run,
        "export": export,
    }
    act, options.lathes = acts[options.action], {}
    if getattr(options, "shop", None) is not None:
        with import_module(SHOP).shop_records(options):
            act(options, text)
        return 0
    if getattr(options, "lathe", None) is not None:
        print(f"console records: {text('usage.lathe_without_shop')}", file=sys.stderr)
        return WRONG_USAGE
    act(options, text)
    return 0


def _date(word: str) -> datetime:
    """Parse a date, or a date and time; local where it names no zone."""
    try:
        return datetime.fromisoformat(word).astimezone()
    except (ValueError, OverflowError):
        raise argparse.ArgumentTypeError(Parser.text("usage.records_date", value=word)) from None


def _end_of(word: str) -> datetime:
    """Parse the same as an end that is not included; a date alone includes its day."""
    found = _date(word)
    return found + timedelta(days=1) if len(word) <= len("2026-01-01") else found
