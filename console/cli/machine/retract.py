"""`console retract`: the tool out of the part after a stop or a lost host, and no table left that adds to it."""

from __future__ import annotations

from argparse import Namespace

from console.cli.arguments import HARDWARE, LINK, add_shared
from console.cli.parser import Parser
from console.session.signals import Interruption
from console.text.catalogue import Catalogue


def add(parser: Parser, text: Catalogue) -> None:
    """Add the machine."""
    add_shared(parser, text, "machine", *HARDWARE, *LINK)
    parser.add_argument("--clear-tables", action="store_true", help=text("help.retract.clear_tables"))
    parser.add_argument("--yes", action="store_true", help=text("help.identify.yes"))


def main(options: Namespace, text: Catalogue) -> int:
    """Retract the tool of a machine and switch its tables off; 1 without consent to move it."""
    interruption = Interruption()
    interruption.install()
    # Numerics take longer to load than the whole command line; signals are already handled.
    from console.cli.machine.retract_run import retract

    return retract(options, interruption, text)
