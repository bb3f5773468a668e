"""`console jobs status`: what differs from the commit of a data folder, and whether it can be used."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from console.cli.library import data_of
from console.cli.output import fields_of, show
from console.session.versioning.status import Change, CloneStatus, How, clone_status
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.files import printable
from profiles.problem import Problem, ProfileError
from profiles.store import load_job, load_machine

COMMIT_DIGITS = 12
LOADS = {"jobs": load_job, "machines": load_machine}


def show_status(options: Namespace, text: Catalogue) -> None:
    """Print how the data folder differs from its commit; changed jobs and machines are judged as on opening."""
    data = data_of(options)
    status = clone_status(data)
    judged = [(change, _problems(change, data)) for change in status.changes]
    show(
        options,
        lambda: {
            **fields_of(status, "commit", "branch", "upstream", "ahead", "behind"),
            "changes": [
                {
                    "path": change.path,
                    "how": change.how.value,
                    "problems": [text.problem(each) for each in problems],
                }
                for change, problems in judged
            ],
        },
        lambda: [*_head(status, text), *_lines(judged, text)],
    )


def _problems(change: Change, data: Path) -> tuple[Problem, ...]:
    """Return why a changed job or machine cannot be used; nothing of any other file."""
    path = Path(change.path)
    load = LOADS.get(path.parts[0]) if len(path.parts) == 2 and path.suffix == ".toml" else None
    if load is None or change.how is How.DELETED:
        return ()
    try:
        load(str(data / path))
    except ProfileError as error:
        return tuple(error.problems)
    return ()


def _head(status: CloneStatus, text: Catalogue) -> list[str]:
    commit = text("jobs.no_commit") if status.commit is None else status.commit[:COMMIT_DIGITS]
    lines = [text("jobs.at_commit", commit=commit, branch=printable(status.branch or "–"))]
    if status.upstream is not None and status.ahead is not None and status.behind is not None:
        facts = {"upstream": printable(status.upstream), "ahead": status.ahead, "behind": status.behind}
        lines.append(text("jobs.against_upstream", **facts))
    return lines


def _lines(judged: list[tuple[Change, tuple[Problem, ...]]], text: Catalogue) -> list[str]:
    if not judged:
        return [text("jobs.nothing_differs")]
    rows = [
        (text(f"jobs.how.{change.how}"), printable(change.path), text("jobs.unusable") if problems else "")
        for change, problems in judged
    ]
    return [*table(rows), *(text.problem(each) for _, problems in judged for each in problems)]
