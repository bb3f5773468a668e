"""`console fingerprint`: the deflection of a clamping from indicator readings; readings of a simulated one."""

from __future__ import annotations

import shlex
import sys
from argparse import Namespace
from dataclasses import replace
from pathlib import Path

from console.cli.arguments import (
    DEFAULT_PLANT,
    PLANT,
    WRONG_USAGE,
    add_job,
    add_lathe_part,
    add_shared,
    add_strategy,
)
from console.cli.parser import Parser
from console.text.catalogue import Catalogue


def add(parser: Parser, text: Catalogue) -> None:
    """Add the job, the file of the readings, and where a simulated lathe writes them."""
    add_job(parser, text)
    parser.add_argument("file", metavar="FILE", nargs="?", help=text("help.fingerprint.file"))
    add_shared(parser, text, "sim", *PLANT)
    add_lathe_part(parser, text)
    add_strategy(parser, text)
    parser.add_argument("--out", metavar="FILE", help=text("help.fingerprint.out"))


def main(options: Namespace, text: Catalogue) -> int:
    """Print what a file of readings shows; with `--sim --out` take one at the simulated lathe."""
    from console.cli.library import refused_plant

    if refused_plant(options, "fingerprint", text):
        return WRONG_USAGE
    if (options.file is None) == (options.out is None) or (options.out is not None and not options.sim):
        print(f"console fingerprint: {text('usage.fingerprint')}", file=sys.stderr)
        return WRONG_USAGE
    if options.out is not None:
        _take(options, text)
    else:
        _judge(options, text)
    return 0


def _take(options: Namespace, text: Catalogue) -> None:
    """Write what the indicator of the simulated lathe shows of the clamping that the same options cut on."""
    from console.cli.library import SIM_OPTION, job_of, lathe_parts_of, machine_of, true_parameters_of
    from console.cli.measured.fingerprint_source import simulate_clamp_readings
    from console.cli.output import show
    from profiles.files import printable, write_atomically
    from profiles.fingerprint.readings import readings_text

    job, machine = job_of(options), machine_of(options, SIM_OPTION).machine
    true = true_parameters_of(options, machine)
    parts = lathe_parts_of(options, job.job.name, machine.name, true)
    if true is not None and parts is not None:
        true = replace(true, parts_before=parts.part - 1)
    readings = simulate_clamp_readings(job.job, machine, true)
    write_atomically(Path(options.out), readings_text(readings).encode("ascii"), overwrite=False)
    words = ["console", "run", options.job, "--sim"]
    if true is not None:  # a seed that was not given was drawn
        words += ["--plant", options.plant or DEFAULT_PLANT, "--seed", str(true.seed)]
    words += [] if parts is None else ["--lathe-part", str(parts.part)]
    words += [] if options.clamping_sd is None else ["--clamping-sd", f"{options.clamping_sd:g}"]
    command = shlex.join([*words, "--strategy", options.strategy, "--fingerprint", options.out])
    count, file = len(readings.angle_deg), printable(options.out)
    show(
        options,
        lambda: {"file": options.out, "readings": count, "seed": None if true is None else true.seed},
        lambda: [text("fingerprint.written", count=count, file=file, command=command)],
    )


def _judge(options: Namespace, text: Catalogue) -> None:
    from console.cli.library import SIM_OPTION, data_of, job_of, machine_of
    from console.cli.measured.fingerprint_source import requested_fingerprint
    from console.cli.output import show, tell
    from console.session.data.calibrated_chuck import apply_calibrations
    from console.text.part_sentences import blank_lines, deflection_lines, fingerprint_fields, fingerprint_line
    from drivers.cutting.strategy import Strategy

    job, machine = (
        job_of(options).job,
        apply_calibrations(machine_of(options, SIM_OPTION), data_of(options)).machine,
    )
    strategy = Strategy(options.strategy)
    found = requested_fingerprint(options.file, job, machine, strategy, in_process=False, simulated=True)
    warnings = tell(found.clamped.warnings, text)
    show(
        options,
        lambda: {**fingerprint_fields(found, job.jaws), "warnings": warnings},
        lambda: [
            *deflection_lines(found.felt.deflection, text),
            fingerprint_line(found, text),
            *blank_lines(found.blank, text),
        ],
    )
