"""The command handler: parses its own arguments and acts for the host that sent it."""

from __future__ import annotations

from collections.abc import Callable

from drivers.pmac.language.lexer import Scanner
from drivers.simulator.context import Context

Handler = Callable[[Scanner, Context], None]

LINE_WORK = 16
"""Cost of writing or storing a program line, in variables read."""


def say(report: Callable[[Context], str]) -> Handler:
    """Return a command that replies one line."""

    def command(_: Scanner, context: Context) -> None:
        context.lines.append(report(context))

    return command


def signed_constant(scanner: Scanner) -> float | None:
    """Consume a constant, negative or not; None, with nothing consumed, when there is none at the cursor."""
    start = scanner.mark()
    negative = scanner.accept("-")
    value = scanner.take_number()
    if value is None:
        scanner.reset(start)
        return None
    return -value if negative else value
