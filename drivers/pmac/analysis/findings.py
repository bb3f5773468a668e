"""The checker's findings: codes with numbers. Their texts are the console's (`check.<code>`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum, auto
from functools import cached_property

from drivers.pmac.analysis.moves import MoveAnalysis
from drivers.pmac.analysis.timeline import SAME_COUNTS, Timeline
from drivers.pmac.analysis.walk import Walk
from profiles.findings import Severity
from profiles.machine import MachineProfile

Value = float | str
FEWEST_TOOL_MOVES = 2  # Tool moves, with the spindle turning, that make a cut


class FindingCode(StrEnum):
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


class ExplanationSentence(StrEnum):
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
        FindingCode.LINE_REFUSED,
        FindingCode.WORD_ABSENT,
        FindingCode.TABLE_ORDER,
        FindingCode.RUN_TIME_ERROR,
        FindingCode.BEYOND_LIMIT,
        FindingCode.BEYOND_TRAVEL,
        FindingCode.TOO_FAST,
        FindingCode.PLUNGE,
    )
)
_NOTICES = frozenset(
    (
        FindingCode.ENDS_DEEPER,
        FindingCode.S_CURVE_RULES,
        FindingCode.RAMP_LENGTHENED,
        FindingCode.RAMP_SHORTENED,
        FindingCode.TIME_ROUNDED,
        FindingCode.ONE_SIDED,
        FindingCode.WAITS_FOR_FLAG,
        FindingCode.NO_MOTION,
    )
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramFinding:
    """One finding in a program. Not a `Finding`: it has lines, and numbers without units for the JSON.

    `lines` are those of the file, from 1, none where it is about the whole program.
    """

    code: FindingCode
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

    code: ExplanationSentence
    values: Mapping[str, Value] = field(default_factory=dict)


def finding(code: FindingCode, lines: tuple[int, ...] = (), /, **values: Value) -> ProgramFinding:
    """Return a finding with its numbers in the order in which the JSON lists them."""
    return ProgramFinding(code=code, lines=lines, values=values)


def sentence(code: ExplanationSentence, /, **values: Value) -> Sentence:
    """Return a sentence with its numbers in the order in which the JSON lists them."""
    return Sentence(code=code, values=values)


@dataclass(frozen=True, kw_only=True)
class Subject:
    """All inputs of a rule. `place_of` returns the line of the file (from 1) of a line of a program."""

    machine: MachineProfile
    walk: Walk
    timeline: Timeline
    moves: tuple[MoveAnalysis, ...]
    place_of: Callable[[int, int], int]

    @property
    def tool(self) -> int | None:
        """The place of the tool's motor in every vector; None when it has no axis."""
        return self._index(self.machine.tool.motor)

    @property
    def spindle(self) -> int | None:
        """The place of the spindle's motor."""
        return self._index(self.machine.spindle.motor)

    @property
    def carriage(self) -> int | None:
        """The place of the carriage's motor."""
        return self._index(self.machine.carriage.motor)

    @cached_property
    def cut(self) -> tuple[MoveAnalysis, ...]:
        """The longest stretch of moves in which tool and spindle move together; empty without one.

        It begins and ends with a move of the tool; the spindle is commanded to turn in every one of its moves.
        """
        tool, spindle = self.tool, self.spindle
        if tool is None or spindle is None:
            return ()
        stretches: list[list[MoveAnalysis]] = [[]]
        for move in self.moves:
            if moves(move, spindle):
                stretches[-1].append(move)
            elif stretches[-1]:
                stretches.append([])
        cuts: list[list[MoveAnalysis]] = [[]]
        for stretch in stretches:
            places = [place for place, move in enumerate(stretch) if moves(move, tool)]
            if len(places) >= FEWEST_TOOL_MOVES:
                cuts.append(stretch[places[0] : places[-1] + 1])
        longest = max(cuts, key=len)
        return tuple(longest)

    def lines(self, moves: Iterable[MoveAnalysis]) -> tuple[int, ...]:
        """Return the lines of the file that some moves come from, in order, each once."""
        return tuple(sorted({self.place_of(move.program, move.line) for move in moves}))

    def um(self, counts: float) -> float:
        """Return a tool distance in um."""
        return counts * self.machine.tool.count_um

    def rpm(self, counts_per_ms: float) -> float:
        """Return a spindle speed in revolutions per minute."""
        return 60_000.0 * counts_per_ms / self.machine.spindle.counts_per_rev

    def setting(self, motor: int, number: int) -> float:
        """Return Ix`number` of a motor as it is at the end of the program."""
        return self.walk.variables.motor(motor, number)

    def _index(self, motor: int) -> int | None:
        return self.walk.motors.index(motor) if motor in self.walk.motors else None


def moves(move: MoveAnalysis, index: int) -> bool:
    """Return whether a move commands a displacement of a motor."""
    return abs(move.motors[index].commanded) > SAME_COUNTS
