"""`console preview`: what a job will do, before anything is sent."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from console.cli.library import job_of, judged_of
from console.cli.output import print_json, tell
from console.cli.preview_fields import fields_of
from console.cli.preview_told import lines_of
from console.session.data.identified import response_in
from console.text.catalogue import Catalogue
from drivers.cutting.planning import CutPlan
from drivers.cutting.strategy import Strategy
from drivers.preview.preview import preview
from profiles.findings import refusals
from profiles.problem import ProblemError


def main(options: Namespace, text: Catalogue) -> int:
    """Print the preview; 1 when a rule refuses the job, or when the strategy cannot cut it.

    Raises:
        ProblemError: what cannot be read, or cannot be inverted at this speed; `response.of_another`.
    """
    job, judged = job_of(options).job, judged_of(options)
    machine = judged.machine
    strategy = Strategy(options.strategy)
    file = options.identified
    response = None if file is None else response_in(Path(file), machine, strategy)
    seen = preview(job, machine, strategy, response)
    warnings = tell(judged.warnings, text)
    if options.json:
        print_json({**fields_of(seen, text), "calibrations": judged.used, "warnings": warnings})
    else:
        print("\n".join(lines_of(seen, text)))
    return 1 if refusals(seen.findings) or _refused(seen.strategies[strategy]) else 0


def _refused(plan: CutPlan | ProblemError) -> bool:
    return isinstance(plan, ProblemError) or bool(refusals(plan.findings))
