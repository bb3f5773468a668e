"""`console controller`: back up, restore, verify, compare a controller; apply gains, download programs."""

from __future__ import annotations

from argparse import Namespace

from console.cli.arguments import LINK, add_shared
from console.cli.commands import add_actions
from console.cli.parser import Parser
from console.text.catalogue import Catalogue

ACTIONS = ("backup", "restore", "verify", "diff", "apply", "download")
WITH_A_FILE = ("backup", "restore", "diff")


def add(parser: Parser, text: Catalogue) -> None:
    """Add the actions on a configuration; each takes the machine and its address."""
    for name, action in add_actions(parser, "controller", ACTIONS, text).items():
        if name in WITH_A_FILE:
            action.add_argument("file", metavar="FILE", help=text("help.backup_file"))
        if name == "download":
            action.add_argument("file", metavar="FILE", help=text("help.program_file"))
        add_shared(action, text, "machine", *LINK)
        if name in ("apply", "restore", "download"):
            key = "help.controller.yes" if name == "apply" else "help.controller.restore_yes"
            action.add_argument("--yes", action="store_true", help=text(key))


def main(options: Namespace, text: Catalogue) -> int:
    """Run the requested action; 1 when something fails or differs."""
    from console.cli.machine.card_access import opened_card
    from console.cli.machine.configuration import WORKS

    if options.action == "download":
        from console.cli.backups.download_file import download_file

        return download_file(options, text)
    with opened_card(options, text) as card:
        return WORKS[options.action](options, card, text)
