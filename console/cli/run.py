"""`console run`: a whole job, from the saved job to the measured part."""

from __future__ import annotations

import sys
from argparse import ArgumentTypeError, Namespace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from console.cli.agreement import agreed
from console.cli.arguments import (
    STAGES,
    add_job,
    add_link,
    add_machine,
    add_plant,
    add_sim,
    add_strategy,
    compensation,
    whole_number,
)
from console.cli.parser import Parser
from console.session.signals import Interruption
from console.text.catalogue import Catalogue

if TYPE_CHECKING:
    from collections.abc import Callable

    from console.cli.run_order import RunOrder
    from console.session.cut.sequence import Step


import shlex
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from importlib.metadata import version
from typing import TypeVar

from console.cli.clamping_lines import force_line
from console.cli.run_order import RunOrder
from console.session.cut.run import RunResult
from console.session.data.learned_store import NONE
from console.session.data.made_parts import AS_FILED, CUT_JAW, INVERTED, MODEL
from console.session.data.records import DRIVES_ON_PATIENCE_S, OPEN_PATIENCE_S, RunRecord
from console.session.errors import SessionError
from console.session.stages import FOLLOWING, Stage
from profiles.traces import write_trace

WRONG_USAGE = 2
MOST_PARTS = 20
"""Parts in a row that learn."""


def add(parser: Parser, text: Catalogue) -> None:
    """Add the job, the machine, simulated or real, how it is cut, and where its trace goes."""
    add_job(parser, text)
    add_machine(parser, text)
    add_sim(parser, text, "help.sim")
    add_link(parser, text)
    add_strategy(parser, text)
    add_plant(parser, text)
    parser.add_argument("--identified", metavar="FILE", help=text("help.identified"))
    parser.add_argument("--learn", metavar="PARTS", type=_parts, help=text("help.run.learn"))
    parser.add_argument("--stage", choices=STAGES, default="full", help=text("help.stage"))
    version_help = text("help.compensation")
    parser.add_argument("--compensation", metavar="VERSION", type=compensation, default="none", help=version_help)
    parser.add_argument("--part", metavar="FILE.csv", help=text("help.part"))
    parser.add_argument("--yes", action="store_true", help=text("help.run.yes"))


def _parts(word: str) -> int:
    parts = whole_number(word)
    if not 1 <= parts <= MOST_PARTS:
        raise ArgumentTypeError(Parser.text("usage.parts", value=word, limit=MOST_PARTS))
    return parts


def main(options: Namespace, text: Catalogue) -> int:
    """Run a job, on a machine or simulated, and print what became of it.

    The exit code is 1 when nobody agreed to move a machine, 2 for words that belong to a simulated one alone.

    Raises:
        ProblemError: a refusal before anything moved, or what ended the cut; the machine is at rest.
    """
    interruption = Interruption()
    interruption.install()
    from console.cli.library import plant_given

    if plant_given(options) and not options.sim:
        print(f"console run: {text('usage.plant_without_sim')}", file=sys.stderr)
        return WRONG_USAGE
    # Numerics take longer to load than the whole command line; the signals are already in hand.
    from console.cli.library import data_of
    from console.cli.output import tell
    from console.cli.run_order import ordered
    from console.session.data.killed_runs import killed_runs
    from profiles.files import remove_all_left

    order = ordered(options)
    remove_all_left(data_of(options))
    killed = killed_runs(data_of(options), order.machine.machine.name, simulated=order.simulated)
    warnings = tell((*killed, *order.warnings), text)
    if order.address is not None and not _agreed(options, order, text):
        return 1
    _cut(options, order, interruption, warnings, text)
    return 0


def _agreed(options: Namespace, order: RunOrder, text: Catalogue) -> bool:
    """Say what the cut rests on where nobody has touched off, and have the name of the machine typed."""
    machine, job = order.plan.machine, order.plan.job
    rests_on = text(
        "run.rests_on",
        machine=machine.name,
        address=order.address,
        radius=f"{machine.tool.home_radius_mm:.3f}",
        jaw=f"{job.jaw_1_deg:.2f}",
        force=f"{job.chucking_force_n:.0f}",
    )
    print(f"{rests_on}\n{force_line(job, machine, text)}", file=sys.stderr)
    return agreed(options, machine.name, order.simulated, text, "run")


def _cut(
    options: Namespace, order: RunOrder, interruption: Interruption, warnings: list[str], text: Catalogue
) -> None:
    """Cut with a record and, where one is asked for, a trace, and print what became of it.

    What ended the trace is added to the warnings.
    """
    from console.cli import learn_report, run_report
    from console.cli.library import data_of
    from console.cli.output import tell as tell_problems
    from console.cli.run import begin_record, learn_hint, recorded, save_part, tell_cut_with
    from console.cli.run_order import cut, cut_learning
    from drivers.link.tracing import Tracing

    tracing = Tracing(None if options.trace is None else Path(options.trace), f"run {order.job.job.name}")
    data, parts = data_of(options), order.parts
    record = begin_record(data, order)
    tell_cut_with(options, order, text)
    tell = _teller(options, text, interruption, record.add, order)
    try:
        if parts is None:
            there = partial(cut, order, data, interruption, tracing, tell, text)
            result = recorded(record, warnings, order, there, run_report.fields)
        else:
            learned = recorded(
                record,
                warnings,
                order,
                lambda: cut_learning(order, parts, interruption, tracing, tell),
                learn_report.fields,
            )
    finally:
        warnings += tell_problems(tracing.problems, text)
    if parts is not None:
        warnings += tell_problems(learned.warnings, text)
        _print(options, learn_report.fields(learned, warnings), learn_report.lines(learned, text))
        return
    lines = [*run_report.lines(result, text), *learn_hint(options, order, text)]
    _print(options, run_report.fields(result, warnings), lines)
    save_part(order, result)


