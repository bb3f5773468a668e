"""The syntax tree of PMAC programs and expressions: their meaning, free of spelling and spacing."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

AXES = ("A", "B", "C", "U", "V", "W", "X", "Y", "Z")  # The letters of axes
VECTOR = ("I", "J", "K")  # The letters of a vector, by its components along X, Y and Z


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
    """A minus sign before an operand."""

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
    """`P1=...`, executed when the line is calculated, one or two moves ahead of the motion.

    With `synchronous` (`M1==...`) the value is also calculated then, but stored when the next move starts.
    `operator` & | or ^ (`M1&=...`, always synchronous) combines the value with that of the target.
    """

    target: Variable
    value: Expression
    synchronous: bool = False
    operator: str = ""


@dataclass(frozen=True, slots=True)
class Set:
    """A modal word with a value: TA, TS, TM, F or PVT (which also selects PVT mode)."""

    word: str
    value: Expression


@dataclass(frozen=True, slots=True)
class SelectMode:
    """A move mode without a value: LINEAR, RAPID, SPLINE1, SPLINE2, CIRCLE1 (clockwise) or CIRCLE2."""

    mode: str


@dataclass(frozen=True, slots=True)
class Positioning:
    """ABS or INC, for all axes when `axes` is empty; `R` among them stands for the vector to a circle's centre."""

    incremental: bool
    axes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Feedrate:
    """FRAX: the axes whose distance F refers to; every axis when `axes` is empty, none with `none` (NOFRAX)."""

    axes: tuple[str, ...] = ()
    none: bool = False


@dataclass(frozen=True, slots=True)
class Normal:
    """`NORMAL K-1`: the vector normal to the plane of circles, by the letters I, J and K."""

    words: tuple[AxisWord, ...]


@dataclass(frozen=True, slots=True)
class AxisWord:
    """`X(P500)`, or `X10:5` with an end velocity in PVT mode; `I J K R` define a circle's centre.

    `X10^1` in RAPID mode moves until the trigger, toward 10, and ends 1 past it (`past_trigger`).
    """

    axis: str
    value: Expression
    velocity: Expression | None = None
    past_trigger: Expression | None = None


@dataclass(frozen=True, slots=True)
class Move:
    """The axis words of one line: the axes move together. I, J, K and R words of a circle are among them."""

    words: tuple[AxisWord, ...]


@dataclass(frozen=True, slots=True)
class Preset:
    """PSET: the axes are, from now on, at the given positions; nothing moves."""

    words: tuple[AxisWord, ...]


@dataclass(frozen=True, slots=True)
class HomeMotors:
    """`HOME1..3,5`: home motors and wait; `zero` (HOMEZ) declares them homed without a move."""

    motors: tuple[int, ...]
    zero: bool = False


@dataclass(frozen=True, slots=True)
class Wait:
    """DWELL (real time, breaks blending) or DELAY (a move of zero distance), in ms."""

    word: str
    duration_ms: Expression


@dataclass(frozen=True, slots=True)
class Pause:
    """WAIT: idle for a real-time interrupt; after a WHILE it holds the program in its place."""


@dataclass(frozen=True, slots=True)
class Stop:
    """STOP: the program stops here; R resumes with the next line."""


@dataclass(frozen=True, slots=True)
class Block:
    """BLOCKSTART (`begins`) or BLOCKSTOP: the lines between them are one step."""

    begins: bool


@dataclass(frozen=True, slots=True)
class Label:
    """`N100`, or `O100`: a place to jump to."""

    number: int


@dataclass(frozen=True, slots=True)
class Goto:
    """GOTO a label."""

    label: Expression


@dataclass(frozen=True, slots=True)
class Gosub:
    """GOSUB a label of the same program; RETURN continues after it."""

    label: Expression


@dataclass(frozen=True, slots=True)
class CallProgram:
    """`CALL 500.100`: continue at a label (the fraction, in units of 1/100000) of another program, and return.

    `code` is the letter of a `G1`, `M3`, `T5` or `D7`, which are calls of programs 1000, 1001, 1002 and 1003.
    Words that follow on the line are arguments for READ; what READ does not take is executed afterwards.
    """

    target: Expression
    code: str = ""


@dataclass(frozen=True, slots=True)
class Argument:
    """A letter with a value after a call that is not a statement of its own, such as the P of `G4 P2000`.

    S may also be alone: the spindle speed, which goes to Q127.
    """

    letter: str
    value: Expression


@dataclass(frozen=True, slots=True)
class Read:
    """READ(X,Y): arguments of the calling line to Q101 (A) to Q126 (Z), with a bit for each in Q100."""

    letters: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Return:
    """RETURN: continue after the call, or end the program."""


@dataclass(frozen=True, slots=True)
class Message:
    """CMD"..." (an on-line command), SEND"..." or DISPLAY"..."; `port` is the letter of CMDS or SENDP.

    The text of `CMD^A` and `SEND^M` is that control character. `place` is the column of `DISPLAY8"..."`.
    """

    word: str
    text: str
    port: str = ""
    place: int | None = None


@dataclass(frozen=True, slots=True)
class PlcSwitch:
    """ENABLE PLC or DISABLE PLC; `keeping` the place where it is: RESUME PLC or PAUSE PLC."""

    enable: bool
    numbers: tuple[int, ...]
    keeping: bool = False


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


@dataclass(frozen=True, slots=True)
class FurtherCondition:
    """`AND(condition)` or `OR(condition)` on a line of its own: more of the IF or WHILE above it. PLC only."""

    operator: str
    condition: Condition


@dataclass(frozen=True, slots=True)
class Address:
    """`ADDRESS#1&2`: the motor and the coordinate system that a PLC addresses from now on; None: as before.

    A variable, as in `ADDRESS#P5`, has the number when the statement is executed.
    """

    motor: int | Variable | None = None
    system: int | Variable | None = None


Modal = Set | SelectMode | Positioning | Feedrate | Normal  # Modal statements for the moves that follow

Flow = While | EndWhile | If | Else | EndIf | Label | Goto | Gosub | CallProgram | Read | Return
"""Statements that determine the next line."""

Statement = (
    Modal
    | Flow
    | Assign
    | Move
    | Preset
    | HomeMotors
    | Wait
    | Pause
    | Stop
    | Block
    | Argument
    | Message
    | PlcSwitch
)

Line = tuple[Statement, ...]  # The statements between two line ends. A program is a tuple of lines.

Program = tuple[Line, ...]

PlcStatement = While | EndWhile | If | Else | EndIf | FurtherCondition | Assign | Message | PlcSwitch | Address
"""The statements of a PLC: no motion, no labels and jumps, and none of them is `inline`."""

PlcLine = tuple[PlcStatement, ...]  # The statements between two line ends of a PLC

PlcProgram = tuple[PlcLine, ...]
