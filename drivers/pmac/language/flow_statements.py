"""Parse the statements that determine the next line: loops, branches, labels, jumps and calls."""

from __future__ import annotations

import string
from collections.abc import Mapping

from drivers.pmac.language import syntax
from drivers.pmac.language.expressions import at_data, parse_condition, parse_data
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.reading import Reader, parse_letters

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
