"""Status reports of a motor, a coordinate system and the controller."""

from __future__ import annotations

from collections.abc import Callable

from drivers.pmac.language.lexer import Scanner
from drivers.simulator.card import reports
from drivers.simulator.commands.handler import Handler, say
from drivers.simulator.context import Context


def _status(scanner: Scanner, context: Context) -> None:
    """`?` of the motor, `??` of the coordinate system, `???` of the controller. A space separates them."""
    marks = 1
    while marks < len(_REPORTS) and scanner.peek("?") and context.text[scanner.position - 1] == "?":
        scanner.expect("?")
        marks += 1
    context.lines.append(_REPORTS[marks - 1](context))


_REPORTS: tuple[Callable[[Context], str], ...] = (
    lambda context: reports.motor_status(context.controller, context.motor),
    lambda context: reports.system_status(context.controller, context.system_number),
    lambda context: reports.global_status(context.controller, all_cards=context.all_cards),
)

WORDS: dict[str, Handler] = {"?": _status}

LETTERS: dict[str, Handler] = {
    "P": say(lambda context: reports.position(context.controller, context.motor)),
    "V": say(lambda context: reports.velocity(context.motor)),
    "F": say(lambda context: reports.following_error(context.motor)),
}
