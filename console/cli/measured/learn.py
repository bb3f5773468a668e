"""`console learn`: the compensation of the next part from the measured one, kept in versions."""

from __future__ import annotations

from argparse import Namespace

from console.cli.arguments import STAGES, add_gauge, add_shared, compensation, list_parser, number, whole_number
from console.cli.parser import Parser
from console.text.catalogue import Catalogue
from drivers.cutting.strategy import INVERTING


def add(parser: Parser, text: Catalogue) -> None:
    """Add the trace or the action on versions, the cut that the part is from, and how to learn."""
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("file", metavar="TRACE", nargs="?", help=text("help.calibrate.trace"))
    what.add_argument("--list", action="store_true", help=text("help.learn.list"))
    what.add_argument("--revert", metavar="VERSION", type=whole_number, help=text("help.learn.revert"))
    parser.add_argument("--job", metavar="JOB", required=True, help=text("help.job"))
    add_shared(parser, text, "machine")
    add_shared(parser, text, "sim", command="learn")
    parser.add_argument("--compensation", metavar="VERSION", type=compensation, help=text("help.learn.cut_with"))
    parser.add_argument("--strategy", choices=[*map(str, INVERTING)], help=text("help.learn.strategy"))
    parser.add_argument("--stage", choices=STAGES[1:], help=text("help.learn.stage"))
    parser.add_argument("--identified", metavar="FILE", help=text("help.learn.identified"))
    add_gauge(parser, text)
    parser.add_argument("--gain", metavar="GAIN", type=number, help=text("help.learn.gain"))
    parser.add_argument("--extra", metavar="N,N", type=list_parser(whole_number), help=text("help.learn.extra"))
    parser.add_argument("--robust", action="store_true", help=text("help.calibrate.robust"))
    parser.add_argument("--keep", action="store_true", help=text("help.learn.keep"))


def main(options: Namespace, text: Catalogue) -> int:
    """Learn from a part, list the versions, or revert to one of them; keep nothing without `--keep`."""
    from console.cli.library import job_of, judged_of
    from console.cli.measured.learning import learn_from, list_or_revert

    job, machine = job_of(options), judged_of(options)
    act = list_or_revert if options.file is None else learn_from
    act(options, job, machine, text)
    return 0
