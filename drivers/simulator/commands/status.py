"""Status reports, control characters (except those that edit the line), and commands for the whole controller.

The last are identification, saving, resetting, and the password of its programs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.expressions import parse_expression, parse_number, parse_variable
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.status import digits_of
from drivers.simulator.card import buffers, reports
from drivers.simulator.card.coordinate import CoordinateSystem
from drivers.simulator.card.motor import Motor
from drivers.simulator.context import ALL_CARDS, LINE_WORK, Context, Handler, LineContext, Step, act, say
from profiles.problem import ProfileError

Action = Callable[[Context], str | None]  # the function; it returns the text for the host, None when there is none
_SPELLINGS = {"VER": "VERSION", "CHKS": "CHECKSUM"}
_IDENTITIES = (
    *("VERSION", "TYPE", "DATE", "CID", "CPU", "VID", "CHECKSUM", "TIME", "TODAY", "IDNUMBER", "SID"),
    *_SPELLINGS,
)
"""The replies, and which words a family has, are in its dialect."""

_HIGHEST_STATION = 63  # of a MACRO ring


def control(letter: str) -> int:
    """Return the code of a control character by its letter."""
    return ord(letter) - 0x40


CONTROL_X = control("X")  # discards pending input and output


def _for_each_system(act: Callable[[CoordinateSystem], None]) -> Action:
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
    control("O"): _for_each_system(CoordinateSystem.hold),
    control("Q"): _for_each_system(CoordinateSystem.quit),
    control("R"): _for_each_system(CoordinateSystem.run),
    control("S"): _for_each_system(CoordinateSystem.step),
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


def _status(scanner: Scanner, reading: LineContext) -> Step:
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


def _identify(word: str) -> Handler:
    def read(scanner: Scanner, reading: LineContext) -> Step:
        reply = reading.dialect.replies.get(word)
        if reply is None:
            raise PmacError(ErrorCode.DATA_ERROR, f"{word} is no word of this family")
        return lambda context: context.lines.append(reply)

    return read


def _save(context: Context) -> None:
    context.work += _work_of_all(context)
    try:
        context.controller.save()
    except ProfileError as failed:
        raise PmacError(ErrorCode.NO_ROOM, str(failed)) from failed


def _reset(context: Context) -> None:
    context.controller.reset()
    context.work += _work_of_all(context)


def _factory_reset(context: Context) -> None:
    context.controller.reset(context.dialect.factory)
    context.work += _work_of_all(context)


def _work_of_all(context: Context) -> int:
    """Return the cost of saving, or restoring, the whole state of the controller."""
    controller = context.controller
    kept = len(controller.variables.settings()) + len(controller.variables.pointers)
    return kept + buffers.stored_lines_in(controller) * LINE_WORK


def _password(scanner: Scanner, reading: LineContext) -> Step:
    """`PASSWORD=text`: everything up to the end of the line, as typed."""
    scanner.expect("=")
    rest = len(scanner.rest)
    text = reading.text[scanner.position :]
    scanner.reset(scanner.mark() + rest)
    return lambda context: context.controller.password.give(text)


def _ring(scanner: Scanner, reading: LineContext) -> Step:
    """MS, MSR, MSW, MSCLRF: words for a station of a MACRO ring, and there is no ring.

    Raises PmacError: 003, no station; the step, 008, it does not answer.
    """
    parse_number(scanner, 0, _HIGHEST_STATION)
    while scanner.accept(","):
        scanner.accept("M")  # MI910, a variable of the station
        if parse_variable(scanner) is None:
            raise scanner.refusal("a variable as in MS0,I910")
    if scanner.accept("="):
        parse_expression(scanner)

    def step(context: Context) -> None:
        raise PmacError(ErrorCode.MACRO_COMMUNICATION, "there is no MACRO ring")

    return step


CARD_WORDS: dict[str, Handler] = {
    **{word: _identify(_SPELLINGS.get(word, word)) for word in _IDENTITIES},
    # There is no absolute encoder: the motor is killed, and its present position is 0.
    "$*": act(lambda context: context.controller.read_absolute_position(context.active_motor.number)),
    "SAVE": act(_save),
    "$$$": act(_reset),
    "$$$***": act(_factory_reset),
    "PASSWORD": _password,
    **dict.fromkeys(("MS", "MSR", "MSW", "MSCLRF"), _ring),
}
