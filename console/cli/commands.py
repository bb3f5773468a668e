"""Commands of the console, in the order of its help, as a tree of parsers.

A command is a module with two functions: `add(parser, text)` adds its arguments, `main(options, text)` does the
work and returns the exit code. What it refuses, or what ends a motion, is a `ProblemError`, which the entry point
reports; by then a machine is at rest. Its help is in the text catalogues as `help.NAME` and `help.NAME.long`. The
module is imported when the command is called; slow imports happen in `main`; `--help` needs none.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from console.cli.arguments import LINK, PLANT, add_practice, add_shared, control_address
from console.cli.parser import Parser
from console.rings import SCHOOL, is_installed
from console.text.catalogue import Catalogue

_COMMANDS = {
    "jobs": "console.cli.part.jobs",
    "lessons": "console.school.cli.lessons",
    "tries": "console.school.cli.tries",
    "preview": "console.cli.part.preview",
    "predict": "console.cli.part.predict",
    "program": "console.cli.part.program",
    "study": "console.site.cli.study",
    "check-program": "console.cli.part.check_program",
    "run": "console.cli.machine.run",
    "retract": "console.cli.machine.retract",
    "simulator": "console.cli.machine.simulator",
    "fault": "console.cli.machine.fault",
    "instruct": "console.school.cli.instruct",
    "watch": "console.cli.feed.watch",
    "next": "console.cli.feed.next_step",
    "metrics": "console.site.cli.metrics",
    "mtconnect": "console.site.cli.mtconnect",
    "mqtt": "console.site.cli.mqtt",
    "roundness": "console.cli.measured.roundness",
    "report": "console.cli.measured.report",
    "controller": "console.cli.machine.controller",
    "doctor": "console.cli.machine.doctor",
    "machines": "console.cli.site.machines",
    "gauges": "console.cli.site.gauges",
    "config": "console.cli.site.config",
    "terminal": "console.screens.key_display",
    "backup": "console.cli.site.backup",
    "restore": "console.cli.site.restore",
    "ship": "console.site.cli.ship",
    "deploy": "console.site.cli.deploy",
    "completion": "console.cli.site.completion",
    "identify": "console.cli.machine.identify",
    "health": "console.cli.machine.health",
    "tune": "console.cli.machine.tune",
    "calibrate": "console.cli.measured.calibrate",
    "fingerprint": "console.cli.measured.fingerprint",
    "learn": "console.cli.measured.learn",
    "records": "console.cli.measured.records",
    "reproduce": "console.cli.measured.reproduce",
    "replay": "console.flight.cli.replay",
}
COMMANDS = {name: module for name, module in _COMMANDS.items() if is_installed(module)}

COMMON = ("json", "data", "lang")
"""Options of every command and of every action of one."""

SHOWS_CONFIGURATION = "config"
"""The command that shows also a configuration which every other one refuses."""


def build(text: Catalogue) -> Parser:
    """Return the parser of the whole command line."""
    Parser.text = text
    parser = Parser(prog="console", description=text("help.console"))
    parser.add_argument("--version", action="store_true", help=text("help.version"))
    parser.add_argument("--json", action="store_true", help=text("help.json"))
    parser.add_argument("--sim", action="store_true", help=text("help.screen"))
    _add_schooling(parser, text)
    add_shared(parser, text, "machine", *LINK, "indicator", "data", *PLANT, "lang", absent=None)
    title = text("help.commands")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title=title, parser_class=_CommandParser)
    for name, module in COMMANDS.items():
        described = text(f"help.{name}.long")
        commands.add_parser(name, help=text(f"help.{name}"), description=described).module = module
    return parser


def _add_schooling(parser: Parser, text: Catalogue) -> None:
    if not is_installed(SCHOOL):
        parser.set_defaults(lesson=None, trainee=None, from_file=None, before=None, instructor=None)
    else:
        parser.add_argument("--lesson", metavar="NAME", help=text("help.lesson"))
        parser.add_argument("--trainee", metavar="NAME", help=text("help.trainee"))
        add_practice(parser, text)
    parser.add_argument("--blind", action="store_true", help=text("help.blind"))
    if is_installed(SCHOOL):
        instructor_help = text("help.instructor")
        parser.add_argument("--instructor", metavar="ADDRESS", type=control_address, help=instructor_help)


def add_actions(
    parser: Parser, command: str, names: Iterable[str], text: Catalogue, *, required: bool = True
) -> dict[str, Parser]:
    """Add the actions of a command; return the parser of each. `action` is None where none is given."""
    title = text(f"help.{command}.actions")
    actions = parser.add_subparsers(
        dest="action", metavar="ACTION", title=title, required=required, parser_class=Parser
    )
    return {name: _action(actions, name, f"{command}.{name}", text) for name in names}


def _action(actions: Any, name: str, key: str, text: Catalogue) -> Parser:
    """Return the parser of an action with the common options; its help is under `key`."""
    parser: Parser = actions.add_parser(name, help=text(f"help.{key}"), description=text(f"help.{key}.long"))
    add_shared(parser, text, *COMMON)
    return parser


class _CommandParser(Parser):
    """Parser of a command with the common options, made when it is first asked for anything.

    A call has one command; the screens have none, and their first picture waits for the command line.
    """

    def __init__(self, **facts: Any) -> None:
        self._facts: dict[str, Any] | None = facts

    def __getattr__(self, name: str) -> Any:
        facts = self.__dict__.get("_facts")
        if facts is None:
            raise AttributeError(name)
        self._facts = None
        super().__init__(**facts)
        add_shared(self, self.text, *COMMON)
        return getattr(self, name)
