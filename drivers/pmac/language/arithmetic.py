"""The controller's operators and functions on plain numbers.

A calculation without a result raises ArithmeticError or ValueError here. The controller itself continues with a
substitute (PMAC Software Reference, Mathematical Features); `forgiving` supplies the substitutes.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping

BY_ZERO = "a division by 0; the controller continues with its largest number, 2^47"
REMAINDER_BY_ZERO = "a remainder of a division by 0; the controller continues with 0"
NO_VALUE = " has no value; the controller continues with 0"

SATURATION = 2.0**47  # The magnitude of the controller's result of a division by zero

_FRACTION_BITS = 2.0**32

BinaryFunction = Callable[[float, float], float]
UnaryFunction = Callable[[float], float]


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
