"""Parse the statements about motion: axis words, modes and times, HOME, PSET, waits and steps."""

from __future__ import annotations

from collections.abc import Mapping

from drivers.pmac.language import syntax
from drivers.pmac.language.expressions import at_data, parse_data
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.reading import Reader, parse_letters, parse_numbers, parse_words

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
