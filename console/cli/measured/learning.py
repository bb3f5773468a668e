"""Actions of `console learn`: learn from a part, list the versions, or revert to one."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from pathlib import Path

from console.cli.library import data_of
from console.cli.measured.learn_fields import lesson_fields, version_fields
from console.cli.measured.learn_lines import kept_lines, lesson_lines, version_lines
from console.cli.output import print_json, tell
from console.session.data.calibrated_chuck import CalibratedMachine
from console.session.data.kept_files import utc_now
from console.session.data.learned_store import asked_for, store, versions
from console.session.data.made_parts import KEYS
from console.session.errors import SessionError
from console.session.learning.learning_steps import SIMULATED, reverted, taught
from console.text.catalogue import Catalogue
from profiles.files import printable
from profiles.problem import Problem, ProfileError
from profiles.store import LoadedJob, LoadedMachine
from profiles.traces import Trace, read_trace


def learn_from(options: Namespace, job: LoadedJob, machine: CalibratedMachine, text: Catalogue) -> int:
    """Learn from the trace of a part; with `--keep` store the next version.

    Raises:
        ProblemError: why nothing can be learned, or with `--keep` why it must not be kept.
    """
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


def list_versions(options: Namespace, job: LoadedJob, machine: LoadedMachine, text: Catalogue) -> int:
    """Print the versions of the job on the machine."""
    asked = asked_for(job, machine, "", simulated=options.sim)
    known = versions(data_of(options), asked)
    if options.json:
        print_json({"versions": [version_fields(each, asked) for each in known]})
    else:
        print("\n".join(version_lines(known, asked, text)))
    return 0


def revert(options: Namespace, job: LoadedJob, machine: LoadedMachine, text: Catalogue) -> int:
    """Make an older version the newest again; with `--keep` store it."""
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


def refuse_unused(options: Namespace) -> None:
    """Refuse learning options where nothing is learned.

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
