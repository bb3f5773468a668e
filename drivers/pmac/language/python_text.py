"""Statements that only calculate, as the text of Python: for what a program or a PLC does again and again.

The text does what `evaluate` and the stores of variables do, in the same order and to the same bit, with fewer
calls: a P-variable is an element of a list, and + - and * are Python's own. Only what the parser knows gets into
it, and numbers: nothing of the text that a host has sent. `x - x` is 0 for a finite number alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from types import CodeType
from typing import Any

from drivers.pmac.language import syntax
from drivers.pmac.language.evaluate import NEAR, Value, angle_function, functions, operators, refusal, too_large
from drivers.pmac.language.syntax import VariableKind

_COMPARED = {"=": "==", "!=": "!=", ">": ">", "!>": "<=", "<": "<", "!<": ">="}
_NEAR = {"~": "<", "!~": ">="}
_OPERATORS = {"/": "quotient", "%": "remainder", "&": "bits_and", "|": "bits_or", "^": "bits_xor"}


class PythonText:
    """Writes the text and has it executed. In it `values` are the variables, `p` the P-variables."""

    def __init__(self, p_values: list[float], degrees: bool, strict: bool) -> None:
        """Take the settings of `compile_expression`."""
        self._highest = len(p_values) - 1
        combine = operators(strict)
        self._known: dict[str, object] = {
            **{f"kind_{kind}": kind for kind in VariableKind},
            **{f"{name.lower()}_of": function for name, function in functions(degrees, strict).items()},
            **{name: combine[operator] for operator, name in _OPERATORS.items()},
            "atan2_of": angle_function(degrees),
            "finite": lambda value: value if math.isfinite(value) else too_large(),
            "too_large": too_large,
            "refusal": refusal,
            "inf": math.inf,  # as Python writes a constant of too many digits
            "p": p_values,
        }

    def execute_text(self, lines: Sequence[str], known: Mapping[str, object]) -> dict[str, Any] | None:
        """Return the names that the text defines; None if it is nested too deep for Python."""
        try:
            code = _compile_text("\n".join(lines))
        except (SyntaxError, RecursionError, MemoryError):
            return None
        found = {**self._known, **known}
        exec(code, found)
        return found

    def values(self, expressions: Sequence[syntax.Expression]) -> list[Value] | None:
        """Return functions as `compile_expression` makes them; None if Python cannot compile them."""
        lines = [line for place, each in enumerate(expressions) for line in self._function(f"value_{place}", each)]
        found = self.execute_text(lines, {})
        return None if found is None else [found[f"value_{place}"] for place in range(len(expressions))]

    def _function(self, name: str, expression: syntax.Expression) -> list[str]:
        if _is_stored(expression):
            return [f"def {name}(values): return {self._value(expression)}"]
        return [
            f"def {name}(values):",
            f"    try: x = {self._value(expression)}",
            "    except (ArithmeticError, ValueError) as fault: raise refusal(fault) from fault",
            "    return x if x - x == 0.0 else too_large()",
        ]

    def condition(self, condition: syntax.Condition) -> str:
        """Return an expression that is true where the condition holds."""
        match condition:
            case syntax.Junction(operator, left, right):
                return f"({self.condition(left)} {operator.lower()} {self.condition(right)})"
            case syntax.Comparison(comparator, left_side, right_side):
                first, second = self._result(left_side), self._result(right_side)
                if comparator in _NEAR:
                    return f"abs({first} - {second}) {_NEAR[comparator]} {NEAR!r}"
                return f"{first} {_COMPARED[comparator]} {second}"

    def assignment(self, assign: syntax.Assign) -> list[str]:
        """Return the lines of an assignment that takes effect at once."""
        kind, number = assign.target.kind, assign.target.index
        place = str(int(number.value)) if isinstance(number, syntax.Number) else f"int({self._result(number)})"
        if kind is not VariableKind.P or self._p_index(number) is None:
            return [f"values.set(kind_{kind}, {place}, {self._result(assign.value)})"]
        if _is_stored(assign.value):
            return [f"p[{place}] = {self._value(assign.value)}"]
        return [f"x = {self._value(assign.value)}", "if x - x != 0.0: too_large()", f"p[{place}] = x"]

    def _result(self, expression: syntax.Expression) -> str:
        """Return an expression whose value is checked to be finite."""
        value = self._value(expression)
        return value if _is_stored(expression) else f"finite({value})"

    def _value(self, expression: syntax.Expression) -> str:
        match expression:
            case syntax.Number(constant):
                return f"({float(constant)!r})"
            case syntax.Variable(kind, number):
                return self._variable(kind, number)
            case syntax.Negate(operand):
                return f"(-{self._value(operand)})"
            case syntax.Call(name, argument):
                others = ", values" if name == "ATAN2" else ""
                return f"{name.lower()}_of({self._value(argument)}{others})"
            case syntax.Binary(operator, left, right):
                return self._binary(operator, left, right)

    def _variable(self, kind: VariableKind, number: syntax.Expression) -> str:
        if kind is VariableKind.P and (index := self._p_index(number)) is not None:
            return f"p[{index}]"
        place = str(int(number.value)) if isinstance(number, syntax.Number) else f"int({self._value(number)})"
        return f"values.get(kind_{kind}, {place})"

    def _binary(self, operator: str, left: syntax.Expression, right: syntax.Expression) -> str:
        first, second = self._value(left), self._value(right)
        by_constant = operator == "/" and isinstance(right, syntax.Number) and right.value != 0.0
        if operator in "+-*" or by_constant:
            return f"({first} {operator} {second})"
        return f"{_OPERATORS[operator]}({first}, {second})"

    def _p_index(self, number: syntax.Expression) -> int | None:
        if isinstance(number, syntax.Number) and 0 <= int(number.value) <= self._highest:
            return int(number.value)
        return None


def _is_stored(expression: syntax.Expression) -> bool:
    """Whether nothing is calculated: stored values are finite."""
    match expression:
        case syntax.Number() | syntax.Variable(_, syntax.Number()):
            return True
    return False


@lru_cache(maxsize=256)
def _compile_text(text: str) -> CodeType:
    return compile(text, "<program>", "exec")
