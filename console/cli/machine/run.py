"""`console run`: a whole job, from the job file to the measured part."""

from __future__ import annotations

from argparse import Namespace

from console.cli.arguments import (
    INDICATOR,
    LINK,
    OUT_OF_TOLERANCE,
    PLANT,
    STAGES,
    WRONG_USAGE,
    add_fail_out_of_tolerance,
    add_gauge,
    add_identity,
    add_job,
    add_lathe_part,
    add_shared,
    add_strategy,
    compensation,
    number_parser_within,
    whole_number,
)
from console.cli.parser import Parser
from console.session.signals import Interruption
from console.text.catalogue import Catalogue

MOST_PARTS = 20
"""Largest number of parts in a learning series."""


def add(parser: Parser, text: Catalogue) -> None:
    """Add the job, the machine (simulated or real), how it is cut, and the file of its trace."""
    add_job(parser, text)
    add_shared(parser, text, "sim", *LINK)
    add_strategy(parser, text)
    add_shared(parser, text, *PLANT)
    add_lathe_part(parser, text)
    parser.add_argument("--identified", metavar="FILE|newest", help=text("help.identified"))
    parts = number_parser_within(whole_number, 1, MOST_PARTS, "usage.parts", MOST_PARTS)
    parser.add_argument("--learn", metavar="PARTS", type=parts, help=text("help.run.learn"))
    parser.add_argument("--stage", choices=STAGES, default="full", help=text("help.stage"))
    version_help = text("help.compensation")
    parser.add_argument("--compensation", metavar="VERSION", type=compensation, default="none", help=version_help)
    parser.add_argument("--fingerprint", metavar=f"FILE|{INDICATOR}", help=text("help.fingerprint_of"))
    parser.add_argument("--trial-band", action="store_true", help=text("help.trial_band"))
    parser.add_argument("--part", metavar="FILE.csv", help=text("help.part"))
    add_identity(parser, text)
    add_gauge(parser, text)
    add_fail_out_of_tolerance(parser, text)
    parser.add_argument("--yes", action="store_true", help=text("help.run.yes"))


def main(options: Namespace, text: Catalogue) -> int:
    """Run a job on a real or simulated machine, and print the result.

    The exit code is 1 without consent to move a machine, 2 for options that belong to a simulated one alone, on
    request 3 for a part out of its roundness tolerance, and 4 for a cut that is not proven to be the planned one;
    in a series the last part counts.
    """
    interruption = Interruption()
    interruption.install()
    from console.cli.library import refused_plant

    if refused_plant(options, "run", text):
        return WRONG_USAGE
    # Numerics take longer to load than the whole command line; signals are already handled.
    from console.cli.library import data_of
    from console.cli.machine.run_cut import agreed_to, cut_requested
    from console.cli.machine.run_request import plan_request
    from console.cli.output import tell
    from console.session.data.records import killed_runs
    from profiles.files import remove_all_left

    request = plan_request(options)
    remove_all_left(data_of(options))
    killed = killed_runs(data_of(options), request.machine.machine.name, simulated=request.simulated)
    warnings = tell((*killed, *request.warnings), text)
    if request.address is not None and not agreed_to(options, request, text):
        return 1
    result = cut_requested(options, request, interruption, warnings, text)
    if options.fail_out_of_tolerance and result.within_tolerance is False:
        return OUT_OF_TOLERANCE
    return result.figures.verdict.judgement.exit_code
