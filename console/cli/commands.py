"""Commands of the console, in the order of its help, as a tree of parsers.

A command is a module with two functions: `add(parser, text)` adds its arguments, `main(options, text)` does the
work and returns the exit code. Its help is in the text catalogues as `help.NAME` and `help.NAME.long`. The
module is imported when the command is called; slow imports happen in `main`; `--help` needs none.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from typing import TypeAlias

from console.cli.arguments import BEFORE, add_data, add_language, add_link, add_machine, add_plant
from console.cli.parser import Parser
from console.text.catalogue import Catalogue

COMMANDS = {
    "jobs": "console.cli.part.jobs",
    "preview": "console.cli.part.preview",
    "predict": "console.cli.part.predict",
    "program": "console.cli.part.program",
    "check-program": "console.cli.part.check_program",
    "run": "console.cli.machine.run",
    "simulator": "console.cli.machine.simulator",
    "fault": "console.cli.machine.fault",
    "roundness": "console.cli.measured.roundness",
    "controller": "console.cli.machine.controller",
    "doctor": "console.cli.machine.doctor",
    "identify": "console.cli.machine.identify",
    "calibrate": "console.cli.measured.calibrate",
    "learn": "console.cli.measured.learn",
    "reproduce": "console.cli.measured.reproduce",
}

# argparse has no public name for what add_subparsers returns.
_Commands: TypeAlias = "argparse._SubParsersAction[Parser]"  # noqa: SLF001


def build(text: Catalogue) -> Parser:
    """Return the parser of the whole command line."""
    Parser.text = text
    parser = Parser(prog="console", description=text("help.console"))
    parser.add_argument("--version", action="store_true", help=text("help.version"))
    parser.add_argument("--json", action="store_true", help=text("help.json"))
    parser.add_argument("--sim", action="store_true", help=text("help.screen"))
    add_machine(parser, text, absent=None)
    add_link(parser, text, absent=None)
    add_data(parser, text, absent=None)
    add_plant(parser, text, absent=None)
    add_language(parser, text)
    title = text("help.commands")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title=title, parser_class=Parser)
    for name, module in COMMANDS.items():
        _command(commands, name, name, text).module = module
    return parser


def add_actions(parser: Parser, command: str, names: Iterable[str], text: Catalogue) -> dict[str, Parser]:
    """Add the actions of a command; return the parser of each."""
    title = text(f"help.{command}.actions")
    actions = parser.add_subparsers(
        dest="action", metavar="ACTION", title=title, required=True, parser_class=Parser
    )
    return {name: _command(actions, name, f"{command}.{name}", text) for name in names}


def _command(commands: _Commands, name: str, key: str, text: Catalogue) -> Parser:
    """Return the parser of a command with the common options; its help is under `key`."""
    parser: Parser = commands.add_parser(name, help=text(f"help.{key}"), description=text(f"help.{key}.long"))
    parser.add_argument("--json", action="store_true", default=BEFORE, help=text("help.json"))
    add_data(parser, text)
    add_language(parser, text)
    return parser
