"""Check that a gauge file is the trace of the assumed part, by its content and its date."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from console.session.data.measured_part import KEYS, MadeWith, parts_made
from console.session.data.run_reader import cuts_of_run, run_of_trace
from console.session.errors import SessionError
from console.session.learning.evaluated_part import EvaluatedPart
from profiles.files import printable
from profiles.problem import Problem

DATE = "date"  # header line of a trace with the time at which it was measured, ISO 8601


def of_this_part(found: EvaluatedPart, data: Path, run_id: str | None) -> EvaluatedPart:
    """Return a trace with why it is not of the part of a run, or with a warning that it may not be.

    `run_id` is None if the run is unknown. A record that cannot be read is a warning: nothing speaks against
    the trace.
    """
    try:
        taken = taken_before(data, found.sha256, run_id)
        older = () if run_id is None else _older(found, data, run_id)
    except SessionError as unreadable:
        return replace(found, warnings=(*found.warnings, *unreadable.problems))
    if taken:
        return replace(found, problems=(*found.problems, *taken), judged=None)
    return replace(found, warnings=(*found.warnings, *older))


def taken_before(data: Path, sha256: str, run_id: str | None, made: MadeWith | None = None) -> tuple[Problem, ...]:
    """Return `trace.taken` where the content of a trace was taken for the part of another run; else nothing.

    With `made` it may be of any part that was made so, or of which that is not known.
    Raises SessionError: the record cannot be read.
    """
    other = run_of_trace(data, sha256, run_id)
    if other is None:
        return ()
    cuts = cuts_of_run(data, other)
    if made is not None and not _made_otherwise(made, parts_made(cuts)):
        return ()
    ended = _ended_at(cuts)
    return (Problem(code="trace.taken", value=printable(other, 8) if ended is None else local_time(ended)),)


def _made_otherwise(made: MadeWith, recorded: Sequence[MadeWith | None]) -> bool:
    known = [each for each in recorded if each is not None]
    told = [tuple(getattr(each, key) for key in KEYS) for each in (made, *known)]
    return bool(known) and len(known) == len(recorded) and told[0] not in told[1:]


def _older(found: EvaluatedPart, data: Path, run_id: str) -> tuple[Problem, ...]:
    cuts = cuts_of_run(data, run_id)
    measured = _measured_at(found.path, found.trace.meta)
    ended = _ended_at(cuts)
    if ended is None or measured is None or measured >= ended:
        return ()
    return (Problem(code="trace.older", value=local_time(measured), limit=local_time(ended)),)


def _ended_at(cuts: Sequence[tuple[str, str, str]]) -> datetime | None:
    """Return when the newest of these cuts ended; None without one, or where the record has no date there."""
    with suppress(ValueError, OverflowError, OSError):
        return datetime.fromisoformat(cuts[0][2]).astimezone() if cuts else None
    return None


def _measured_at(path: Path, meta: Mapping[str, str]) -> datetime | None:
    """Return the earlier of the date in a file and that of its last change; None if neither is known."""
    dates: list[datetime] = []
    with suppress(ValueError, OverflowError, OSError):  # anything else than a date states none
        dates += [datetime.fromisoformat(meta[DATE]).astimezone()] if DATE in meta else []
    with suppress(OSError, ValueError, OverflowError):
        dates.append(datetime.fromtimestamp(os.stat(path).st_mtime).astimezone())
    return min(dates, default=None)


def local_time(at: datetime) -> str:
    """Return a date as an operator reads it off the clock."""
    return at.astimezone().strftime("%Y-%m-%d %H:%M:%S")
