"""`console config`: each setting with where it comes from, and what is wrong in the configuration."""

from __future__ import annotations

import difflib
import os
from argparse import Namespace

from console.cli.configured_options import with_options
from console.cli.library import DEFAULT_MACHINE
from console.cli.output import show
from console.cli.parser import Parser
from console.session.appearance import CHOICES
from console.session.configuration import KEYS, Configuration, Setting, SettingOrigin, variable_of
from console.session.data.kept_files import data_folder
from console.session.errors import SessionError
from console.session.operator import account_name
from console.text.catalogue import Catalogue, language_variable
from console.text.columns import table
from profiles.files import printable

NOTHING = "-"


def add(parser: Parser, text: Catalogue) -> None:
    """Add nothing: the command has only the common options."""


def main(options: Namespace, text: Catalogue) -> int:
    """Show the configuration as this command line would have it; 1 where something in it is refused."""
    found = with_options(options.configuration, options)
    settings = {key: found.settings.get(key) or _built_in(key, text) for key in KEYS}
    problems = [text.problem(problem) for problem in found.problems]
    notes = _notes(found, options, text)
    show(
        options,
        lambda: {
            "settings": {key: _fields(each) for key, each in settings.items()},
            "files": [{"file": str(path), "state": state.value} for path, state in found.files.items()],
            "problems": problems,
            "notes": notes,
        },
        lambda: [*_lines(settings, found, text), *(["", *problems, *notes] if problems or notes else [])],
    )
    return 1 if problems else 0


def _built_in(key: str, text: Catalogue) -> Setting:
    """Return the value of a key that nothing sets; a variable of the system may be where it comes from."""
    value: str | None = None
    variable = ""
    if key == "data":
        variable = "XDG_DATA_HOME" if os.path.isabs(os.environ.get("XDG_DATA_HOME", "")) else ""
        try:
            value = str(data_folder())
        except SessionError:
            value = None  # said by every command that needs it
    elif key == "machine":
        value = DEFAULT_MACHINE
    elif key == "language":
        value, variable = text.language, language_variable(os.environ)
    elif key == "operator":
        value = account_name()
    elif key in CHOICES:
        value = CHOICES[key][0]
    return Setting(
        value=value, origin=SettingOrigin.VARIABLE if variable else SettingOrigin.BUILT_IN, place=variable
    )


def _notes(found: Configuration, options: Namespace, text: Catalogue) -> list[str]:
    """Return what has no effect: variables that mean nothing, and a link that does not count."""
    known = [variable_of(key) for key in KEYS]
    notes = []
    for name in found.unknown:
        near = difflib.get_close_matches(name, known, n=1)
        notes.append(
            text("config.unknown_variable", name=printable(name, 80), limit=(near or [" | ".join(known)])[0])
        )
    aside, link = found.link_set_aside, found.settings.get("link")
    if aside is not None:
        notes.append(text("config.link_set_aside", value=aside.value, place=aside.place))
    if options.sim and link is not None:
        notes.append(text("config.link_simulated", value=link.value, place=link.place))
    return notes


def _fields(setting: Setting) -> dict[str, object]:
    return {"value": setting.value, "origin": setting.origin.value, "place": setting.place}


def _lines(settings: dict[str, Setting], found: Configuration, text: Catalogue) -> list[str]:
    """Return a row for each setting, then the files."""
    head = tuple(text(f"config.{column}") for column in ("setting", "value", "from"))
    rows = [
        (key, each.value or NOTHING, each.place or text(f"config.default.{key}")) for key, each in settings.items()
    ]
    files = [(str(path), text(f"config.state.{state}")) for path, state in found.files.items()]
    return [*table([head, *rows]), "", *table(files)]
