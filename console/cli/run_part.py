"""What a run says and keeps of its part beside the result: what it is cut with, its trace, how to learn of it."""

from __future__ import annotations

import shlex
from argparse import Namespace
from dataclasses import replace

from console.cli.clamping import force_words
from console.cli.run_order import RunOrder
from console.session.learned_store import NONE
from console.session.made_parts import AS_FILED, CUT_JAW, INVERTED, MODEL
from console.session.run import RunResult
from console.session.stages import FOLLOWING, Stage
from console.text.catalogue import Catalogue
from profiles.traces import write_trace


def tell_cut_with(options: Namespace, order: RunOrder, text: Catalogue) -> None:
    """Print, for people, the lines in front of the steps: the stage, which compensation it is cut with, the force.

    A machine was cut on only after somebody has agreed, who has read the force before that.
    """
    if options.json:
        return
    plan = order.plan
    which = "run.cut_with_none" if plan.compensation is None else "run.cut_with"
    said = text(which, version=plan.compensation, stage=text(f"stage.{plan.stage}"), strategy=plan.cut.strategy)
    lines = [said] if order.address else [said, force_words(order.job.job, order.machine.machine, text)]
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
