"""`console program`: print the controller program of a job, as it would be sent."""

from __future__ import annotations

from argparse import Namespace

from console.cli.arguments import add_job, add_strategy
from console.cli.parser import Parser
from console.text.catalogue import Catalogue


def add(parser: Parser, text: Catalogue) -> None:
    """Add the job, the machine and the strategy."""
    add_job(parser, text)
    add_strategy(parser, text)


def main(options: Namespace, text: Catalogue) -> int:
    """Print the program below a comment with the start positions of its motors; findings go to stderr."""
    from console.cli.library import job_of, judged_of
    from console.cli.output import print_json, tell
    from console.session.cut.run import plan_run
    from drivers.cutting.strategy import Strategy
    from drivers.pmac.analysis.start import start_comment
    from drivers.pmac.axes import read_definitions

    loaded, judged = job_of(options), judged_of(options)
    job, machine = loaded.job, judged.machine
    # Nothing is armed: what arming would refuse is reported here.
    plan = plan_run(job, machine, Strategy(options.strategy), options.ts, str(loaded.path), simulated=True)
    warnings, cut = tell((*judged.warnings, *plan.warnings), text), plan.cut
    counts = {
        machine.tool.motor: cut.tool_start,
        machine.spindle.motor: cut.spindle_start,
        machine.carriage.motor: cut.carriage_start,
    }
    program = f"{start_comment(read_definitions(machine.controller.axis_definitions), counts)}\n{cut.text}"
    fields = {
        "job": job.name,
        "machine": machine.name,
        "strategy": options.strategy,
        "program": program,
        "spindle_rpm": cut.spindle_speed_rpm,
        "lobe_frequency_hz": cut.spindle_speed_rpm * job.jaws / 60.0,
        "segment_ms": cut.segment_ms,
        "duration_s": cut.duration_s,
        "warnings": warnings,
    }
    if options.json:
        print_json(fields)
    else:
        print(program, end="")
    return 0
