"""The syntax tree of PMAC programs and expressions: what a line says, free of spelling and spacing."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class VariableKind(StrEnum):
    """The four families of numbered variables."""

    I = "I"  # noqa: E741 - the manual's own name
    P = "P"
    Q = "Q"
    M = "M"


@dataclass(frozen=True, slots=True)
class Number:
    """A constant."""

    value: float


@dataclass(frozen=True, slots=True)
class Variable:
    """`P100`, or `P(P1+1)` with a computed number."""

    kind: VariableKind
    index: Expression


@dataclass(frozen=True, slots=True)
class Negate:
    """A minus sign in front of an operand."""

    operand: Expression


@dataclass(frozen=True, slots=True)
class Binary:
    """`left operator right`, operator one of + - * / % & | ^ (`^` is bitwise exclusive or)."""

    operator: str
    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True)
class Call:
    """A function of one expression: SIN COS TAN ASIN ACOS ATAN ATAN2 LN EXP SQRT ABS INT."""

    name: str
    argument: Expression


Expression = Number | Variable | Negate | Binary | Call


@dataclass(frozen=True, slots=True)
class Comparison:
    """A simple condition; comparator one of = != > !> < !< ~ !~ (there is no <= or >=)."""

    comparator: str
    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True)
class Junction:
    """Two conditions joined by AND or OR; AND binds tighter."""

    operator: str
    left: Condition
    right: Condition


Condition = Comparison | Junction


@dataclass(frozen=True, slots=True)
class Assign:
    """`P1=...`, executed when the line is calculated, one or two moves ahead of the motion."""

    target: Variable
    value: Expression


@dataclass(frozen=True, slots=True)
class Set:
    """A modal word with a value: TA, TS, TM, F or PVT (which also selects PVT mode)."""

    word: str
    value: Expression


@dataclass(frozen=True, slots=True)
class SelectMode:
    """A move mode without a value: LINEAR."""

    mode: str


@dataclass(frozen=True, slots=True)
class Positioning:
    """ABS or INC, for all axes when `axes` is empty."""

    incremental: bool
    axes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class AxisWord:
    """`X(P500)`, or `X10:5` with an end velocity in PVT mode."""

    axis: str
    value: Expression
    velocity: Expression | None = None


@dataclass(frozen=True, slots=True)
class Move:
    """The axis words of one line: the axes move together."""

    words: tuple[AxisWord, ...]


@dataclass(frozen=True, slots=True)
class Wait:
    """DWELL (real time, breaks blending) or DELAY (a move of no distance), in ms."""

    word: str
    duration_ms: Expression


@dataclass(frozen=True, slots=True)
class While:
    """`WHILE(condition)`; with `inline` it ends with its own line and needs no ENDWHILE."""

    condition: Condition
    inline: bool = False


@dataclass(frozen=True, slots=True)
class EndWhile:
    """ENDWHILE, or ENDW."""


@dataclass(frozen=True, slots=True)
class If:
    """`IF(condition)`; with `inline` it ends with its own line (an ELSE may follow) and needs no ENDIF."""

    condition: Condition
    inline: bool = False


@dataclass(frozen=True, slots=True)
class Else:
    """ELSE; with `inline` the alternative ends with its own line."""

    inline: bool = False


@dataclass(frozen=True, slots=True)
class EndIf:
    """ENDIF, or ENDI."""


Statement = Assign | Set | SelectMode | Positioning | Move | Wait | While | EndWhile | If | Else | EndIf

Line = tuple[Statement, ...]
"""What stands between two line ends. A program is a tuple of lines."""

Program = tuple[Line, ...]
