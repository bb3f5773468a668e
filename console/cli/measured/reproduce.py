"""`console reproduce`: the paper beside our results, and the twelve acceptance numbers."""

from __future__ import annotations

from argparse import Namespace

from console.cli.parser import Parser
from console.text.catalogue import Catalogue


def add(parser: Parser, text: Catalogue) -> None:
    """Add how much to compute, and whether to draw it."""
    parser.add_argument("--quick", action="store_true", help=text("help.reproduce.quick"))
    parser.add_argument("--plot", action="store_true", help=text("help.reproduce.plot"))


def main(options: Namespace, text: Catalogue) -> int:
    """Print the comparison without its figures; 1 where an acceptance number is missed."""
    from console.cli.measured.comparison import reproduce

    return reproduce(options, text, draw=None)
