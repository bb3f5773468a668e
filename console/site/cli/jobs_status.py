"""`console jobs status`: what differs from the commit of a data folder, and whether it can be used.

A changed job is judged as on opening, by its file, and then as before a cut, by the rules on the machine.
"""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from pathlib import Path

from console.cli.library import data_of, judged_of
from console.cli.output import fields_of, show
from console.site.versioning.status import CloneStatus, FileChange, FileChangeKind, clone_status
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.files import printable
from profiles.findings import refusals
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError
from profiles.rules import check
from profiles.store import LibraryEntry, load_job, load_machine

COMMIT_DIGITS = 12


def show_status(options: Namespace, text: Catalogue) -> None:
    """Print how the data folder differs from its commit; changed jobs and machines are judged as on opening."""
    data = data_of(options)
    status = clone_status(data)
    machine = _machine(options)
    judged = [(change, _problems(change, data, machine)) for change in status.changes]
    show(
        options,
        lambda: {
            **fields_of(status, "commit", "branch", "upstream", "ahead", "behind"),
            "judged_on": machine.name if isinstance(machine, MachineProfile) else None,
            "not_judged": _not_judged(machine, text),
            "changes": [
                {
                    "path": change.path,
                    "how": change.how.value,
                    "problems": [text.problem(each) for each in problems],
                }
                for change, problems in judged
            ],
        },
        lambda: [*_head(status, text), *_lines(judged, machine, text)],
    )


def _machine(options: Namespace) -> MachineProfile | ProfileError:
    """Return the machine whose rules jobs are judged by, or why it cannot be used: it may be what differs.

    Raises ProfileError: there is no machine of this name.
    """
    try:
        return judged_of(options).machine
    except ProfileError as error:
        if error.problems[0].code == "machine.unknown":
            raise
        return error


def _problems(change: FileChange, data: Path, machine: MachineProfile | ProfileError) -> tuple[Problem, ...]:
    """Return why a changed machine cannot be used, or a changed job, on this machine; nothing of another file."""
    path = Path(change.path)
    if len(path.parts) != 2 or path.suffix != ".toml" or change.how is FileChangeKind.DELETED:
        return ()
    entry = LibraryEntry(name=path.stem, path=data / path, bundled=False)
    try:
        if path.parts[0] == "machines":
            load_machine(entry)
        elif path.parts[0] == "jobs":
            job = load_job(entry).job
            found = () if isinstance(machine, ProfileError) else refusals(check(job, machine))
            return tuple(replace(each.problem, where=printable(str(data / path))) for each in found)
    except ProfileError as error:
        return tuple(error.problems)
    return ()


def _not_judged(machine: MachineProfile | ProfileError, text: Catalogue) -> list[str]:
    """Return why jobs were not judged by the rules of a machine; nothing where they were."""
    return [text.problem(each) for each in machine.problems] if isinstance(machine, ProfileError) else []


def _head(status: CloneStatus, text: Catalogue) -> list[str]:
    commit = text("jobs.no_commit") if status.commit is None else status.commit[:COMMIT_DIGITS]
    lines = [text("jobs.at_commit", commit=commit, branch=printable(status.branch or "–"))]
    if status.upstream is not None and status.ahead is not None and status.behind is not None:
        facts = {"upstream": printable(status.upstream), "ahead": status.ahead, "behind": status.behind}
        lines.append(text("jobs.against_upstream", **facts))
    return lines


def _lines(
    judged: list[tuple[FileChange, tuple[Problem, ...]]], machine: MachineProfile | ProfileError, text: Catalogue
) -> list[str]:
    if not judged:
        return [text("jobs.nothing_differs")]
    rows = [
        (text(f"jobs.how.{change.how}"), printable(change.path), text("jobs.unusable") if problems else "")
        for change, problems in judged
    ]
    if isinstance(machine, ProfileError):
        on = [text("jobs.not_judged"), *_not_judged(machine, text)]
    else:
        on = [text("jobs.judged_on", machine=printable(machine.name))]
    return [*table(rows), *(text.problem(each) for _, problems in judged for each in problems), *on]
