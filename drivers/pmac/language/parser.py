"""Parse the lines of a motion program: text in, statements out, or a refusal."""

from __future__ import annotations

import string
from collections.abc import Callable, Iterable, Iterator, Mapping

from drivers.pmac.language import syntax
from drivers.pmac.language.expressions import (
    HIGHEST_PLC,
    at_data,
    parse_condition,
    parse_data,
    parse_expression,
    parse_letters,
    parse_numbers,
    parse_variable,
    parse_words,
)
from drivers.pmac.language.lexer import Scanner, longest_of
from drivers.pmac.language.syntax import Assign, CallProgram, Line, Statement, VariableKind

_Modal = syntax.Set | syntax.SelectMode | syntax.Positioning | syntax.Feedrate
_Gathered = syntax.Move | syntax.Assign | syntax.Argument | _Modal


def gather_moves(statements: Iterable[syntax.Statement]) -> syntax.Line:
    """Join the axis words of a line into moves: axes named on one line move together.

    Modal words (F, TM, INC ...) apply to the moves of their line wherever they are, and so come first. An
    assignment between the axis words of a move comes before the move, one after them after it. A repeated axis
    letter starts a second move; a wait or a flow word ends a move and what belongs to it. After a call the words
    are arguments and keep their order; only neighbours are joined.
    """
    gathered: list[syntax.Statement] = []
    stretch: list[syntax.Statement] = []
    called = False
    for statement in statements:
        if isinstance(statement, _Gathered):
            stretch.append(statement)
            continue
        gathered += [*(_join_words(stretch) if called else _arrange_statements(stretch)), statement]
        stretch.clear()
        called = isinstance(statement, syntax.CallProgram)
    return (*gathered, *(_join_words(stretch) if called else _arrange_statements(stretch)))


def may_be_argument(statement: syntax.Statement) -> bool:
    """Whether a statement after a call belongs to the line of the call: READ may take it, or what follows it."""
    return isinstance(statement, _Gathered | syntax.CallProgram)


def _arrange_statements(stretch: list[syntax.Statement]) -> list[syntax.Statement]:
    last_modal = max((i for i, statement in enumerate(stretch) if isinstance(statement, _Modal)), default=-1)
    # Assignments before a modal word keep their place before it, as in `P1=5 F(P1)`.
    arranged: list[syntax.Statement] = [
        statement for statement in stretch[: last_modal + 1] if not isinstance(statement, syntax.Move)
    ]
    words: list[syntax.AxisWord] = []
    behind: list[syntax.Statement] = []
    for place, statement in enumerate(stretch):
        if isinstance(statement, syntax.Move):
            for word in statement.words:
                if _repeats(word, words):
                    arranged.append(syntax.Move(tuple(words)))
                    words.clear()
                arranged += behind
                behind.clear()
                words.append(word)
        elif place > last_modal:
            behind.append(statement)
    if words:
        arranged.append(syntax.Move(tuple(words)))
    return arranged + behind


def _join_words(stretch: list[syntax.Statement]) -> list[syntax.Statement]:
    joined: list[syntax.Statement] = []
    for statement in stretch:
        if not isinstance(statement, syntax.Move):
            joined.append(statement)
            continue
        for word in statement.words:
            last = joined[-1] if joined else None
            if isinstance(last, syntax.Move) and not _repeats(word, last.words):
                joined[-1] = syntax.Move((*last.words, word))
            else:
                joined.append(syntax.Move((word,)))
    return joined


def _repeats(word: syntax.AxisWord, earlier: Iterable[syntax.AxisWord]) -> bool:
    return any(word.axis == other.axis for other in earlier)


Reader = Callable[[Scanner, str], syntax.Statement | None]
"""Parses what follows its word; None when that does not make a statement."""

HIGHEST_LABEL = 2**18 - 1

HIGHEST_MOTOR = 32  # The motors of the largest family; a missing motor is detected when the line is executed
CODES = ("G", "M", "T", "D")  # The letters of calls of programs 1000, 1001, 1002 and 1003

READABLE = tuple(letter for letter in string.ascii_uppercase if letter not in "NO")
"""The letters that READ can ask for."""

ARGUMENTS = ("E", "H", "L", "P", "Q")  # The letters that are a statement only after a call
PORTS = ("S", "P", "R", "A")  # Serial, parallel, dual-ported RAM, auxiliary serial
_CONTROL = 0x40  # Offset of a control character from its letter

