"""Parse the statements that determine the next line: loops, branches, labels, jumps and calls."""

from __future__ import annotations

import string
from collections.abc import Mapping

from drivers.pmac.language import syntax
from drivers.pmac.language.expressions import (
    HIGHEST_PLC,
    Reader,
    at_data,
    parse_condition,
    parse_data,
    parse_letters,
    parse_numbers,
    parse_words,
)
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.syntax import Message, PlcSwitch

HIGHEST_LABEL = 2**18 - 1

CODES = ("G", "M", "T", "D")
"""The letters of calls of programs 1000, 1001, 1002 and 1003."""

READABLE = tuple(letter for letter in string.ascii_uppercase if letter not in "NO")
"""The letters that READ can ask for."""

ARGUMENTS = ("E", "H", "L", "P", "Q")
"""The letters that are a statement only after a call."""

_ENDS: Mapping[str, syntax.Statement] = {
    **dict.fromkeys(("ENDWHILE", "ENDW"), syntax.EndWhile()),
    **dict.fromkeys(("ENDIF", "ENDI"), syntax.EndIf()),
    **dict.fromkeys(("RETURN", "RET"), syntax.Return()),
}


def parse_argument(scanner: Scanner) -> syntax.Argument | None:
    """Parse a letter with a value that is not a statement of its own, such as the P of `G4 P2000`.

    None, with nothing consumed, if there is none at the cursor.

    Raises:
        PmacError: 003, the letter is not followed by data.
    """
    letter = scanner.take_word(ARGUMENTS)
    return None if letter is None else syntax.Argument(letter, parse_data(scanner))


def parse_enclosed_condition(scanner: Scanner) -> syntax.Condition:
    """Parse a condition with the parentheses around the whole.

    Raises:
        PmacError: 003, something else is there.
    """
    scanner.expect("(")
    condition = parse_condition(scanner)
    scanner.expect(")")
    return condition


def _while(scanner: Scanner, word: str) -> syntax.While:
    condition = parse_enclosed_condition(scanner)
    return syntax.While(condition, inline=not scanner.at_end)


def _if(scanner: Scanner, word: str) -> syntax.If:
    condition = parse_enclosed_condition(scanner)
    return syntax.If(condition, inline=not scanner.at_end)


def _label(scanner: Scanner, word: str) -> syntax.Label | None:
    number = scanner.take_integer()
    if number is None:
        return None
    if number > HIGHEST_LABEL:
        raise scanner.refusal(f"label {number}, 0 to {HIGHEST_LABEL}")
    return syntax.Label(number)


def _code(scanner: Scanner, word: str) -> syntax.CallProgram | None:
    """Exclude `M1` before a comma, a point, an arrow or an equals sign: an on-line command about variables."""
    if not at_data(scanner):
        return None
    target = parse_data(scanner)
    return None if scanner.peek(".,-=") else syntax.CallProgram(target, code=word)


def _spindle(scanner: Scanner, word: str) -> syntax.Argument | None:
    return syntax.Argument(word, parse_data(scanner)) if at_data(scanner) else None


FLOW_READERS: Mapping[str, Reader] = {
    "WHILE": _while,
    "IF": _if,
    "ELSE": lambda scanner, word: syntax.Else(inline=not scanner.at_end),
    **dict.fromkeys(_ENDS, lambda scanner, word: _ENDS[word]),
    **dict.fromkeys(("N", "O"), _label),
    "GOTO": lambda scanner, word: syntax.Goto(parse_data(scanner)),
    "GOSUB": lambda scanner, word: syntax.Gosub(parse_data(scanner)),
    "CALL": lambda scanner, word: syntax.CallProgram(parse_data(scanner)),
    **dict.fromkeys(CODES, _code),
    "READ": lambda scanner, word: syntax.Read(parse_letters(scanner, READABLE)),
    "S": _spindle,
}


PORTS = ("S", "P", "R", "A")
"""Serial, parallel, dual-ported RAM, auxiliary serial."""

_CONTROL = 0x40
"""Offset of a control character from its letter."""

_LETTERS = tuple(string.ascii_uppercase)
_SWITCHES = {"ENABLEPLC": True, "ENAPLC": True, "DISABLEPLC": False, "DISPLC": False}
_TALKERS = {"COMMAND": "CMD", "CMD": "CMD", "SEND": "SEND"}
_WITH_PORT = {f"{word}{port}": (name, port) for word, name in _TALKERS.items() for port in ("", *PORTS)}


def is_control(text: str) -> bool:
    """Whether a text is one of the control characters that are written `^A` to `^Z`."""
    return len(text) == 1 and chr(ord(text) + _CONTROL) in _LETTERS


def control_letter(text: str) -> str:
    """Return the A of `^A`."""
    return chr(ord(text) + _CONTROL)


def _talk(scanner: Scanner, word: str) -> Message | None:
    name, port = _WITH_PORT[word]
    if scanner.accept("^"):
        letter = scanner.take_word(_LETTERS)
        if letter is None:
            raise scanner.refusal("expected a letter as in CMD^A")
        return Message(name, chr(ord(letter) - _CONTROL), port)
    return Message(name, _text(scanner), port) if scanner.peek('"') else None


