"""`console preview`: what a job will do, before anything is sent."""

from __future__ import annotations

from argparse import Namespace

from console.cli.arguments import add_job
from console.cli.parser import Parser
from console.text.catalogue import Catalogue
from drivers.cutting.strategy import DEFAULT_STRATEGY, Strategy


def add(parser: Parser, text: Catalogue) -> None:
    """Add the job, the machine, the strategy and the response that it inverts."""
    add_job(parser, text)
    names, strategy_help = [*map(str, Strategy)], text("help.preview.strategy", default=DEFAULT_STRATEGY)
    parser.add_argument("--strategy", choices=names, default=DEFAULT_STRATEGY.value, help=strategy_help)
    parser.add_argument("--identified", metavar="FILE|newest", help=text("help.identified"))


def main(options: Namespace, text: Catalogue) -> int:
    """Print the preview; 1 when a rule refuses the job, or when the strategy cannot cut it."""
    from console.cli.library import data_of, job_of, judged_of
    from console.cli.output import show, tell
    from console.cli.part.preview_report import preview_fields, preview_lines
    from console.session.data.identified_responses import asked_response
    from drivers.preview.preview import preview
    from profiles.findings import refusals
    from profiles.problem import ProblemError

    job, judged = job_of(options).job, judged_of(options)
    strategy, asked = Strategy(options.strategy), options.identified
    response = None
    if asked is not None:
        response = asked_response(data_of(options), asked, judged.machine, strategy).response
    seen = preview(job, judged.machine, strategy, response)
    warnings = tell(judged.warnings, text)
    show(
        options,
        lambda: {**preview_fields(seen, text), "calibrations": judged.calibration_dates, "warnings": warnings},
        lambda: preview_lines(seen, text),
    )
    plan = seen.strategies[strategy]
    refused = isinstance(plan, ProblemError) or refusals(plan.findings) or refusals(seen.findings)
    return 1 if refused else 0
