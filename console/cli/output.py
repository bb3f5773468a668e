"""What a command exchanges with the operator: results as text or JSON, warnings, consent; streams escaped."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from io import TextIOWrapper
from typing import Any, TextIO

from console.escaping import can_write, encodable, escape_text, spell_unencodable
from console.text.catalogue import LANGUAGES, Catalogue
from drivers.clock import OLD_S
from profiles.problem import Problem
from profiles.strict_values import rename_keys

SCHEMA = 1
"""Of every JSON object on stdout; a value that is taken away, or changes its meaning, makes it 2."""

KEPT = 1000  # characters of an output that a stream remembers


class EscapedOutput:
    """Stream in any encoding that escapes what would control the terminal; otherwise the wrapped stream."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.last = ""
        """The end of what was written by this command."""

    def write(self, text: str) -> int:
        """Write a text; return its unescaped length, as streams do."""
        self._stream.write(
            encodable(spell_unencodable(escape_text(text), self._stream.encoding), self._stream.encoding)
        )
        self.last = (self.last + text)[-KEPT:]
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write several texts."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def escape_streams() -> None:
    """Wrap both output streams, once, and pass each line on at once: somebody may follow a cut through a pipe."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if not isinstance(stream, EscapedOutput):
            if isinstance(stream, TextIOWrapper):
                stream.reconfigure(line_buffering=True)
            setattr(sys, name, EscapedOutput(stream))
        else:
            stream.last = ""


def hint_at_encoding(text: Catalogue) -> None:
    """Say how to see the language of the texts if the output cannot show it: question marks say nothing."""
    own_name = text(f"settings.value.language.{text.language}")
    if not can_write(own_name, sys.stdout.encoding):
        remedy = "set LC_ALL=C.UTF-8 (or another UTF-8 locale), or add --lang en"
        name = LANGUAGES[text.language]
        print(f"console: {sys.stdout.encoding} cannot show {name}; {remedy}", file=sys.stderr)


def show(
    options: Namespace, fields: Callable[[], Mapping[str, object]], lines: Callable[[], Iterable[str]]
) -> None:
    """Print a result for people, or with --json as an object; only the form that is printed is worked out."""
    if options.json:
        print_json(fields())
    else:
        print("\n".join(lines()))


def fields_of(source: object, *names: str) -> dict[str, Any]:
    """Return attributes under their own names, for JSON."""
    return {name: getattr(source, name) for name in names}


def harmonics_of(source: Any) -> dict[str, Any]:
    """Return a record with harmonics in it as plain values; JSON calls their phase `crest_deg`."""
    found: dict[str, Any] = rename_keys(asdict(source), {"phase_deg": "crest_deg"})
    return found


def print_json(value: Mapping[str, object]) -> None:
    """Print one JSON object with its schema.

    Numbers are not rounded; there is no NaN in JSON, so none may be in `value`.
    """
    import json  # not for the screens

    value = {"schema": SCHEMA, **value}
    shown = json.dumps(value, ensure_ascii=False, allow_nan=False, indent=2)
    # JSON has its own escapes for what the stream would replace, such as an undecodable file name.
    if encodable(escape_text(shown), sys.stdout.encoding) != shown:
        shown = json.dumps(value, allow_nan=False, indent=2)
    print(shown)


def tell(problems: Iterable[Problem], text: Catalogue) -> list[str]:
    """Print each problem as a warning on stderr, one line each, and return the sentences."""
    warnings = [text.problem(problem) for problem in problems]
    for warning in warnings:
        print(f"console: {text('warning')}: {warning}", file=sys.stderr)
    sys.stderr.flush()
    return warnings


def confirm_motion(
    options: Namespace, machine_name: str, simulated: bool, text: Catalogue, about: str | None = None
) -> bool:
    """Return whether the machine may be moved: with --yes, simulated, or when its name was typed.

    `agreement.ask.ABOUT` is the text of what is about to be done; `about` is the command where none is given.
    """
    if options.yes or simulated:
        return True
    command = options.command
    if not sys.stdin.isatty():
        print(f"console {command}: {text('agreement.nobody_to_ask')}", file=sys.stderr)
        return False
    from console.session.dated_input import read_line  # not for the screens

    typed = read_line(text(f"agreement.ask.{about or command}", machine=machine_name))
    if typed.text.strip() == machine_name and not typed.late:
        return True
    why = text("agreement.late", limit=f"{OLD_S:g} s") if typed.late else text("agreement.not_typed")
    print(f"console {command}: {why}", file=sys.stderr)
    return False


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
