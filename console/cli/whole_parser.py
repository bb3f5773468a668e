"""The parser with the arguments of every command, for what describes them all: completion, the manual page."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from importlib import import_module

from console.cli.commands import build
from console.cli.parser import Parser
from console.text.catalogue import Catalogue


def whole_parser(text: Catalogue, prog: str = "console") -> Parser:
    """Return the parser of the command line with what each command adds; every command is imported."""
    parser = build(text)
    parser.prog = prog
    for command in commands_of(parser).values():
        command.prog = f"{prog} {command.prog.partition(' ')[2]}"  # makes it, too
        if command.module:
            import_module(command.module).add(command, text)
            command.module = ""
    return parser


def commands_of(parser: argparse.ArgumentParser) -> dict[str, Parser]:
    """Return the parsers of commands, or of the actions of one, by name."""
    found = (each for each in parser._actions if isinstance(each, argparse._SubParsersAction))  # noqa: SLF001
    return {name: each for action in found for name, each in action.choices.items()}  # there is no public way


def every_parser(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """Yield a parser and those of all of its commands and actions."""
    yield parser
    for each in commands_of(parser).values():
        yield from every_parser(each)
