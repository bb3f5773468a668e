"""Evaluate expressions and conditions, compiled once to closures and run many times, on plain numbers.

An operator or function without a result raises ArithmeticError or ValueError. The controller itself continues with
a substitute (PMAC Software Reference, Mathematical Features); `forgiving` supplies the substitutes.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from operator import eq, ge, gt, le, lt, ne
from typing import NoReturn, Protocol

from drivers.pmac.language import syntax
from drivers.pmac.language.errors import ErrorCode, EvaluationError, NoResultError
from drivers.pmac.language.lexer import format_number

NEAR = 1.0  # `~` holds when two values differ by less than this (PMAC User Manual, Comparators)
BY_ZERO = "a division by 0; the controller continues with its largest number, 2^47"
REMAINDER_BY_ZERO = "a remainder of a division by 0; the controller continues with 0"
NO_VALUE = " has no value; the controller continues with 0"

SATURATION = 2.0**47  # The magnitude of the controller's result of a division by zero

_FRACTION_BITS = 2.0**32

BinaryFunction = Callable[[float, float], float]
UnaryFunction = Callable[[float], float]


class Variables(Protocol):
    """The source of variable values."""

    def get(self, kind: syntax.VariableKind, index: int) -> float:
        """Return a value."""


Value = Callable[[Variables], float]
Truth = Callable[[Variables], bool]


def evaluate(
    expression: syntax.Expression, variables: Variables, degrees: bool = True, *, strict: bool = True
) -> float:
    """Return the value of an expression, see `compile_expression`."""
    if isinstance(expression, syntax.Number):
        return expression.value  # as in most lines of a host: nothing to compile
    return compile_expression(expression, degrees, strict=strict)(variables)


def holds(condition: syntax.Condition, variables: Variables, degrees: bool = True) -> bool:
    """Return whether a condition is true, see `compile_condition`."""
    return compile_condition(condition, degrees)(variables)


def compile_expression(expression: syntax.Expression, degrees: bool = True, *, strict: bool = True) -> Value:
    """Return a function that calculates the expression from the variables.

    Angles are in degrees (I15=0) or in radians. ATAN2 takes its argument as the sine and Q0 as the cosine. The
    returned function raises EvaluationError for a calculation without a finite result. With `strict` False it
    continues like the controller: +-2^47 for a division by zero, 0 for `%` by zero and for a function outside its
    domain; only an overflow still raises.
    """
    value_of = _Compiler(degrees, strict).expression(expression)
    match expression:
        case syntax.Number() | syntax.Variable(_, syntax.Number()):
            return value_of  # nothing to calculate, and stored values are finite

    def calculate(variables: Variables) -> float:
        try:
            value = value_of(variables)
        except (ArithmeticError, ValueError) as fault:
            raise refusal(fault) from fault
        return value if math.isfinite(value) else too_large()

    return calculate


def refusal(fault: ArithmeticError | ValueError) -> EvaluationError:
    """Return the refusal of a calculation that has failed so."""
    without = isinstance(fault, ZeroDivisionError | ValueError)
    return (NoResultError if without else EvaluationError)(ErrorCode.DATA_ERROR, str(fault))


def too_large() -> NoReturn:
    """Refuse a result that is not finite. Raises EvaluationError."""
    raise EvaluationError(ErrorCode.DATA_ERROR, "a number that is too large for the controller")


def compile_condition(condition: syntax.Condition, degrees: bool = True, *, strict: bool = True) -> Truth:
    """Return a function that tests the condition, with short-circuit evaluation.

    Raises as `compile_expression` does.
    """
    match condition:
        case syntax.Junction(operator, left, right):
            first = compile_condition(left, degrees, strict=strict)
            second = compile_condition(right, degrees, strict=strict)
            return (lambda v: first(v) and second(v)) if operator == "AND" else (lambda v: first(v) or second(v))
        case syntax.Comparison(comparator, left_side, right_side):
            left_value = compile_expression(left_side, degrees, strict=strict)
            right_value = compile_expression(right_side, degrees, strict=strict)
            return _comparison(comparator, left_value, right_side, right_value)


def _comparison(comparator: str, left: Value, right_side: syntax.Expression, right: Value) -> Truth:
    compare = _COMPARATORS[comparator]
    if isinstance(right_side, syntax.Number):
        # As almost all of those that a PLC tests in each of its scans.
        constant = right_side.value
        return lambda v: compare(left(v), constant)
    return lambda v: compare(left(v), right(v))


_COMPARATORS: dict[str, Callable[[float, float], bool]] = {
    "=": eq,
    "!=": ne,
    ">": gt,
    "!>": le,
    "<": lt,
    "!<": ge,
    "~": lambda left, right: abs(left - right) < NEAR,
    "!~": lambda left, right: abs(left - right) >= NEAR,
}


@dataclass(frozen=True, slots=True)
class _Compiler:
    """The settings of one compilation; the closures may raise ArithmeticError and ValueError."""

    degrees: bool
    strict: bool

    def expression(self, expression: syntax.Expression) -> Value:
        match expression:
            case syntax.Number(constant):
                return lambda v: constant
            case syntax.Variable(kind, syntax.Number(index)):
                fixed = int(index)
                return lambda v: v.get(kind, fixed)
            case syntax.Variable(kind, computed):
                number = self.expression(computed)
                return lambda v: v.get(kind, int(number(v)))
            case syntax.Negate(operand):
                value = self.expression(operand)
                return lambda v: -value(v)
            case syntax.Call(name, argument):
                return self._call(name, self.expression(argument))
            case syntax.Binary(operator, left, right):
                return self._binary(operator, self.expression(left), self.expression(right))

    def _call(self, name: str, argument: Value) -> Value:
        if name == "ATAN2":
            angle = angle_function(self.degrees)
            return lambda v: angle(argument(v), v)
        function = functions(self.degrees, self.strict)[name]
        return lambda v: function(argument(v))

    def _binary(self, operator: str, left: Value, right: Value) -> Value:
        match operator:
            case "+":
                return lambda v: left(v) + right(v)
            case "-":
                return lambda v: left(v) - right(v)
            case "*":
                return lambda v: left(v) * right(v)
        combine = operators(self.strict)[operator]
        return lambda v: combine(left(v), right(v))


def divide(left: float, right: float) -> float:
    """Divide. Raises ZeroDivisionError, or OverflowError for a divisor that has overflowed."""
    if right == 0.0:
        raise ZeroDivisionError(BY_ZERO)
    if not math.isfinite(right):
        raise OverflowError("divisor too large")
    return left / right


def modulo(left: float, right: float) -> float:
    """Return the remainder, in 0 <= r < n for a divisor n > 0 and in -|n| <= r < |n| for n < 0.

    A negative divisor thus rolls over symmetrically, with a period of 2|n|: 11%-4 is 3, -11%-4 is -3
    (PMAC Software Reference, Mathematical Operators). Raises ZeroDivisionError, OverflowError.
    """
    if not (math.isfinite(left) and math.isfinite(right)):
        raise OverflowError("operand too large")
    if right == 0.0:
        raise ZeroDivisionError(REMAINDER_BY_ZERO)
    if right >= 0.0:
        return left % right
    return (left - right) % (-2.0 * right) + right


def _bitwise(combine: Callable[[int, int], int]) -> BinaryFunction:
    bits = _FRACTION_BITS
    return lambda left, right: combine(int(left * bits), int(right * bits)) / bits


BITWISE: Mapping[str, BinaryFunction] = {
    "&": _bitwise(operator.and_),
    "|": _bitwise(operator.or_),
    "^": _bitwise(operator.xor),
}
"""Combine bit by bit, including the fractional bits (PMAC Software Reference, Mathematical Operators)."""


def unary_functions(degrees: bool) -> Mapping[str, UnaryFunction]:
    """Return the functions of one number by name; angles in degrees (I15=0) or in radians.

    INT rounds down, also below zero (PMAC Software Reference, Mathematical Functions).
    """
    into = math.radians if degrees else float
    out_of = math.degrees if degrees else float
    return {
        "SIN": lambda value: math.sin(into(value)),
        "COS": lambda value: math.cos(into(value)),
        "TAN": lambda value: math.tan(into(value)),
        "ASIN": lambda value: out_of(math.asin(value)),
        "ACOS": lambda value: out_of(math.acos(value)),
        "ATAN": lambda value: out_of(math.atan(value)),
        "LN": math.log,
        "EXP": math.exp,
        "SQRT": math.sqrt,
        "ABS": abs,
        "INT": lambda value: float(math.floor(value)),
    }


ANYWHERE = ("SIN", "COS", "ATAN", "ABS", "INT")
"""The functions that have a result for every finite number."""


def forgiving(function: UnaryFunction) -> UnaryFunction:
    """Return the function with the controller's 0 outside its domain.

    Documented for LN (PMAC Software Reference, Mathematical Functions), assumed for the others.
    """

    def substituted(value: float) -> float:
        try:
            return function(value)
        except ValueError:
            return 0.0

    return substituted


def saturating_divide(left: float, right: float) -> float:
    """Divide; by zero the result is +-2^47, with the sign of the dividend."""
    return math.copysign(SATURATION, left) if right == 0.0 else divide(left, right)


def saturating_modulo(left: float, right: float) -> float:
    """Return the remainder; 0 for a divisor of 0."""
    return 0.0 if right == 0.0 else modulo(left, right)


@cache
def functions(degrees: bool, strict: bool) -> Mapping[str, UnaryFunction]:
    """Return the functions of one number by name, as a calculation applies them."""
    found = unary_functions(degrees)
    return {name: _apply_function(name, function, strict) for name, function in found.items()}


def _apply_function(name: str, function: UnaryFunction, strict: bool) -> UnaryFunction:
    if name in ANYWHERE:

        def anywhere(value: float) -> float:
            if not math.isfinite(value):
                raise OverflowError(f"argument of {name} too large")
            return function(value)

        return anywhere
    within = function if strict else forgiving(function)

    def call(value: float) -> float:
        if not math.isfinite(value):
            raise OverflowError(f"argument of {name} too large")
        try:
            return within(value)
        except ValueError as fault:
            raise ValueError(f"{name}({format_number(value)}){NO_VALUE}") from fault
        except OverflowError as fault:
            raise OverflowError(f"{name}({format_number(value)}) is too large a number") from fault

    return call


@cache
def angle_function(degrees: bool) -> Callable[[float, Variables], float]:
    """Return ATAN2, whose second argument is Q0."""
    scale = math.degrees(1.0) if degrees else 1.0

    def angle(value: float, variables: Variables) -> float:
        if not math.isfinite(value):
            raise OverflowError("argument of ATAN2 too large")
        return scale * math.atan2(value, variables.get(syntax.VariableKind.Q, 0))

    return angle


def operators(strict: bool) -> Mapping[str, BinaryFunction]:
    """Return the operators beside + - and *, as a calculation applies them."""
    return _STRICT if strict else _SATURATING


_STRICT: dict[str, BinaryFunction] = {
    "/": divide,
    "%": modulo,
    **BITWISE,
}
_SATURATING = {**_STRICT, "/": saturating_divide, "%": saturating_modulo}
