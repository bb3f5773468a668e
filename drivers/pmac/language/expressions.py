"""Parse expressions and conditions, and the common parts of statements: data, lists, axis words."""

from __future__ import annotations

import re
from dataclasses import dataclass

from drivers.pmac.language import syntax
from drivers.pmac.language.lexer import Scanner

FUNCTIONS = ("SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "ATAN2", "LN", "EXP", "SQRT", "ABS", "INT")
COMPARATORS = ("=", "!=", ">", "!>", "<", "!<", "~", "!~")
PRODUCTS = ("*", "/", "%", "&")
"""The operators that bind tighter (PMAC User Manual, Operators)."""
SUMS = ("+", "-", "|", "^")

MAX_NESTING = 15  # Maximum nesting of parentheses; deeper text is refused rather than followed without end
MAX_OPERANDS = 100  # Operands of one expression or condition; bounds the depth of the tree of a long chain

_KINDS = tuple(syntax.VariableKind)
_INDEX_STARTS = "0123456789$("
_DATA_STARTS = "0123456789$.(-"

HIGHEST_PROGRAM = 32_767
HIGHEST_PLC = 31

PROGRAM = ("PROGRAM", "PROG")
OPEN_PROGRAM = tuple(f"OPEN{word}" for word in PROGRAM)
OPEN_PLC = ("OPENPLC",)
CLEAR = ("CLEAR", "CLR")
CLOSE = ("CLOSE", "CLS")

_SPACES = r"\s*"
TRAILING_CLOSE = re.compile(f"(?:{'|'.join(map(_SPACES.join, CLOSE))}){_SPACES}$", re.IGNORECASE)
"""CLOSE at the end of a stored line; white space may be anywhere in it."""


def parse_expression(scanner: Scanner) -> syntax.Expression:
    """Parse an expression: `* / % &` bind tighter than `+ - | ^`, both from left to right.

    Raises PmacError 003: no expression at the cursor, or it is too large.
    """
    return _ExpressionReader(scanner).sum()


def parse_condition(scanner: Scanner) -> syntax.Condition:
    """Parse comparisons joined by AND and OR, without the parentheses around the whole.

    A comparison must not be in parentheses of its own (PMAC User Manual, Conditions).

    Raises PmacError 003: no condition at the cursor, or it has no comparator (`<=` is none).
    """
    return _ExpressionReader(scanner).condition()


def parse_variable(scanner: Scanner) -> syntax.Variable | None:
    """Parse `P100` or `P(P1+1)`; None, with nothing consumed, if there is no variable at the cursor.

    Raises PmacError 003: the number in parentheses is not an expression.
    """
    return _ExpressionReader(scanner).variable()


def at_data(scanner: Scanner) -> bool:
    """Whether `parse_data` has something to parse."""
    return scanner.peek(_DATA_STARTS)


def parse_data(scanner: Scanner) -> syntax.Expression:
    """Parse what follows a word: a constant, negative or not (`X-500`), or an expression in parentheses.

    A plus sign is not accepted (PMAC Software Reference, Mathematical Operators).

    Raises PmacError 003: neither is at the cursor (`XP1` is refused).
    """
    if scanner.accept("("):
        value = parse_expression(scanner)
        scanner.expect(")")
        return value
    negative = scanner.accept("-")
    number = scanner.take_number()
    if number is None:
        raise scanner.refusal("expected a constant or parentheses")
    return negate_operand(syntax.Number(number)) if negative else syntax.Number(number)


def negate_operand(operand: syntax.Expression) -> syntax.Expression:
    """Return the negated operand; a constant includes its own minus sign."""
    if isinstance(operand, syntax.Number):
        return syntax.Number(-operand.value if operand.value else 0.0)
    return syntax.Negate(operand)


@dataclass(slots=True)
class _ExpressionReader:
    """One expression or condition being parsed."""

    scanner: Scanner
    operands: int = 0
    nesting: int = 0

    def condition(self) -> syntax.Condition:
        left = self._conjunction()
        while self.scanner.accept("OR"):
            left = syntax.Junction("OR", left, self._conjunction())
        return left

    def _conjunction(self) -> syntax.Condition:
        left: syntax.Condition = self._comparison()
        while self.scanner.accept("AND"):
            left = syntax.Junction("AND", left, self._comparison())
        return left

    def _comparison(self) -> syntax.Comparison:
        left = self.sum()
        comparator = self.scanner.take_word(COMPARATORS)
        if comparator is None:
            raise self.scanner.refusal("expected a comparator")
        return syntax.Comparison(comparator, left, self.sum())

    def sum(self) -> syntax.Expression:
        left = self._product()
        while (operator := self.scanner.take_word(SUMS)) is not None:
            left = syntax.Binary(operator, left, self._product())
        return left

    def _product(self) -> syntax.Expression:
        left = self._operand()
        while (operator := self.scanner.take_word(PRODUCTS)) is not None:
            left = syntax.Binary(operator, left, self._operand())
        return left

    def _operand(self) -> syntax.Expression:
        self.operands += 1
        if self.operands > MAX_OPERANDS:
            raise self.scanner.refusal("expression too long")
        number = self.scanner.take_number()
        if number is not None:
            return syntax.Number(number)
        self.nesting += 1
        if self.nesting > MAX_NESTING:
            raise self.scanner.refusal("nested too deeply")
        operand = self._compound()
        self.nesting -= 1
        return operand

    def _compound(self) -> syntax.Expression:
        if self.scanner.accept("-"):
            return negate_operand(self._operand())
        if self.scanner.peek("("):
            return self._parenthesised_expression()
        name = self.scanner.take_word(FUNCTIONS)
        if name is not None:
            return syntax.Call(name, self._parenthesised_expression())
        variable = self.variable()
        if variable is None:
            raise self.scanner.refusal("expected an operand")
        return variable

    def variable(self) -> syntax.Variable | None:
        mark = self.scanner.mark()
        kind = self.scanner.take_word(_KINDS)
        if kind is None or not self.scanner.peek(_INDEX_STARTS):
            self.scanner.reset(mark)
            return None
        number = self.scanner.take_integer()
        index = syntax.Number(number) if number is not None else self._parenthesised_expression()
        return syntax.Variable(syntax.VariableKind(kind), index)

    def _parenthesised_expression(self) -> syntax.Expression:
        self.scanner.expect("(")
        inside = self.sum()
        self.scanner.expect(")")
        return inside


def parse_letters(scanner: Scanner, letters: tuple[str, ...]) -> tuple[str, ...]:
    """Parse `(X,Y)`, each one of `letters`. Raises PmacError: 003, something else is there."""
    scanner.expect("(")
    listed: list[str] = []
    while not listed or scanner.accept(","):
        letter = scanner.take_word(letters)
        if letter is None:
            raise scanner.refusal(f"expected one of {' '.join(letters)}")
        listed.append(letter)
    scanner.expect(")")
    return tuple(listed)


def parse_numbers(scanner: Scanner, lowest: int, highest: int) -> tuple[int, ...]:
    """Parse `1..3,5`, each number from `lowest` to `highest`; a range stands for all its numbers.

    Raises PmacError: 003, not a number, or one outside the limits.
    """
    listed: list[int] = []
    while not listed or scanner.accept(","):
        first = parse_number(scanner, lowest, highest)
        last = parse_number(scanner, first, highest) if scanner.accept("..") else first
        listed += range(first, last + 1)
    return tuple(listed)


def parse_number(scanner: Scanner, lowest: int, highest: int) -> int:
    """Parse a whole number. Raises PmacError: 003, not a number, or one outside the limits."""
    number = scanner.take_integer()
    if number is None or not lowest <= number <= highest:
        raise scanner.refusal(f"expected a number from {lowest} to {highest}")
    return number


def parse_words(scanner: Scanner, letters: tuple[str, ...]) -> tuple[syntax.AxisWord, ...]:
    """Parse axis words as long as they follow one another and no letter is repeated; perhaps none."""
    words: dict[str, syntax.AxisWord] = {}
    while True:
        mark = scanner.mark()
        letter = scanner.take_word(letters)
        if letter is None or letter in words or not at_data(scanner):
            scanner.reset(mark)
            return tuple(words.values())
        words[letter] = syntax.AxisWord(letter, parse_data(scanner))
