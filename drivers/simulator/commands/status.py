"""Status reports, and the functions of control characters, except those that edit the line."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from drivers.pmac.language.lexer import Scanner
from drivers.pmac.status import digits_of
from drivers.simulator.card import reports
from drivers.simulator.card.coordinate import CoordinateSystem
from drivers.simulator.card.motor import Motor
from drivers.simulator.context import ALL_CARDS, Context, Handler, Reading, Step, say

Action = Callable[[Context], str | None]  # the function; it returns the text for the host, None when there is none


def control(letter: str) -> int:
    """Return the code of a control character by its letter."""
    return ord(letter) - 0x40


CONTROL_X = control("X")  # discards pending input and output


def _each(act: Callable[[CoordinateSystem], None]) -> Action:
    return lambda context: context.controller.each_system(act)


def _motors(report: Callable[[Context, Motor], str]) -> Action:

    def action(context: Context) -> str:
        motors, first = context.controller.motors, 8 * context.motor_bank + 1
        return " ".join(report(context, motors[number]) for number in range(first, first + 8))

    return action


def _motor_status(context: Context, motor: Motor) -> str:
    return digits_of(reports.motor_words(context.controller, motor))


def _systems(context: Context) -> str:
    controller = context.controller
    return " ".join(digits_of(reports.system_words(controller, number)) for number in controller.systems)


def _global_status(context: Context) -> str:
    return digits_of(reports.global_words(context.controller, all_cards=context.card_number == ALL_CARDS))


ACTING: Mapping[int, Action] = {
    control("A"): lambda context: context.controller.abort_all(),
    control("D"): lambda context: context.controller.plcs.disable_all(),
    control("K"): lambda context: context.controller.kill_all(),
    control("O"): _each(CoordinateSystem.hold),
    control("Q"): _each(CoordinateSystem.quit),
    control("R"): _each(CoordinateSystem.run),
    control("S"): _each(CoordinateSystem.step),
}
"""They act as soon as they arrive, before every pending line."""

STOPS = (control("A"), control("K"))  # from a host, they also discard pending commands (CMD)

REPORTING: Mapping[int, Action] = {
    control("B"): _motors(_motor_status),
    control("C"): _systems,
    control("F"): _motors(lambda _, motor: reports.following_error(motor)),
    control("G"): _global_status,
    control("P"): _motors(lambda context, motor: reports.position(context.controller, motor)),
    control("V"): _motors(lambda _, motor: reports.velocity(motor)),
}
"""They are answered before every pending line, within the host's share."""

ACTIONS: Mapping[int, Action] = {**ACTING, **REPORTING}  # others have no function, or edit the line itself


def count_marks(scanner: Scanner, text: str) -> int:
    """Consume the further marks of `??` and `???` in a line, up to a space; return their number in all."""
    marks = 1
    while marks < len(_STATUS) and scanner.peek("?") and text[scanner.position - 1] == "?":
        scanner.expect("?")
        marks += 1
    return marks


def _status(scanner: Scanner, reading: Reading) -> Step:
    report = _STATUS[count_marks(scanner, reading.text) - 1]
    return lambda context: context.lines.append(report(context))


_STATUS: tuple[Callable[[Context], str], ...] = (
    lambda context: _motor_status(context, context.motor),
    lambda context: digits_of(reports.system_words(context.controller, context.system_number)),
    _global_status,
)

WORDS: dict[str, Handler] = {"?": _status}

_REPORTED: dict[str, Callable[[Context], str]] = {
    "P": lambda context: reports.position(context.controller, context.motor),
    "V": lambda context: reports.velocity(context.motor),
    "F": lambda context: reports.following_error(context.motor),
}

LETTERS: dict[str, Handler] = {letter: say(report) for letter, report in _REPORTED.items()}
