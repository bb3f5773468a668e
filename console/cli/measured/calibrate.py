"""`console calibrate`: the chuck from measurements at it, the lobe of a job from the trace of a part."""

from __future__ import annotations

from argparse import Namespace
from importlib import import_module

from console.cli.commands import add_actions
from console.cli.parser import Parser
from console.text.catalogue import Catalogue

ACTIONS = {
    "chuck": "console.cli.measured.calibrate_chuck",
    "lobe": "console.cli.measured.calibrate_lobe",
}


def add(parser: Parser, text: Catalogue) -> None:
    """Add what can be calibrated; each is a module like that of a command."""
    add_actions(parser, "calibrate", ACTIONS, text)


def main(options: Namespace, text: Catalogue) -> int:
    """Fit what was measured and print it with its confidence; keep it where that was asked for."""
    code: int = import_module(ACTIONS[options.action]).main(options, text)
    return code