def _display(scanner: Scanner, word: str) -> Message:
    place = scanner.take_integer()
    return Message("DISPLAY", _text(scanner), place=place)


def _text(scanner: Scanner) -> str:
    text = scanner.take_string()
    if text is None:
        raise scanner.refusal("expected a text in quotes")
    if not text.isprintable():
        raise scanner.refusal("control characters stand outside of quotes, as in CMD^A")
    return text


def _switch(scanner: Scanner, word: str) -> PlcSwitch:
    return PlcSwitch(_SWITCHES[word], parse_numbers(scanner, 0, HIGHEST_PLC))


MESSAGE_READERS: Mapping[str, Reader] = {
    **dict.fromkeys(_WITH_PORT, _talk),
    **dict.fromkeys(("DISPLAY", "DISP"), _display),
    **dict.fromkeys(_SWITCHES, _switch),
}


HIGHEST_MOTOR = 32
"""The motors of the largest family; a missing motor is detected when the line is executed."""

_RADIUS = "R"
_SETTINGS = ("TA", "TS", "TM", "F", "PVT")
_WAITS = {"DWELL": "DWELL", "DWE": "DWELL", "DELAY": "DELAY", "DLY": "DELAY"}
_HOMES = {"HOME": False, "HM": False, "HOMEZ": True, "HMZ": True}
_MODES = {
    "LINEAR": "LINEAR",
    "LIN": "LINEAR",
    "RAPID": "RAPID",
    "RPD": "RAPID",
    "SPLINE1": "SPLINE1",
    "SPLINE2": "SPLINE2",
    "CIRCLE1": "CIRCLE1",
    "CIR1": "CIRCLE1",
    "CIRCLE2": "CIRCLE2",
    "CIR2": "CIRCLE2",
}
_PLAIN: Mapping[str, syntax.Statement] = {
    **{word: syntax.SelectMode(mode) for word, mode in _MODES.items()},
    "NOFRAX": syntax.Feedrate(none=True),
    "WAIT": syntax.Pause(),
    "STOP": syntax.Stop(),
    **dict.fromkeys(("BLOCKSTART", "BSTART"), syntax.Block(begins=True)),
    **dict.fromkeys(("BLOCKSTOP", "BSTOP"), syntax.Block(begins=False)),
}


def _set(scanner: Scanner, word: str) -> syntax.Set | None:
    return syntax.Set(word, parse_data(scanner)) if at_data(scanner) else None


def _axis(scanner: Scanner, word: str) -> syntax.Move | None:
    if not at_data(scanner):
        return None
    value = parse_data(scanner)
    velocity = parse_data(scanner) if scanner.accept(":") else None
    return syntax.Move((syntax.AxisWord(word, value, velocity),))


def _vector(scanner: Scanner, word: str) -> syntax.Move | None:
    """Exclude `I100` before a comma, a point or a sign: an on-line query of variables (`I130..135`)."""
    if not at_data(scanner):
        return None
    value = parse_data(scanner)
    return None if scanner.peek(".,-=") else syntax.Move((syntax.AxisWord(word, value),))


def _wait(scanner: Scanner, word: str) -> syntax.Wait | None:
    return syntax.Wait(_WAITS[word], parse_data(scanner)) if at_data(scanner) else None


def _positioning(scanner: Scanner, word: str) -> syntax.Positioning:
    axes = parse_letters(scanner, (*syntax.AXES, _RADIUS)) if scanner.peek("(") else ()
    return syntax.Positioning(word == "INC", axes)


def _feedrate(scanner: Scanner, word: str) -> syntax.Feedrate:
    return syntax.Feedrate(parse_letters(scanner, syntax.AXES) if scanner.peek("(") else ())


def _normal(scanner: Scanner, word: str) -> syntax.Normal:
    words = parse_words(scanner, syntax.VECTOR)
    if not words:
        raise scanner.refusal("expected a vector as in NORMAL K-1")
    return syntax.Normal(words)


def _preset(scanner: Scanner, word: str) -> syntax.Preset:
    words = parse_words(scanner, syntax.AXES)
    if not words:
        raise scanner.refusal("expected axes with positions as in PSET X0")
    return syntax.Preset(words)


def _home(scanner: Scanner, word: str) -> syntax.Home | None:
    """Require motors: without them it is the on-line command."""
    if not scanner.peek("0123456789$"):
        return None
    return syntax.Home(parse_numbers(scanner, 1, HIGHEST_MOTOR), zero=_HOMES[word])


MOTION_READERS: Mapping[str, Reader] = {
    **dict.fromkeys(_SETTINGS, _set),
    **dict.fromkeys(syntax.AXES, _axis),
    **dict.fromkeys((*syntax.VECTOR, _RADIUS), _vector),
    **dict.fromkeys(_WAITS, _wait),
    **dict.fromkeys(_HOMES, _home),
    **dict.fromkeys(("ABS", "INC"), _positioning),
    **dict.fromkeys(("NORMAL", "NRM"), _normal),
    **dict.fromkeys(_PLAIN, lambda scanner, word: _PLAIN[word]),
    "FRAX": _feedrate,
    "PSET": _preset,
}
