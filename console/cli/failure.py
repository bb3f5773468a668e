"""A command with --json that fails: what is wrong as one JSON object, beside the lines for people on stderr."""

from __future__ import annotations

import sys
from collections.abc import Iterable

from console.cli.output import EscapedOutput, fields_of, print_json
from console.text.catalogue import Catalogue
from profiles.problem import Problem

WRONG_USAGE = 2
USAGE, FAILED = "usage", "failed"
"""Codes of what is no `Problem`: a wrong command line, and any other failure."""


def print_failure(code: int, problems: Iterable[Problem], text: Catalogue) -> None:
    """Print why a command has ended with this exit code, unless it has printed its result."""
    if isinstance(sys.stdout, EscapedOutput) and sys.stdout.last:
        return
    errors = [
        {"text": text.problem(each), **fields_of(each, "code", "where", "key", "value", "limit")}
        for each in problems
    ]
    if not errors:
        kind = USAGE if code == WRONG_USAGE else FAILED
        errors = [{"text": _last_line(), "code": kind, "where": "", "key": "", "value": "", "limit": ""}]
    print_json({"exit_code": code, "errors": errors})


def _last_line() -> str:
    """Return what was said last on stderr, without the name of the program."""
    said = sys.stderr.last.strip() if isinstance(sys.stderr, EscapedOutput) else ""
    line = said.rpartition("\n")[2]
    head, colon, rest = line.partition(": ")
    return rest if colon and head.split(" ")[0] == "console" else line