def _print(options: Namespace, fields: dict[str, object], lines: list[str]) -> None:
    from console.cli.output import print_json

    if options.json:
        print_json(fields)
    else:
        print("\n".join(lines))


def _teller(
    options: Namespace,
    text: Catalogue,
    interruption: Interruption,
    keep: Callable[[str, dict[str, object]], None],
    order: RunOrder,
) -> Callable[[str, Step, str], None]:
    """Return what is told at each step: a line for people, an event for the record."""
    sim = f"{text('sim')}  " if order.simulated else ""

    def tell(part: str, step: Step, detail: str) -> None:
        keep("step", {"part": part, "step": step.value, "detail": detail})
        if options.json:
            return
        if step.value == "cut":
            detail = f"{detail} · {text('run.how_to_stop')}"
        try:
            print(f"{sim}{text(f'part.{part}')}  {text(f'step.{step}')}  {detail}".rstrip())
            sys.stdout.flush()
        except OSError:
            # Nobody can see the machine any more, so it is not to go on.
            interruption.end("output closed")

    return tell


def tell_cut_with(options: Namespace, order: RunOrder, text: Catalogue) -> None:
    """Print, for people, the lines in front of the steps: the stage, which compensation it is cut with, the force.

    A machine was cut on only after somebody has agreed, who has read the force before that.
    """
    if options.json:
        return
    plan = order.plan
    which = "run.cut_with_none" if plan.compensation is None else "run.cut_with"
    said = text(which, version=plan.compensation, stage=text(f"stage.{plan.stage}"), strategy=plan.cut.strategy)
    lines = [said] if order.address else [said, force_line(order.job.job, order.machine.machine, text)]
    # In one piece: a reader that goes away behind the first line is missed at the first step, which stops the cut.
    print("".join(f"{text('sim')}  {line}\n" if order.simulated else f"{line}\n" for line in lines), end="")


def save_part(order: RunOrder, result: RunResult) -> None:
    """Write the trace of the part where one was asked for, with header lines that say what it was cut with.

    Raises:
        ProfileError: `file.exists`, `file.not_writable`.
    """
    if order.part_file is None or result.trace is None:
        return
    plan = order.plan
    made = {
        "compensation": NONE if plan.compensation is None else str(plan.compensation),
        "strategy": plan.cut.strategy.value,
        "stage": plan.stage.value,
        INVERTED: plan.inverted or MODEL,
        CUT_JAW: AS_FILED,
    }
    write_trace(order.part_file, replace(result.trace, meta={**result.trace.meta, **made}))


def learn_hint(options: Namespace, order: RunOrder, text: Catalogue) -> list[str]:
    """Return how to learn from the part; nothing of one in air, or by a strategy that follows no path."""
    if order.plan.cut.strategy not in FOLLOWING or order.plan.stage is Stage.AIR:
        return []
    if order.simulated and order.part_file is None:
        return []
    words = ["console", "learn", options.part or "FILE.csv", "--job", options.job]
    if options.machine:
        words += ["--machine", options.machine]
    if options.identified:
        words += ["--identified", options.identified]
    return [text("run.learn_from_it", command=shlex.join(words))]


Result = TypeVar("Result")


def begin_record(data: Path, order: RunOrder) -> RunRecord:
    """Begin the record of a run, in the data folder. On a lathe in this process no drive waits for other writers.

    Raises:
        SessionError: as `RunRecord`; nothing was started.
    """
    patience_s = OPEN_PATIENCE_S if order.address is None else DRIVES_ON_PATIENCE_S
    return RunRecord(data, _described(order), open_patience_s=OPEN_PATIENCE_S, patience_s=patience_s)


def recorded(
    record: RunRecord,
    warnings: list[str],
    order: RunOrder,
    work: Callable[[], Result],
    told: Callable[[Result, list[str]], dict[str, object]],
) -> Result:
    """Run, and keep in the record how it went, as it is `told`, however it ends.

    With the plan it keeps the dates of the calibrations with which the job was judged.
    """
    try:
        duration_s, used = order.plan.cut.duration_s, order.machine.used
        record.add("planned", {"warnings": warnings, "duration_s": duration_s, "calibrations": used})
        result = work()
        record.add("result", told(result, warnings))
    except BaseException as error:
        # What ended the run matters more than a record that cannot take it.
        with suppress(SessionError):
            record.add("ended", {"reason": str(error) or type(error).__name__})
        raise
    finally:
        record.close()
    return result


def _described(order: RunOrder) -> dict[str, object]:
    job, machine, plan = order.job, order.machine, order.plan
    return {
        "software": f"trilobe {version('trilobe')}",
        "job": job.job.name,
        "job_sha256": job.sha256,
        "machine": machine.machine.name,
        "machine_sha256": machine.sha256,
        "simulated": int(order.simulated),
        "strategy": plan.cut.strategy.value,
        "program": plan.cut.text,
    }
