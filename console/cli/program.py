"""`console program`: the controller program of a job, as it would be sent."""

from __future__ import annotations

from argparse import Namespace

from console.cli.library import job_of, judged_of
from console.cli.output import print_json, tell
from console.session.cut.run import plan_run
from console.text.catalogue import Catalogue
from drivers.cutting.planning import CutPlan
from drivers.cutting.strategy import Strategy
from drivers.pmac.analysis.start import start_comment
from drivers.pmac.axes import read_definitions
from profiles.machine import MachineProfile


def main(options: Namespace, text: Catalogue) -> int:
    """Print the program; what the checker found goes to stderr."""
    loaded, judged = job_of(options), judged_of(options)
    job, machine = loaded.job, judged.machine
    # Nothing is armed: what would be refused then is told here.
    plan = plan_run(job, machine, Strategy(options.strategy), options.ts, str(loaded.path), simulated=True)
    warnings = tell((*judged.warnings, *plan.warnings), text)
    program = f"{_start_line(plan.cut, machine)}\n{plan.cut.text}"
    if options.json:
        print_json(
            {
                "job": job.name,
                "machine": machine.name,
                "strategy": options.strategy,
                "program": program,
                "spindle_rpm": plan.cut.spindle_speed_rpm,
                "lobe_frequency_hz": plan.cut.spindle_speed_rpm * job.jaws / 60.0,
                "segment_ms": plan.cut.segment_ms,
                "duration_s": plan.cut.duration_s,
                "warnings": warnings,
            }
        )
    else:
        print(program, end="")
    return 0


def _start_line(cut: CutPlan, machine: MachineProfile) -> str:
    """Return the comment that says where the driver puts the motors before it starts the program."""
    counts = {
        machine.tool.motor: cut.tool_start,
        machine.spindle.motor: cut.spindle_start,
        machine.carriage.motor: cut.carriage_start,
    }
    return start_comment(read_definitions(machine.controller.axis_definitions), counts)
