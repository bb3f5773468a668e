"""`console predict`: form error of a plain cut, clamping force, and the speed limits for following the lobe."""

from __future__ import annotations

from argparse import Namespace

from console.cli.arguments import add_job
from console.cli.parser import Parser
from console.text.catalogue import Catalogue


def add(parser: Parser, text: Catalogue) -> None:
    """Add the job and the machine."""
    add_job(parser, text)


def main(options: Namespace, text: Catalogue) -> int:
    """Print the prediction; 1 when a rule refuses the job."""
    from console.cli.library import job_of, judged_of
    from console.cli.output import show, tell
    from console.cli.part.predict_report import prediction_fields, prediction_lines
    from profiles.findings import refusals
    from profiles.lobe.prediction import predict

    job, machine = job_of(options).job, judged_of(options)
    seen = predict(job, machine.machine)
    warnings = tell(machine.warnings, text)
    show(
        options,
        lambda: {**prediction_fields(job, machine, seen, text), "warnings": warnings},
        lambda: prediction_lines(job, machine, seen, text),
    )
    return 1 if refusals(seen.findings) else 0
