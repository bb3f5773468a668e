"""Output and records of `console run` around the cut."""

from __future__ import annotations

import shlex
import sys
from argparse import Namespace
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

from console.cli.agreement import agreed
from console.cli.clamping_lines import force_line
from console.cli.library import data_of
from console.cli.machine.learning_fields import learning_fields
from console.cli.machine.learning_lines import learning_lines
from console.cli.machine.run_fields import run_fields
from console.cli.machine.run_lines import run_lines
from console.cli.machine.run_places import cut, cut_learning
from console.cli.machine.run_request import RunRequest
from console.cli.output import print_json
from console.cli.output import tell as tell_problems
from console.session.cut.engine import Step
from console.session.cut.run import RunResult, TellPart
from console.session.data.learned_store import NONE
from console.session.data.made_parts import AS_FILED, CUT_JAW, INVERTED, MODEL
from console.session.data.records import DRIVES_ON_TIMEOUT_S, OPEN_TIMEOUT_S, RunRecord, begin_record
from console.session.errors import SessionError
from console.session.signals import Interruption
from console.session.stages import Stage
from console.text.catalogue import Catalogue
from drivers.link.tracing import Tracing
from profiles.traces import write_trace

Result = TypeVar("Result")


def agreed_to(options: Namespace, request: RunRequest, text: Catalogue) -> bool:
    """Report what the cut rests on without a touch-off, and have the name of the machine typed."""
    machine, job = request.plan.machine, request.plan.job
    rests_on = text(
        "run.rests_on",
        machine=machine.name,
        address=request.address,
        radius=f"{machine.tool.home_radius_mm:.3f}",
        jaw=f"{job.jaw_1_deg:.2f}",
        force=f"{job.chucking_force_n:.0f}",
    )
    print(f"{rests_on}\n{force_line(job, machine, text)}", file=sys.stderr)
    return agreed(options, machine.name, request.simulated, text, "run")


def cut_requested(
    options: Namespace, request: RunRequest, interruption: Interruption, warnings: list[str], text: Catalogue
) -> None:
    """Cut with a record and, if requested, a trace, and print the result.

    A reason why the trace ended early is added to the warnings.
    """
    tracing = Tracing(None if options.trace is None else Path(options.trace), f"run {request.job.job.name}")
    data, parts = data_of(options), request.parts
    record = _record(data, request)
    tell_cut_with(options, request, text)
    tell = _teller(options, text, interruption, record.add, request)
    try:
        if parts is None:
            there = partial(cut, request, data, interruption, tracing, tell, text)
            result = _recorded(record, warnings, request, there, run_fields)
        else:
            row = partial(cut_learning, request, parts, interruption, tracing, tell)
            learned = _recorded(record, warnings, request, row, learning_fields)
    finally:
        warnings += tell_problems(tracing.problems, text)
    if parts is not None:
        warnings += tell_problems(learned.warnings, text)
        _print(options, learning_fields(learned, warnings), learning_lines(learned, text))
        return
    lines = [*run_lines(result, text), *learn_hint(options, request, text)]
    _print(options, run_fields(result, warnings), lines)
    _save_part(request, result)


def _print(options: Namespace, fields: dict[str, object], lines: list[str]) -> None:
    if options.json:
        print_json(fields)
    else:
        print("\n".join(lines))


def _teller(
    options: Namespace,
    text: Catalogue,
    interruption: Interruption,
    keep: Callable[[str, dict[str, object]], None],
    request: RunRequest,
) -> TellPart:
    """Return the callback for each step: a line for people, an event for the record."""
    sim = f"{text('sim')}  " if request.simulated else ""

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
            # The operator no longer sees the machine, so it must not continue.
            interruption.end("output closed")

    return tell


def tell_cut_with(options: Namespace, request: RunRequest, text: Catalogue) -> None:
    """Print, for people, the lines before the steps: the stage, the compensation, the force.

    On a real machine, the operator has read the force before giving consent.
    """
    if options.json:
        return
    plan = request.plan
    which = "run.cut_with_none" if plan.compensation is None else "run.cut_with"
    said = text(which, version=plan.compensation, stage=text(f"stage.{plan.stage}"), strategy=plan.cut.strategy)
    lines = [said] if request.address else [said, force_line(request.job.job, request.machine.machine, text)]
    # In one piece: a reader that closes after the first line is noticed at the first step, which stops the cut.
    print("".join(f"{text('sim')}  {line}\n" if request.simulated else f"{line}\n" for line in lines), end="")


def _save_part(request: RunRequest, result: RunResult) -> None:
    """Write the trace of the part if requested, with header lines that state how it was cut.

    Raises:
        ProfileError: `file.exists`, `file.not_writable`.
    """
    if request.part_file is None or result.trace is None:
        return
    plan = request.plan
    made = {
        "compensation": NONE if plan.compensation is None else str(plan.compensation),
        "strategy": plan.cut.strategy.value,
        "stage": plan.stage.value,
        INVERTED: plan.inverted or MODEL,
        CUT_JAW: AS_FILED,
    }
    write_trace(request.part_file, replace(result.trace, meta={**result.trace.meta, **made}))


def learn_hint(options: Namespace, request: RunRequest, text: Catalogue) -> list[str]:
    """Return how to learn from the part; nothing for an air cut, or a strategy that follows no path."""
    if not request.plan.cut.strategy.traits.inverts or request.plan.stage is Stage.AIR:
        return []
    if request.simulated and request.part_file is None:
        return []
    words = ["console", "learn", options.part or "FILE.csv", "--job", options.job]
    if options.machine:
        words += ["--machine", options.machine]
    if options.identified:
        words += ["--identified", options.identified]
    return [text("run.learn_from_it", command=shlex.join(words))]


def _record(data: Path, request: RunRequest) -> RunRecord:
    """Begin the record of a run. On a lathe in this process, a wait for other writers keeps no real drive enabled.

    Raises:
        SessionError: as `RunRecord`; nothing was started.
    """
    return begin_record(
        data,
        request.job.job.name,
        request.job.sha256,
        request.machine,
        request.plan.cut,
        simulated=request.simulated,
        open_timeout_s=OPEN_TIMEOUT_S,
        patience_s=OPEN_TIMEOUT_S if request.address is None else DRIVES_ON_TIMEOUT_S,
    )


def _recorded(
    record: RunRecord,
    warnings: list[str],
    request: RunRequest,
    work: Callable[[], Result],
    told: Callable[[Result, list[str]], dict[str, object]],
) -> Result:
    """Run, and record the course as `told`, however it ends.

    With the plan it records the dates of the calibrations with which the job was judged.
    """
    try:
        duration_s, used = request.plan.cut.duration_s, request.machine.used
        record.add("planned", {"warnings": warnings, "duration_s": duration_s, "calibrations": used})
        result = work()
        record.add("result", told(result, warnings))
    except BaseException as error:
        # What ended the run matters more than a record that cannot be written.
        with suppress(SessionError):
            record.add("ended", {"reason": str(error) or type(error).__name__})
        raise
    finally:
        record.close()
    return result
