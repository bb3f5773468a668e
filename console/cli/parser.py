"""Argument parser in the operator's language, completed by each command on demand."""

from __future__ import annotations

import argparse
import os
import re
import sys
from importlib import import_module
from typing import Any, NoReturn

from console.text.catalogue import Catalogue

_WORDING = {
    r"the following arguments are required: (?P<value>.*)": "usage.required",
    r"one of the arguments (?P<value>.*) is required": "usage.required",
    r"unrecognized arguments: (?P<value>.*)": "usage.unrecognized",
    r"argument (?P<key>.*?): invalid choice: (?P<value>.*?) \(choose from (?P<limit>.*)\)": "usage.choice",
    r"argument (?P<key>.*?): expected one argument": "usage.value_missing",
    r"argument (?P<key>.*?): (?P<value>.*)": "usage.argument",
}
"""Messages of argparse, and our sentence for each."""


UNKNOWN_COLUMNS = 80


class _HelpFormatter(argparse.HelpFormatter):
    """Formatter whose usage prefix is in the operator's language."""

    def __init__(self, prog: str) -> None:
        """Set the width, so that argparse need not import `shutil`."""
        super().__init__(prog, width=columns() - 2)

    def add_usage(self, usage: Any, actions: Any, groups: Any, prefix: str | None = None) -> None:
        """Add the usage line; argparse adds its own prefix unless it is given one."""
        super().add_usage(usage, actions, groups, Parser.text("help.usage") + " " if prefix is None else prefix)


def columns() -> int:
    """Return the width of the terminal: that in COLUMNS, else that of the output, 80 where it is none."""
    width = os.environ.get("COLUMNS", "")
    if width.isdecimal() and int(width) > 0:
        return int(width)
    try:
        output = 1 if sys.__stdout__ is None else sys.__stdout__.fileno()
        return os.get_terminal_size(output).columns or UNKNOWN_COLUMNS
    except (ValueError, OSError):  # closed, or no terminal
        return UNKNOWN_COLUMNS


class Parser(argparse.ArgumentParser):
    """Argument parser with one-line errors in the operator's language."""

    text: Catalogue
    module = ""
    """Module that adds the arguments of a command, until it has done so."""

    def __init__(self, **facts: Any) -> None:
        """Take the arguments of argparse; titles and help are in the operator's language."""
        super().__init__(**{"formatter_class": _HelpFormatter, **facts}, add_help=False, allow_abbrev=False)
        self._positionals.title = self.text("help.arguments")
        self._optionals.title = self.text("help.options")
        self.add_argument("-h", "--help", action="help", help=self.text("help.help"))

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse; first let the command add its arguments."""
        if self.module:
            module, self.module = self.module, ""
            import_module(module).add(self, self.text)
        found, left = super().parse_known_args(args, namespace)
        # Words end at the first option for argparse, which leaves over those behind it.
        if isinstance(getattr(found, "words", None), list) and not any(word.startswith("-") for word in left):
            found.words, left = [*found.words, *left], []
        return found, left

    def print_help(self, file: Any = None) -> None:
        """Print the help; unlike argparse, raise write errors to the caller."""
        (file or sys.stdout).write(self.format_help())

    def error(self, message: str) -> NoReturn:
        """Report the usage error, and exit with 2."""
        sentence = " ".join(message.split())
        for pattern, key in _WORDING.items():
            if match := re.fullmatch(pattern, sentence):
                sentence = self.text(key, **self._sentence_facts(match.groupdict()))
                break
        print(f"{self.prog}: {sentence}", file=sys.stderr)
        raise SystemExit(2)

    def _sentence_facts(self, facts: dict[str, str]) -> dict[str, str]:
        """Return what a sentence names; a missing action with those there are."""
        for action in self._actions:
            if action.choices and action.metavar == facts.get("value", ""):
                facts["value"] += f" ({', '.join(map(str, action.choices))})"
        return facts
