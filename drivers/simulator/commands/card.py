"""Commands for the whole controller: identification, saving, resetting, and the password of its programs."""

from __future__ import annotations

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.expressions import parse_expression, parse_variable
from drivers.pmac.language.lexer import Scanner
from drivers.simulator.card import buffers
from drivers.simulator.context import LINE_WORK, Context, Handler, Reading, Step, act
from profiles.problem import ProfileError

_SPELLINGS = {"VER": "VERSION", "CHKS": "CHECKSUM"}
_IDENTITIES = (
    *("VERSION", "TYPE", "DATE", "CID", "CPU", "VID", "CHECKSUM", "TIME", "TODAY", "IDNUMBER", "SID"),
    *_SPELLINGS,
)
"""The replies, and which words a family has, are in its dialect."""

_HIGHEST_STATION = 63  # of a MACRO ring


def _identify(word: str) -> Handler:
    def read(scanner: Scanner, reading: Reading) -> Step:
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


def _password(scanner: Scanner, reading: Reading) -> Step:
    """`PASSWORD=text`: everything up to the end of the line, as typed."""
    scanner.expect("=")
    rest = len(scanner.rest)
    text = reading.text[scanner.position :]
    scanner.reset(scanner.mark() + rest)
    return lambda context: context.controller.password.give(text)


def _ring(scanner: Scanner, reading: Reading) -> Step:
    """MS, MSR, MSW, MSCLRF: words for a station of a MACRO ring, and there is no ring.

    Raises PmacError: 003, no station; the step, 008, it does not answer.
    """
    station = scanner.take_integer()
    if station is None or station > _HIGHEST_STATION:
        raise scanner.refusal(f"a station as in MS0,I910, 0 to {_HIGHEST_STATION}")
    while scanner.accept(","):
        scanner.accept("M")  # MI910, a variable of the station
        if parse_variable(scanner) is None:
            raise scanner.refusal("a variable as in MS0,I910")
    if scanner.accept("="):
        parse_expression(scanner)

    def step(context: Context) -> None:
        raise PmacError(ErrorCode.MACRO_COMMUNICATION, "there is no MACRO ring")

    return step


WORDS: dict[str, Handler] = {
    **{word: _identify(_SPELLINGS.get(word, word)) for word in _IDENTITIES},
    # There is no absolute encoder: the motor is killed, and its present position is 0.
    "$*": act(lambda context: context.controller.read_absolute_position(context.active_motor.number)),
    "SAVE": act(_save),
    "$$$": act(_reset),
    "$$$***": act(_factory_reset),
    "PASSWORD": _password,
    **dict.fromkeys(("MS", "MSR", "MSW", "MSCLRF"), _ring),
}
