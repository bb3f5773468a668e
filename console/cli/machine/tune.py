"""`console tune`: proposed gains of the tool; apply them on trial, and take them back."""

from __future__ import annotations

from argparse import Namespace

from console.cli.arguments import LINK, add_shared, number
from console.cli.commands import add_actions
from console.cli.parser import Parser
from console.text.catalogue import Catalogue

ACTIONS = ("show", "apply", "revert")


def add(parser: Parser, text: Catalogue) -> None:
    """Add the actions; each takes the machine and its address."""
    for name, action in add_actions(parser, "tune", ACTIONS, text).items():
        add_shared(action, text, "machine", *LINK)
        if name != "revert":
            action.add_argument("--factor", metavar="G", type=number, help=text("help.tune.factor"))
            action.add_argument("--lobe", metavar="HZ", type=number, help=text("help.tune.lobe"))
        if name != "show":
            action.add_argument("--yes", action="store_true", help=text("help.tune.yes"))


def main(options: Namespace, text: Catalogue) -> int:
    """Show, apply or revert; what it refuses is a problem."""
    from console.cli.machine.card_access import opened_card
    from console.cli.machine.tune_run import WORKS

    with opened_card(options, text) as card:
        return WORKS[options.action](options, card, text)