_LETTERS = tuple(string.ascii_uppercase)
_RADIUS = "R"
_WAITS = {"DWELL": "DWELL", "DWE": "DWELL", "DELAY": "DELAY", "DLY": "DELAY"}
_HOMES = {"HOME": False, "HM": False, "HOMEZ": True, "HMZ": True}
_SWITCHES = {  # word: on, keeping the place
    **dict.fromkeys(("ENABLEPLC", "ENAPLC"), (True, False)),
    **dict.fromkeys(("DISABLEPLC", "DISPLC"), (False, False)),
    **dict.fromkeys(("PAUSEPLC", "PAUPLC"), (False, True)),
    **dict.fromkeys(("RESUMEPLC", "RESPLC"), (True, True)),
}
_TALKERS = {"COMMAND": "CMD", "CMD": "CMD", "SEND": "SEND"}
_WITH_PORT = {f"{word}{port}": (name, port) for word, name in _TALKERS.items() for port in ("", *PORTS)}
_SHORT_MODES = {"LIN": "LINEAR", "RPD": "RAPID", "CIR1": "CIRCLE1", "CIR2": "CIRCLE2"}
_MODES = ("LINEAR", "RAPID", "SPLINE1", "SPLINE2", "CIRCLE1", "CIRCLE2", *_SHORT_MODES)
_FIXED: Mapping[str, syntax.Statement] = {
    **dict.fromkeys(("ENDWHILE", "ENDW"), syntax.EndWhile()),
    **dict.fromkeys(("ENDIF", "ENDI"), syntax.EndIf()),
    **dict.fromkeys(("RETURN", "RET"), syntax.Return()),
    **{word: syntax.SelectMode(_SHORT_MODES.get(word, word)) for word in _MODES},
    "NOFRAX": syntax.Feedrate(none=True),
    "WAIT": syntax.Pause(),
    "STOP": syntax.Stop(),
    **dict.fromkeys(("BLOCKSTART", "BSTART"), syntax.Block(begins=True)),
    **dict.fromkeys(("BLOCKSTOP", "BSTOP"), syntax.Block(begins=False)),
}
"""The words that are a whole statement."""


def parse_argument(scanner: Scanner) -> syntax.Argument | None:
    """Parse a letter with a value that is not a statement of its own, such as the P of `G4 P2000`.

    None, with nothing consumed, if there is none at the cursor.

    Raises PmacError: 003, the letter is not followed by data.
    """
    letter = scanner.take_word(ARGUMENTS)
    return None if letter is None else syntax.Argument(letter, parse_data(scanner))


def parse_enclosed_condition(scanner: Scanner) -> syntax.Condition:
    """Parse a condition with the parentheses around the whole.

    Raises PmacError: 003, something else is there.
    """
    scanner.expect("(")
    condition = parse_condition(scanner)
    scanner.expect(")")
    return condition


def is_control(text: str) -> bool:
    """Whether a text is one of the control characters that are written `^A` to `^Z`."""
    return len(text) == 1 and control_letter(text) in _LETTERS


def control_letter(text: str) -> str:
    """Return the A of `^A`."""
    return chr(ord(text) + _CONTROL)


def _branch(scanner: Scanner, word: str) -> syntax.While | syntax.If:
    condition = parse_enclosed_condition(scanner)
    inline = not scanner.at_end
    return syntax.While(condition, inline) if word == "WHILE" else syntax.If(condition, inline)


def _label(scanner: Scanner, word: str) -> syntax.Label | None:
    number = scanner.take_integer()
    if number is None:
        return None
    if number > HIGHEST_LABEL:
        raise scanner.refusal(f"label {number}, 0 to {HIGHEST_LABEL}")
    return syntax.Label(number)


def _with_data(make: Callable[[str, syntax.Expression], syntax.Statement]) -> Reader:
    """Return the reader of a word that is a statement with a value, and none without."""
    return lambda scanner, word: make(word, parse_data(scanner)) if at_data(scanner) else None


def _unless_online(make: Callable[[str, syntax.Expression], syntax.Statement]) -> Reader:
    """Return the reader of a letter that has another meaning on-line, before a comma, a point or a sign.

    `M1,` `M1->` and `M1=` are about variables, and so is `I130..135`.
    """

    def read(scanner: Scanner, word: str) -> syntax.Statement | None:
        if not at_data(scanner):
            return None
        value = parse_data(scanner)
        return None if scanner.peek(".,-=") else make(word, value)

    return read


def _talk(scanner: Scanner, word: str) -> syntax.Message | None:
    name, port = _WITH_PORT[word]
    if scanner.accept("^"):
        letter = scanner.take_word(_LETTERS)
        if letter is None:
            raise scanner.refusal("expected a letter as in CMD^A")
        return syntax.Message(name, chr(ord(letter) - _CONTROL), port)
    return syntax.Message(name, _text(scanner), port) if scanner.peek('"') else None


def _text(scanner: Scanner) -> str:
    text = scanner.take_string()
    if text is None:
        raise scanner.refusal("expected a text in quotes")
    if not text.isprintable():
        raise scanner.refusal("control characters stand outside of quotes, as in CMD^A")
    return text


def _axis(scanner: Scanner, word: str) -> syntax.Move | None:
    if not at_data(scanner):
        return None
    value = parse_data(scanner)
    if scanner.accept("^"):
        return syntax.Move((syntax.AxisWord(word, value, past_trigger=parse_data(scanner)),))
    velocity = parse_data(scanner) if scanner.accept(":") else None
    return syntax.Move((syntax.AxisWord(word, value, velocity),))


def _positioning(scanner: Scanner, word: str) -> syntax.Positioning:
    axes = parse_letters(scanner, (*syntax.AXES, _RADIUS)) if scanner.peek("(") else ()
    return syntax.Positioning(word == "INC", axes)


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


