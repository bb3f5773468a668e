"""`console report`: everything of one run in one HTML file."""

from __future__ import annotations

import re
from argparse import Namespace
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from console.cli.arguments import add_identity, stated_identity
from console.cli.parser import Parser
from console.session.errors import SessionError
from console.text.catalogue import Catalogue
from profiles.problem import Problem, ProfileError

if TYPE_CHECKING:
    from console.session.data.measured_part import RecordedPart
    from console.session.data.run_rows import RunRow

MOST_POINTS = 5_000
"""Parts of a job among which those before the run are looked for."""

LONGEST_NAME = 80


def add(parser: Parser, text: Catalogue) -> None:
    """Add the run and the file to write."""
    parser.add_argument("run", metavar="RUN", nargs="?", help=text("help.report.run"))
    parser.add_argument("--output", metavar="FILE.html", help=text("help.report.output"))
    parser.add_argument("--overwrite", action="store_true", help=text("help.report.overwrite"))
    add_identity(parser, text)


def main(options: Namespace, text: Catalogue) -> int:
    """Keep what is stated of the part, write the report of its run and print where it is."""
    from console.cli.library import data_of
    from console.cli.output import show
    from console.report.page import write_report
    from console.report.quantities import date_in
    from console.report.verdict import judge_run
    from console.session.data.records import identify_part
    from console.session.data.run_reader import story
    from console.session.learning.opened_run import open_for_report
    from console.session.learning.run_debrief import run_debrief

    data, stated = data_of(options), stated_identity(options)
    found = story(data, options.run or _newest(data))
    if stated:
        identify_part(data, found, stated)
        found = story(data, found.row.run_id)
    row = found.row
    run = open_for_report(found, _points(data, row), debrief=run_debrief(found, data))
    path = Path(options.output or f"{_stem(row.job)}-{row.started.astimezone():%Y-%m-%d-%H%M%S}.html")
    _write(path, write_report(run, text), overwrite=options.overwrite)
    facts = {"run": row.run_id, "job": row.job, "date": date_in(None, row.started), "file": str(path)}
    judged = judge_run(run, text)
    show(
        options,
        lambda: {
            **{key: facts[key] for key in ("run", "job", "file")},
            "started": row.started.isoformat(),
            "simulated": row.simulated,
            "verdict": judged.judgement.value,
            "reasons": list(judged.reasons),
        },
        lambda: [*([] if options.run else [text("report.newest")]), text("report.written", **facts)],
    )
    return 0


def _points(data: Path, row: RunRow) -> tuple[RecordedPart, ...] | None:
    """Return the measured parts of the job of a run, None unreadable: the run itself may be sound."""
    from console.session.data.run_reader import measured_parts

    try:
        return measured_parts(data, row.job, row.machine, row.simulated, MOST_POINTS)
    except SessionError:
        return None


def _newest(data: Path) -> str:
    """Return the id of the run that was recorded last."""
    from console.session.data.record_file import FILE_NAME
    from console.session.data.run_reader import runs
    from profiles.files import printable

    newest = runs(data, limit=1)
    if not newest:
        raise SessionError(Problem(code="record.no_runs", where=printable(str(data / FILE_NAME))))
    return newest[0].run_id


def _stem(job: str) -> str:
    """Return the name of a job as that of a file: letters, digits, points and dashes."""
    kept = re.sub(r"[^\w.-]+", "-", job)[:LONGEST_NAME].strip(".-")
    return kept or "run"


def _write(path: Path, page: str, *, overwrite: bool) -> None:
    from profiles.files import write_atomically

    try:
        write_atomically(path, page.encode("utf-8", "backslashreplace"), overwrite=overwrite)
    except ProfileError as refused:
        problems = (replace(problem, key="--output") for problem in refused.problems)
        raise ProfileError(*problems) from refused
