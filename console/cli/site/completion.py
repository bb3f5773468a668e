"""`console completion`: what a shell needs to complete commands and options, made from the parser."""

from __future__ import annotations

from argparse import Namespace

from console.cli.output import show
from console.cli.parser import Parser
from console.text.catalogue import Catalogue, load

SHELLS = ("bash", "zsh", "fish")
NAMES = ("console", "trilobe")
"""Names under which the program is installed."""

FILES, FOLDERS = "FILE", "FOLDER"


def add(parser: Parser, text: Catalogue) -> None:
    """Add the shell, and the name of the program."""
    parser.add_argument("shell", choices=SHELLS, help=text("help.completion_shell"))
    parser.add_argument("--name", choices=NAMES, default=NAMES[0], help=text("help.completion_name"))


def main(options: Namespace, text: Catalogue) -> int:
    """Print the completion of a shell."""
    script = completion_of(options.shell, options.name)
    Parser.text = text  # that of the whole parser was English
    show(options, lambda: {"shell": options.shell, "script": script}, lambda: [script.rstrip("\n")])
    return 0


def completion_of(shell: str, name: str) -> str:
    """Return the script of a shell; its descriptions are in English, as the names of the options."""
    import shtab  # not for any other command

    from console.cli.whole_parser import commands_of, every_parser, whole_parser

    text = load("en")
    parser = whole_parser(text, name)
    for command, commanded in commands_of(parser).items():
        commanded.description = text(f"help.{command}")  # shells show a line, not the whole description
        for name_of_action, acted in commands_of(commanded).items():
            acted.description = text(f"help.{command}.{name_of_action}")
    for each in every_parser(parser):
        for action in each._actions:  # noqa: SLF001 - argparse has no public way to them
            named = str(action.metavar or "")
            if named.startswith((FILES, FOLDERS)):
                action.complete = shtab.FILE if named.startswith(FILES) else shtab.DIRECTORY  # type: ignore[attr-defined]
    script: str = shtab.complete(parser, shell)
    return script