def _home(scanner: Scanner, word: str) -> syntax.HomeMotors | None:
    """Require motors: without them it is the on-line command."""
    if not scanner.peek("0123456789$"):
        return None
    return syntax.HomeMotors(parse_numbers(scanner, 1, HIGHEST_MOTOR), zero=_HOMES[word])


MESSAGE_READERS: Mapping[str, Reader] = {
    **dict.fromkeys(_WITH_PORT, _talk),
    **dict.fromkeys(
        ("DISPLAY", "DISP"),
        lambda scanner, word: syntax.Message("DISPLAY", place=scanner.take_integer(), text=_text(scanner)),
    ),
    **dict.fromkeys(
        _SWITCHES,
        lambda scanner, word: syntax.PlcSwitch(
            _SWITCHES[word][0], parse_numbers(scanner, 0, HIGHEST_PLC), keeping=_SWITCHES[word][1]
        ),
    ),
}

_READERS: Mapping[str, Reader] = {
    **MESSAGE_READERS,
    **dict.fromkeys(_FIXED, lambda scanner, word: _FIXED[word]),
    **dict.fromkeys(("WHILE", "IF"), _branch),
    "ELSE": lambda scanner, word: syntax.Else(inline=not scanner.at_end),
    **dict.fromkeys(("N", "O"), _label),
    "GOTO": lambda scanner, word: syntax.Goto(parse_data(scanner)),
    **dict.fromkeys(("GOSUB", "GOS"), lambda scanner, word: syntax.Gosub(parse_data(scanner))),
    "CALL": lambda scanner, word: syntax.CallProgram(parse_data(scanner)),
    **dict.fromkeys(CODES, _unless_online(lambda word, value: syntax.CallProgram(value, code=word))),
    "READ": lambda scanner, word: syntax.Read(parse_letters(scanner, READABLE)),
    "S": _with_data(syntax.Argument),
    **dict.fromkeys(("TA", "TS", "TM", "F", "PVT"), _with_data(syntax.Set)),
    **dict.fromkeys(_WAITS, _with_data(lambda word, value: syntax.Wait(_WAITS[word], value))),
    **dict.fromkeys(syntax.AXES, _axis),
    **dict.fromkeys(
        (*syntax.VECTOR, _RADIUS), _unless_online(lambda word, value: syntax.Move((syntax.AxisWord(word, value),)))
    ),
    **dict.fromkeys(_HOMES, _home),
    **dict.fromkeys(("ABS", "INC"), _positioning),
    **dict.fromkeys(("NORMAL", "NRM"), _normal),
    "FRAX": lambda scanner, word: syntax.Feedrate(
        parse_letters(scanner, syntax.AXES) if scanner.peek("(") else ()
    ),
    "PSET": _preset,
}


_WORDS = longest_of(tuple(_READERS))
WORDS = tuple(word for word in _READERS if len(word) > 1)
"""The words of motion programs, without the single letters that have another meaning on-line."""
_COMBINING = {"==": "", "&=": "&", "|=": "|", "^=": "^"}  # The signs of assignments that wait for the next move


def parse_line(text: str) -> Line:
    """Parse one line that is meant for a program buffer; a blank line or a comment is the empty line.

    The axis words of a line are one move, see `gather_moves`. Raises PmacError 003: something on the line
    is not a statement of a motion program; 004: a character above 127 outside a comment.
    """
    return gather_moves(statements_of(Scanner(text)))


def statements_of(scanner: Scanner) -> Iterator[Statement]:
    """Yield the statements of a line in the order in which they stand. Raises as `parse_line` does."""
    after_call = False
    while not scanner.at_end:
        statement = parse_statement(scanner)
        if statement is None and after_call:
            statement = parse_argument(scanner)
        if statement is None:
            raise scanner.refusal("no statement of a motion program")
        yield statement
        after_call = isinstance(statement, CallProgram) or (after_call and may_be_argument(statement))


def parse_statement(scanner: Scanner) -> Statement | None:
    """Parse one statement; None, with nothing consumed, if there is none at the cursor.

    A single axis word is returned as a move of its own, for `gather_moves` to join. A letter that is a word only
    with a value (`F`, `A`, `P1`) is no statement without it, so that a caller can try the on-line commands next.
    Raises PmacError 003: a statement that begins well and is malformed later.
    """
    mark = scanner.mark()
    statement = _assign(scanner)
    if statement is not None:
        return statement
    scanner.reset(mark)
    word = scanner.take(_WORDS)
    read = None if word is None else _READERS[word](scanner, word)
    if read is None:
        scanner.reset(mark)
    return read


def _assign(scanner: Scanner) -> Assign | None:
    target = parse_variable(scanner)
    if target is None:
        return None
    if target.kind is VariableKind.M:
        sign = scanner.take_word(tuple(_COMBINING))
        if sign is not None:
            return Assign(target, parse_expression(scanner), synchronous=True, operator=_COMBINING[sign])
    if not scanner.accept("="):
        return None
    return Assign(target, parse_expression(scanner))
