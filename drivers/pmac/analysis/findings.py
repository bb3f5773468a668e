"""The checker's findings: codes with numbers. Their texts are the console's (`check.<code>`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum, auto

from profiles.findings import Severity

Value = float | str


class Code(StrEnum):
    """Every finding."""

    LINE_REFUSED = auto()
    WORD_ABSENT = auto()
    TABLE_ORDER = auto()
    TABLE_UNFILLED = auto()
    TABLE_LAST_ENTRY = auto()
    TABLE_THROWS = auto()
    TABLE_THROWS_OTHER = auto()
    RUN_TIME_ERROR = auto()
    DIVIDED_BY_ZERO = auto()
    NO_RESULT = auto()
    BEYOND_LIMIT = auto()
    BEYOND_TRAVEL = auto()
    TOO_FAST = auto()
    ACCELERATION_OVER_ENCODER = auto()
    FORCE_OVER_DRIVE = auto()
    SPEED_OVER_SPINDLE = auto()
    TORQUE_OVER_SPINDLE = auto()
    PLUNGE = auto()
    ENDS_DEEPER = auto()
    STRETCHED = auto()
    STRETCHED_BY_VELOCITY = auto()
    STRETCHED_BY_ACCELERATION = auto()
    S_CURVE_RULES = auto()
    RAMP_LENGTHENED = auto()
    RAMP_SHORTENED = auto()
    TIME_BELOW_INTERRUPT = auto()
    TIME_ROUNDED = auto()
    CIRCLE_STRAIGHT = auto()
    STROKE_LOST = auto()
    ONE_SIDED = auto()
    DWELL_IN_CUT = auto()
    STOP_IN_CUT = auto()
    FEEDRATE_IN_CUT = auto()
    SPEED_CHANGES = auto()
    DRIFT = auto()
    NO_WHOLE_LOBES = auto()
    ENDLESS_LOOP = auto()
    ENDLESS_WITHOUT_FLAG = auto()
    WAITS_FOR_FLAG = auto()
    TOO_LONG = auto()
    NO_MOTION = auto()


class Said(StrEnum):
    """Every sentence of the explanation."""

    TOLD = auto()
    TOLD_WITHOUT_TIME = auto()
    ACCELERATION_TIME = auto()
    MOVE_STRETCHED = auto()
    SLOWED_DOWN = auto()
    SPEED_MADE = auto()
    STROKE_MADE = auto()
    LEFT_BY_BLENDING = auto()
    LEFT_WITH_THE_SERVO = auto()
    TIMES_FOR_THE_SPEED = auto()
    TIMES_FOR_THE_STROKE = auto()
    STROKE_THAT_MAKES_UP = auto()


_REFUSALS = frozenset(
    (
        Code.LINE_REFUSED,
        Code.WORD_ABSENT,
        Code.TABLE_ORDER,
        Code.RUN_TIME_ERROR,
        Code.BEYOND_LIMIT,
        Code.BEYOND_TRAVEL,
        Code.TOO_FAST,
        Code.PLUNGE,
    )
)
_NOTICES = frozenset(
    (
        Code.ENDS_DEEPER,
        Code.S_CURVE_RULES,
        Code.RAMP_LENGTHENED,
        Code.RAMP_SHORTENED,
        Code.TIME_ROUNDED,
        Code.ONE_SIDED,
        Code.WAITS_FOR_FLAG,
        Code.NO_MOTION,
    )
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramFinding:
    """One finding in a program. Not a `Finding`: it has lines, and numbers without units for the JSON.

    `lines` are those of the file, from 1, none where it is about the whole program.
    """

    code: Code
    lines: tuple[int, ...] = ()
    values: Mapping[str, Value] = field(default_factory=dict)

    @property
    def severity(self) -> Severity:
        """A refusal: the controller refuses or stops it, the machine is moved beyond a limit, or the check ends.

        A warning: it runs, but does something other than it says. A notice: worth knowing.
        """
        if self.code in _REFUSALS:
            return Severity.REFUSAL
        return Severity.NOTICE if self.code in _NOTICES else Severity.WARNING


@dataclass(frozen=True, slots=True, kw_only=True)
class Sentence:
    """One sentence of an explanation."""

    code: Said
    values: Mapping[str, Value] = field(default_factory=dict)


def finding(code: Code, lines: tuple[int, ...] = (), /, **values: Value) -> ProgramFinding:
    """Return a finding with its numbers in the order in which the JSON lists them."""
    return ProgramFinding(code=code, lines=lines, values=values)


def sentence(code: Said, /, **values: Value) -> Sentence:
    """Return a sentence with its numbers in the order in which the JSON lists them."""
    return Sentence(code=code, values=values)
