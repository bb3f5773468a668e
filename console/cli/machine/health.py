"""`console health`: step, parabola and sine of the tool axis, beside the model and the test before."""

from __future__ import annotations

from argparse import Namespace

from console.cli.arguments import HARDWARE, LINK, WRONG_USAGE, add_shared, number
from console.cli.parser import Parser
from console.session.signals import Interruption
from console.text.catalogue import Catalogue


def add(parser: Parser, text: Catalogue) -> None:
    """Add the machine, simulated or real, and the size of the step."""
    add_shared(parser, text, "machine")
    add_shared(parser, text, "sim", command="health")
    add_shared(parser, text, *HARDWARE, *LINK)
    parser.add_argument("--step", metavar="UM", type=number, help=text("help.health.step"))
    parser.add_argument("--yes", action="store_true", help=text("help.identify.yes"))


def main(options: Namespace, text: Catalogue) -> int:
    """Test, print and keep the result; 2 for options that belong to a simulated machine alone."""
    interruption = Interruption()
    interruption.install()
    from console.cli.library import refused_plant

    if refused_plant(options, "health", text):
        return WRONG_USAGE
    # Numerics take longer to load than the whole command line; signals are already handled.
    from console.cli.machine.tool_tests import check_and_keep

    return check_and_keep(options, interruption, text)
