"""`console calibrate`: the chuck from measurements at it, or a job's lobe from the trace of a part."""

from __future__ import annotations

from argparse import Namespace

from console.cli.arguments import add_machine, add_sim, number, whole_numbers
from console.cli.commands import add_actions
from console.cli.parser import Parser
from console.text.catalogue import Catalogue

KINDS = ("wrench", "deflection")


def add(parser: Parser, text: Catalogue) -> None:
    """Add the kinds of calibration."""
    actions = add_actions(parser, "calibrate", ("chuck", "lobe"), text)
    _add_chuck(actions["chuck"], text)
    _add_lobe(actions["lobe"], text)


def main(options: Namespace, text: Catalogue) -> int:
    """Fit the measurements and print the result with its confidence; keep it if requested."""
    if options.action == "chuck":
        from console.cli.measured.calibrate_chuck import calibrate_chuck

        return calibrate_chuck(options, text)
    from console.cli.measured.calibrate_lobe import calibrate_lobe

    return calibrate_lobe(options, text)


def _add_chuck(parser: Parser, text: Catalogue) -> None:
    parser.add_argument("file", metavar="FILE.csv", help=text("help.calibrate.table"))
    add_machine(parser, text)
    parser.add_argument("--kind", choices=KINDS, help=text("help.calibrate.kind"))
    parser.add_argument("--affine", action="store_true", help=text("help.calibrate.affine"))
    parser.add_argument("--torque", metavar="NM", type=number, help=text("help.calibrate.torque"))
    parser.add_argument("--force", metavar="N", type=number, help=text("help.calibrate.force"))
    parser.add_argument("--keep", action="store_true", help=text("help.calibrate.chuck.keep"))


def _add_lobe(parser: Parser, text: Catalogue) -> None:
    parser.add_argument("file", metavar="TRACE", help=text("help.calibrate.trace"))
    parser.add_argument("--job", metavar="JOB", required=True, help=text("help.job"))
    add_machine(parser, text)
    parser.add_argument("--extra", metavar="N,N", type=whole_numbers, help=text("help.calibrate.extra"))
    parser.add_argument("--robust", action="store_true", help=text("help.calibrate.robust"))
    parser.add_argument("--keep", action="store_true", help=text("help.calibrate.lobe.keep"))
    add_sim(parser, text, "help.calibrate.lobe.sim")
