"""Commands for the whole controller: saving, resetting, and the password of its programs."""

from __future__ import annotations

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.simulator.card import buffers
from drivers.simulator.commands.handler import LINE_WORK, Handler
from drivers.simulator.commands.jogs import ALWAYS_ON_LINE
from drivers.simulator.context import Context
from profiles.problem import ProfileError


def _save(_: Scanner, context: Context) -> None:
    context.work += _work_of_all(context)
    try:
        context.controller.flash.save(context.controller)
    except ProfileError as failed:
        raise PmacError(ErrorCode.NO_ROOM, str(failed)) from failed


def _reset(_: Scanner, context: Context) -> None:
    context.controller.reset()
    context.work += _work_of_all(context)


def _factory_reset(_: Scanner, context: Context) -> None:
    context.controller.reset(context.dialect.factory)
    context.work += _work_of_all(context)


def _work_of_all(context: Context) -> int:
    """Return the cost of saving, or restoring, the whole state of the controller."""
    controller = context.controller
    kept = len(controller.variables.settings()) + len(controller.variables.pointers)
    return kept + buffers.stored_lines_in(controller) * LINE_WORK


def _password(scanner: Scanner, context: Context) -> None:
    """`PASSWORD=text`: everything up to the end of the line, as typed."""
    scanner.expect("=")
    rest = len(scanner.rest)
    text = context.text[scanner.position :]
    scanner.reset(scanner.mark() + rest)
    context.controller.password.give(text)


WORDS: dict[str, Handler] = {
    **ALWAYS_ON_LINE,
    "SAVE": _save,
    "$$$": _reset,
    "$$$***": _factory_reset,
    "PASSWORD": _password,
}
