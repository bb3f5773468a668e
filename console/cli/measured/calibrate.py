"""`console calibrate`: the chuck from measurements at it, or a job's lobe from the trace of a part."""

from __future__ import annotations

from argparse import Namespace

from console.cli.arguments import add_shared, list_parser, number, whole_number
from console.cli.commands import add_actions
from console.cli.parser import Parser
from console.text.catalogue import Catalogue

KINDS = ("wrench", "deflection")


def add(parser: Parser, text: Catalogue) -> None:
    """Add the kinds of calibration."""
    actions = add_actions(parser, "calibrate", ("chuck", "jaws", "lobe"), text)
    chuck, jaws, lobe = actions["chuck"], actions["jaws"], actions["lobe"]
    chuck.add_argument("file", metavar="FILE.csv", help=text("help.calibrate.table"))
    add_shared(chuck, text, "machine")
    chuck.add_argument("--kind", choices=KINDS, help=text("help.calibrate.kind"))
    chuck.add_argument("--affine", action="store_true", help=text("help.calibrate.affine"))
    chuck.add_argument("--torque", metavar="NM", type=number, help=text("help.calibrate.torque"))
    chuck.add_argument("--force", metavar="N", type=number, help=text("help.calibrate.force"))
    chuck.add_argument("--keep", action="store_true", help=text("help.calibrate.chuck.keep"))
    jaws.add_argument("file", metavar="FILE.csv", help=text("help.file"))
    jaws.add_argument("others", metavar="SECTION.csv", nargs="*", help=text("help.sections"))
    jaws.add_argument("--job", metavar="JOB", required=True, help=text("help.job"))
    add_shared(jaws, text, "machine")
    jaws.add_argument("--keep", action="store_true", help=text("help.calibrate.chuck.keep"))
    add_shared(jaws, text, "sim", command="calibrate.lobe")
    for each in (chuck, lobe):
        each.add_argument("--confirm", metavar="NUMBER", type=number, help=text("help.calibrate.confirm"))
    lobe.add_argument("file", metavar="TRACE", help=text("help.calibrate.trace"))
    lobe.add_argument("--job", metavar="JOB", required=True, help=text("help.job"))
    add_shared(lobe, text, "machine")
    lobe.add_argument("--extra", metavar="N,N", type=list_parser(whole_number), help=text("help.calibrate.extra"))
    lobe.add_argument("--robust", action="store_true", help=text("help.calibrate.robust"))
    lobe.add_argument("--keep", action="store_true", help=text("help.calibrate.lobe.keep"))
    add_shared(lobe, text, "sim", command="calibrate.lobe")


def main(options: Namespace, text: Catalogue) -> int:
    """Fit the measurements and print the result with its confidence; keep it if requested."""
    if options.action == "chuck":
        from console.cli.measured.calibrate_chuck import calibrate_chuck

        return calibrate_chuck(options, text)
    if options.action == "jaws":
        from console.cli.measured.calibrate_chuck import calibrate_jaws

        return calibrate_jaws(options, text)
    from console.cli.measured.calibrate_lobe import calibrate_lobe

    return calibrate_lobe(options, text)
