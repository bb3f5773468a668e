"""A parser of command-line arguments that speaks the operator's language, and that a command completes itself."""

from __future__ import annotations

import argparse
import re
import sys
from importlib import import_module
from typing import Any, NoReturn

from console.text.catalogue import Catalogue

_WORDING = (
    (re.compile(r"the following arguments are required: (?P<value>.*)"), "usage.required"),
    (re.compile(r"one of the arguments (?P<value>.*) is required"), "usage.required"),
    (re.compile(r"unrecognized arguments: (?P<value>.*)"), "usage.unrecognized"),
    (
        re.compile(r"argument (?P<key>.*?): invalid choice: (?P<value>.*?) \(choose from (?P<limit>.*)\)"),
        "usage.choice",
    ),
    (re.compile(r"argument (?P<key>.*?): expected one argument"), "usage.value_missing"),
    (re.compile(r"argument (?P<key>.*?): (?P<value>.*)"), "usage.argument"),
)
"""What argparse says, and the sentence of ours for it."""


class _Formatter(argparse.HelpFormatter):
    """The word in front of the usage line in the operator's language."""

    def add_usage(self, usage: Any, actions: Any, groups: Any, prefix: str | None = None) -> None:
        """Add the usage line; argparse gives a prefix of its own only where there is to be none."""
        super().add_usage(usage, actions, groups, Parser.text("help.usage") + " " if prefix is None else prefix)


class Parser(argparse.ArgumentParser):
    """An argument parser that speaks the operator's language, in one line."""

    text: Catalogue
    module = ""
    """The module that adds the arguments of a command, until it has done so."""

    def __init__(self, **facts: Any) -> None:
        """Take the facts of argparse; the titles and the help are in the operator's language."""
        super().__init__(**{"formatter_class": _Formatter, **facts}, add_help=False, allow_abbrev=False)
        self._positionals.title = self.text("help.arguments")
        self._optionals.title = self.text("help.options")
        self.add_argument("-h", "--help", action="help", help=self.text("help.help"))

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse; the parser of a command gets its arguments first."""
        if self.module:
            module, self.module = self.module, ""
            import_module(module).add(self, self.text)
        return super().parse_known_args(args, namespace)

    def print_help(self, file: Any = None) -> None:
        """Print the help; unlike the one of argparse, let the caller know when nobody can read it."""
        (file or sys.stdout).write(self.format_help())

    def error(self, message: str) -> NoReturn:
        """Say what is wrong with the command line, and exit with 2."""
        said = " ".join(message.split())
        for pattern, key in _WORDING:
            match = pattern.fullmatch(said)
            if match:
                said = self.text(key, **match.groupdict())
                break
        print(f"{self.prog}: {said}", file=sys.stderr)
        raise SystemExit(2)
