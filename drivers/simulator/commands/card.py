"""The card as a whole: saving, resetting, and the password of its programs."""

from __future__ import annotations

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.simulator.commands.handler import Handler
from drivers.simulator.commands.jogs import ALWAYS_ON_LINE
from drivers.simulator.context import Context
from profiles.problem import ProfileError


def _save(_: Scanner, context: Context) -> None:
    try:
        context.controller.flash.save(context.controller)
    except ProfileError as failed:
        raise PmacError(ErrorCode.NO_ROOM, str(failed)) from failed


def _reset(_: Scanner, context: Context) -> None:
    controller = context.controller
    controller.reset()
    controller.password.lock()
    controller.flash.restore(controller)


def _factory_reset(_: Scanner, context: Context) -> None:
    controller = context.controller
    controller.reset(context.dialect.factory)
    controller.variables.pointers.clear()
    controller.password.clear()


def _password(scanner: Scanner, context: Context) -> None:
    """`PASSWORD=text`: everything up to the end of the line, as it was typed."""
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
