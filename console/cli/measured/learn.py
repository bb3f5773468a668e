"""`console learn`: the compensation of the next part from the measured one, kept in versions."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from pathlib import Path

from console.cli.arguments import (
    IDENTIFIED,
    STAGES,
    add_machine,
    add_sim,
    compensation,
    number,
    whole_number,
    whole_numbers,
)
from console.cli.library import data_of, job_of, judged_of
from console.cli.measured.learn_fields import lesson_fields, version_fields
from console.cli.measured.learn_lines import kept_lines, lesson_lines, version_lines
from console.cli.output import print_json, tell
from console.cli.parser import Parser
from console.session.data.calibrated_chuck import CalibratedMachine
from console.session.data.dates import utc_now
from console.session.data.learned_store import asked_for, store, versions
from console.session.data.made_parts import KEYS
from console.session.errors import SessionError
from console.session.learning.lessons import SIMULATED, reverted, taught
from console.text.catalogue import Catalogue
from profiles.files import printable
from profiles.problem import Problem, ProfileError
from profiles.store import LoadedJob, LoadedMachine
from profiles.traces import Trace, read_trace


def add(parser: Parser, text: Catalogue) -> None:
    """Add the trace or what to do with the versions, the cut that the part is from, and how to learn."""
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("file", metavar="TRACE", nargs="?", help=text("help.calibrate.trace"))
    what.add_argument("--list", action="store_true", help=text("help.learn.list"))
    what.add_argument("--revert", metavar="VERSION", type=whole_number, help=text("help.learn.revert"))
    parser.add_argument("--job", metavar="JOB", required=True, help=text("help.job"))
    add_machine(parser, text)
    add_sim(parser, text, "help.learn.sim")
    parser.add_argument("--compensation", metavar="VERSION", type=compensation, help=text("help.learn.cut_with"))
    parser.add_argument("--strategy", choices=IDENTIFIED, help=text("help.learn.strategy"))
    parser.add_argument("--stage", choices=STAGES[1:], help=text("help.learn.stage"))
    parser.add_argument("--identified", metavar="FILE", help=text("help.learn.identified"))
    parser.add_argument("--gain", metavar="GAIN", type=number, help=text("help.learn.gain"))
    parser.add_argument("--extra", metavar="N,N", type=whole_numbers, help=text("help.learn.extra"))
    parser.add_argument("--robust", action="store_true", help=text("help.calibrate.robust"))
    parser.add_argument("--keep", action="store_true", help=text("help.learn.keep"))


def main(options: Namespace, text: Catalogue) -> int:
    """Learn from a part, list the versions, or go back to one of them; nothing is kept without `--keep`.

    Raises:
        ProblemError: why nothing can be learned, or with `--keep` why it must not be kept.
    """
    job, machine = job_of(options), judged_of(options)
    if options.file is not None:
        return _learn(options, job, machine, text)
    _refuse_unused(options)
    return _list(options, job, machine, text) if options.list else _revert(options, job, machine, text)


def _learn(options: Namespace, job: LoadedJob, machine: CalibratedMachine, text: Catalogue) -> int:
    trace, data = read_trace(Path(options.file)), data_of(options)
    _refuse_real(options, trace)
    said = {key: getattr(options, key) for key in KEYS if getattr(options, key) is not None}
    identified = None if options.identified is None else Path(options.identified)
    where = printable(options.file)
    try:
        found = taught(
            trace,
            job,
            machine,
            data,
            said,
            identified,
            gain=options.gain,
            robust=options.robust,
            date=utc_now(),
            extra=options.extra or (),
        )
    except ProfileError as error:
        raise ProfileError(*(replace(each, where=each.where or where) for each in error.problems)) from error
    reasons = found.lesson.reasons
    warnings = tell((*machine.warnings, *found.warnings, *(() if options.keep else reasons)), text)
    kept = store(data, found.lesson.next) if options.keep and not reasons else None
    if options.json:
        print_json({**lesson_fields(found), "kept": kept and str(kept), "warnings": warnings})
    else:
        asked = options.keep or bool(reasons)
        print("\n".join([*lesson_lines(found, text), *kept_lines(found.lesson.next, kept, asked, options, text)]))
    if options.keep and reasons:
        raise SessionError(*reasons)
    return 0


def _list(options: Namespace, job: LoadedJob, machine: LoadedMachine, text: Catalogue) -> int:
    asked = asked_for(job, machine, "", simulated=options.sim)
    known = versions(data_of(options), asked)
    if options.json:
        print_json({"versions": [version_fields(each, asked) for each in known]})
    else:
        print("\n".join(version_lines(known, asked, text)))
    return 0


def _revert(options: Namespace, job: LoadedJob, machine: LoadedMachine, text: Catalogue) -> int:
    data = data_of(options)
    back = reverted(options.revert, job, machine, data, simulated=options.sim, date=utc_now())
    kept = store(data, back) if options.keep else None
    if options.json:
        asked = asked_for(job, machine, "", simulated=options.sim)
        print_json({**version_fields(back, asked), "kept": kept and str(kept)})
    else:
        head = text("learned.reverts", version=back.version, older=back.reverts, strategy=back.holds_for.strategy)
        print("\n".join([head, *kept_lines(back, kept, options.keep, options, text)]))
    return 0


def _refuse_unused(options: Namespace) -> None:
    """Refuse what says how to learn where nothing is learned.

    Raises:
        SessionError: `learned.unused`.
    """
    unused = [key for key in (*KEYS, "identified", "gain", "extra") if getattr(options, key) is not None]
    if options.list and options.keep:
        unused.append("keep")
    if unused:
        value = ", ".join(f"--{key}" for key in unused)
        raise SessionError(
            Problem(code="learned.unused", key="--list" if options.list else "--revert", value=value)
        )


def _refuse_real(options: Namespace, trace: Trace) -> None:
    if options.sim and trace.meta.get(SIMULATED[0]) != SIMULATED[1]:
        where = printable(options.file)
        raise SessionError(Problem(code="learned.not_simulated", where=where, limit=": ".join(SIMULATED)))
