"""`console identify`: frequency response of the tool on the path of a strategy, as a table like Table 5."""

from __future__ import annotations

from argparse import Namespace

from console.cli.arguments import HARDWARE, LINK, WRONG_USAGE, add_shared, list_parser, number, whole_number
from console.cli.parser import Parser
from console.session.signals import Interruption
from console.text.catalogue import Catalogue
from drivers.cutting.strategy import DEFAULT_STRATEGY, INVERTING


def add(parser: Parser, text: Catalogue) -> None:
    """Add the machine, simulated or real, the path, and the excitation."""
    add_shared(parser, text, "machine")
    add_shared(parser, text, "sim", command="identify")
    add_shared(parser, text, *HARDWARE, *LINK)
    names, paths = [*map(str, INVERTING)], ", ".join(text(f"strategy.{each}.path") for each in INVERTING)
    path_help = text("help.identify.strategy", default=DEFAULT_STRATEGY, strategies=paths)
    parser.add_argument("--strategy", choices=names, default=DEFAULT_STRATEGY.value, help=path_help)
    frequencies_help = text("help.identify.frequencies")
    parser.add_argument("--frequencies", metavar="HZ,HZ", type=list_parser(number), help=frequencies_help)
    parser.add_argument("--amplitude", metavar="UM", type=number, help=text("help.identify.amplitude"))
    parser.add_argument("--periods", metavar="N", type=whole_number, help=text("help.identify.periods"))
    parser.add_argument("--yes", action="store_true", help=text("help.identify.yes"))


def main(options: Namespace, text: Catalogue) -> int:
    """Identify, print and keep the result; 2 for options that belong to a simulated machine alone."""
    interruption = Interruption()
    interruption.install()
    from console.cli.library import refused_plant

    if refused_plant(options, "identify", text):
        return WRONG_USAGE
    # Numerics take longer to load than the whole command line; signals are already handled.
    from console.cli.machine.tool_tests import identify_and_keep

    return identify_and_keep(options, interruption, text)
