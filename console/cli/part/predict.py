"""`console predict`: form error of a plain cut, clamping force, and the speed limits for following the lobe."""

from __future__ import annotations

from argparse import Namespace

from console.cli.arguments import add_job, add_machine
from console.cli.parser import Parser
from console.text.catalogue import Catalogue


def add(parser: Parser, text: Catalogue) -> None:
    """Add the job and the machine."""
    add_job(parser, text)
    add_machine(parser, text)


def main(options: Namespace, text: Catalogue) -> int:
    """Print the prediction; 1 when a rule refuses the job."""
    from console.cli.library import job_of, judged_of
    from console.cli.output import print_json, tell
    from console.cli.part.predict_fields import prediction_fields
    from console.cli.part.predict_lines import prediction_lines, source_lines
    from profiles.findings import refusals
    from profiles.lobe.prediction import predict

    job, found = job_of(options).job, judged_of(options)
    machine, seen = found.machine, predict(job, found.machine)
    warnings = tell(found.warnings, text)
    if options.json:
        sources = {f"chuck.{key}": date or "profile" for key, date in found.sources.items()}
        fields = prediction_fields(job, machine, seen, text)
        print_json({**fields, "sources": sources, "warnings": warnings})
    else:
        lines = [*prediction_lines(job, machine, seen, text), *source_lines(found.sources, text)]
        print("\n".join([f"{job.name} · {machine.name}", "", *lines]))
    return 1 if refusals(seen.findings) else 0
