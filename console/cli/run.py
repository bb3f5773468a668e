"""`console run`: a whole job, from the saved job to the measured part."""

from __future__ import annotations

import sys
from argparse import Namespace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from console.cli.agreement import agreed
from console.session.signals import Interruption
from console.text.catalogue import Catalogue

if TYPE_CHECKING:
    from collections.abc import Callable

    from console.cli.run_order import RunOrder
    from console.session.sequence import Step

WRONG_USAGE = 2


def main(options: Namespace, text: Catalogue) -> int:
    """Run a job, on a machine or simulated, and print what became of it.

    The exit code is 1 when nobody agreed to move a machine, 2 for words that belong to a simulated one alone.

    Raises:
        ProblemError: a refusal before anything moved, or what ended the cut; the machine is at rest.
    """
    interruption = Interruption()
    interruption.install()
    from console.cli.simulation import anything_told

    if anything_told(options) and not options.sim:
        print(f"console run: {text('usage.plant_without_sim')}", file=sys.stderr)
        return WRONG_USAGE
    # Numerics take longer to load than the whole command line; the signals are already in hand.
    from console.cli.run_order import ordered
    from console.cli.warn import tell

    order = ordered(options)
    warnings = tell((*order.machine.warnings, *order.unused, *order.plan.warnings), text)
    if order.address is not None and not _agreed(options, order, text):
        return 1
    _cut(options, order, interruption, warnings, text)
    return 0


def _agreed(options: Namespace, order: RunOrder, text: Catalogue) -> bool:
    """Say what the cut rests on where nobody has touched off, and have the name of the machine typed."""
    from console.cli.clamping import force_words

    machine, job = order.plan.machine, order.plan.job
    rests_on = text(
        "run.rests_on",
        machine=machine.name,
        address=order.address,
        radius=f"{machine.tool.home_radius_mm:.3f}",
        jaw=f"{job.jaw_1_deg:.2f}",
        force=f"{job.chucking_force_n:.0f}",
    )
    print(f"{rests_on}\n{force_words(job, machine, text)}", file=sys.stderr)
    return agreed(options, machine.name, order.simulated, text, "run")


def _cut(
    options: Namespace, order: RunOrder, interruption: Interruption, warnings: list[str], text: Catalogue
) -> None:
    """Cut with a record and, where one is asked for, a trace, and print what became of it.

    What ended the trace is added to the warnings.
    """
    from console.cli import learn_report, run_report
    from console.cli.library import data_of
    from console.cli.run_part import learn_hint, save_part, tell_cut_with
    from console.cli.run_places import cut, cut_learning
    from console.cli.run_record import begin_record, recorded
    from console.cli.warn import tell as tell_problems
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
