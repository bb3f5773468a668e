"""`console machines`: the machine profiles, and a copy of one as the beginning of another machine's."""

from __future__ import annotations

import shlex
from argparse import Namespace
from typing import TypeAlias

from console.cli.commands import add_actions
from console.cli.library import data_of
from console.cli.output import show
from console.cli.parser import Parser
from console.session.data.kept_files import machines_folder, make_folder
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.files import printable
from profiles.problem import Problem, ProfileError
from profiles.store import LibraryEntry, LoadedMachine, list_machines, load_machine

ACTIONS = ("list", "copy")
NOTHING = "-"

Listed: TypeAlias = tuple[LibraryEntry, LoadedMachine | tuple[Problem, ...]]
"""An entry with its machine, or why it is unreadable."""


def add(parser: Parser, text: Catalogue) -> None:
    """Add the actions, each with its arguments."""
    copy = add_actions(parser, "machines", ACTIONS, text, required=False)["copy"]
    copy.add_argument("source", metavar="MACHINE", help=text("help.machine"))
    copy.add_argument("name", metavar="NAME", help=text("help.machines.name"))


def main(options: Namespace, text: Catalogue) -> int:
    """List every machine by the name that `--machine` takes, an unreadable one with its reason; or copy one."""
    act = _copy if options.action == "copy" else _list
    act(options, text)
    return 0


def _list(options: Namespace, text: Catalogue) -> None:
    listed = [_loaded(entry) for entry in list_machines(machines_folder(data_of(options)))]
    show(options, lambda: {"machines": [_fields(each, text) for each in listed]}, lambda: _lines(listed, text))


def _copy(options: Namespace, text: Catalogue) -> None:
    folder = machines_folder(data_of(options))
    source = load_machine(options.source, folder)
    from profiles.machine_copy import copy_machine

    if options.name in {each.name for each in list_machines(folder)}:
        raise ProfileError(Problem(code="machine.name_taken", value=printable(options.name)))
    make_folder(folder)
    made = copy_machine(source, options.name, folder)
    assumed = list(made.machine.assumed)
    facts = {"path": printable(str(made.path)), "name": shlex.quote(printable(options.name))}
    show(
        options,
        lambda: {"name": options.name, "path": str(made.path), "assumed": assumed},
        lambda: [
            text("machines.copied", **facts),
            *(f"  {key}" for key in assumed),
            text("machines.next", **facts),
        ],
    )


def _loaded(entry: LibraryEntry) -> Listed:
    try:
        return entry, load_machine(str(entry.path))
    except ProfileError as error:
        return entry, tuple(error.problems)


def _fields(listed: Listed, text: Catalogue) -> dict[str, object]:
    entry, loaded = listed
    fields: dict[str, object] = {"name": entry.name, "path": str(entry.path), "bundled": entry.bundled}
    if not isinstance(loaded, LoadedMachine):
        return {**fields, "problems": [text.problem(problem) for problem in loaded]}
    machine = loaded.machine
    return {
        **fields,
        "sha256": loaded.sha256,
        "link": machine.link or None,
        "signed_for": machine.safety.signed_for or None,
        "assumed": list(machine.assumed),
        "source": machine.source,
    }


def _lines(listed: list[Listed], text: Catalogue) -> list[str]:
    """Return a row for each machine, then why some cannot be read."""
    rows = [tuple(text(f"machines.{name}") for name in ("name", "link", "signed", "assumed", "source"))]
    rows += [_row(each, text) for each in listed]
    problems = [text.problem(problem) for _, loaded in listed if isinstance(loaded, tuple) for problem in loaded]
    return [*table(rows), *problems]


def _row(listed: Listed, text: Catalogue) -> tuple[str, ...]:
    entry, loaded = listed
    name, origin = printable(entry.name), text("jobs.bundled" if entry.bundled else "jobs.own")
    if not isinstance(loaded, LoadedMachine):
        return (name, text("jobs.unreadable"), "", "", origin)
    machine = loaded.machine
    signed = machine.safety.signed_for
    signed_for = text(f"machines.signed_for.{signed}") if signed else NOTHING
    return (name, machine.link or NOTHING, signed_for, str(len(machine.assumed)), origin)
