"""`console preview`: what a job will do, before anything is sent."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from console.cli.library import job_of, profile_of
from console.cli.output import print_json
from console.cli.preview_fields import fields_of
from console.cli.preview_told import lines_of
from console.session.identified_response import response_in
from console.session.preview import preview
from console.text.catalogue import Catalogue
from drivers.cut import CutPlan, Strategy
from profiles.problem import ProblemError
from profiles.rules import refusals


def main(options: Namespace, text: Catalogue) -> int:
    """Print the preview; 1 when a rule refuses the job, or when the strategy cannot cut it.

    Raises:
        ProblemError: what cannot be read, or cannot be inverted at this speed; `response.of_another`.
    """
    job, machine = job_of(options).job, profile_of(options).machine
    strategy = Strategy(options.strategy)
    file = options.identified
    response = None if file is None else response_in(Path(file), machine, strategy)
    seen = preview(job, machine, strategy, response)
    if options.json:
        print_json(fields_of(seen, text))
    else:
        print("\n".join(lines_of(seen, text)))
    return 1 if refusals(seen.findings) or _refused(seen.strategies[strategy]) else 0


def _refused(plan: CutPlan | ProblemError) -> bool:
    return isinstance(plan, ProblemError) or bool(refusals(plan.findings))
