"""`console machines`: the machine profiles, and a copy of one as the beginning of another machine's."""

from __future__ import annotations

import shlex
from argparse import Namespace

from console.cli.commands import add_actions
from console.cli.library import data_of
from console.cli.output import show
from console.cli.parser import Parser
from console.cli.part.library_list import Listed, fields_of_entry, list_library, sentences
from console.session.data.kept_files import machines_folder, make_folder
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.files import printable
from profiles.problem import Problem, ProfileError
from profiles.store import LoadedMachine, list_machines, load_machine

ACTIONS = ("list", "copy")
NOTHING = "-"


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
    found = list_library(list_machines(machines_folder(data_of(options))), load_machine)
    show(options, lambda: {"machines": [_fields(each, text) for each in found]}, lambda: _lines(found, text))


def _copy(options: Namespace, text: Catalogue) -> None:
    folder = machines_folder(data_of(options))
    source = load_machine(options.source, folder)
    from profiles.store import copy_machine

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


def _fields(each: Listed[LoadedMachine], text: Catalogue) -> dict[str, object]:
    _, loaded = each
    fields = fields_of_entry(each, text)
    if not isinstance(loaded, LoadedMachine):
        return fields
    machine = loaded.machine
    return {
        **fields,
        "sha256": loaded.sha256,
        "link": machine.link or None,
        "signed_for": machine.safety.signed_for or None,
        "assumed": list(machine.assumed),
        "source": machine.source,
    }


def _lines(found: list[Listed[LoadedMachine]], text: Catalogue) -> list[str]:
    """Return a row for each machine, then why some cannot be read."""
    rows = [tuple(text(f"machines.{name}") for name in ("name", "link", "signed", "assumed", "source"))]
    rows += [_row(each, text) for each in found]
    return [*table(rows), *sentences(found, text)]


def _row(each: Listed[LoadedMachine], text: Catalogue) -> tuple[str, ...]:
    entry, loaded = each
    name, origin = printable(entry.name), text("jobs.bundled" if entry.bundled else "jobs.own")
    if not isinstance(loaded, LoadedMachine):
        return (name, text("jobs.unreadable"), "", "", origin)
    machine = loaded.machine
    signed = machine.safety.signed_for
    signed_for = text(f"machines.signed_for.{signed}") if signed else NOTHING
    return (name, machine.link or NOTHING, signed_for, str(len(machine.assumed)), origin)
