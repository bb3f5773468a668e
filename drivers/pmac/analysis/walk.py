"""Walk through a program step by step, with axes that follow exactly, by the rules that execute it.

A walk ends with the program, a run-time error, or `MOST_STEPS`. A loop that nothing in the program ends is watched
for a while; then its flag is set, as a host would do, and the walk continues after it. Where there is no flag to
set, the walk ends there.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum, auto
from functools import partial
from typing import NamedTuple

from drivers.pmac.analysis.endless import Circle, EndlessWatch, Name, TurningMotor, find_loops, way_out
from drivers.pmac.analysis.timeline import ProgramStep
from drivers.pmac.analysis.watched_variables import COMPENSATION, WatchedVariables
from drivers.pmac.axes import AxisDefinition, axis_positions, preset_origins, refuse_inverse
from drivers.pmac.dialect import PMAC, Dialect, FamilySetting
from drivers.pmac.execution.kinematics import kinematics_of, with_kinematics
from drivers.pmac.execution.move_times import Modes
from drivers.pmac.execution.run import ProgramRun
from drivers.pmac.language.errors import ErrorCode, NoResultError, PmacError
from drivers.pmac.language.evaluate import evaluate
from drivers.pmac.language.structure import link
from drivers.pmac.language.syntax import Assign
from drivers.pmac.program_text import ProgramText
from drivers.pmac.requests import EndOfProgram, HomeRequest, PresetRequest, Request, TriggerRequest
from drivers.pmac.trajectory.pieces import Piece, Vector, constant, position_at
from drivers.pmac.trajectory.planned_pieces import Event, PlannedPieces
from drivers.pmac.trajectory.planner import MotionPlanner
from drivers.pmac.variables import VariableStore

MOST_STEPS = 20_000  # Maximum number of program requests in a walk


class WalkEnding(StrEnum):
    """How a walk ended: after the last line, with a run-time error, in an endless loop, or too long."""

    FINISHED = auto()
    ERROR = auto()
    ENDLESS = auto()
    TOO_LONG = auto()


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopExit:
    """An endless loop: left by setting `flags` after step number `step`; without flags it was not left."""

    circle: Circle
    line: int
    step: int
    flags: Mapping[Name, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Switch:
    """I51 switched `on` or off by a line of `program`, before the request of step number `step`."""

    step: int
    on: bool
    program: int
    line: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Substitute:
    """A calculation without a result in a line of `program`, or of the text, from 1, where that is 0.

    `detail` says what the controller continues with.
    """

    program: int
    line: int
    detail: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Walk:
    """The motion of program `number`. Vectors are in the order of `motors`; `error` is what ended it at run time.

    `compensated` is whether I51 is on when it begins, `switches` its changes of I51. `substitutes` are the
    calculations without a result, each once.
    """

    number: int
    motors: tuple[int, ...]
    start: Vector
    steps: tuple[ProgramStep, ...]
    left: tuple[LoopExit, ...]
    ending: WalkEnding
    error: PmacError | None
    variables: VariableStore
    compensated: bool = False
    switches: tuple[Switch, ...] = ()
    substitutes: tuple[Substitute, ...] = ()

    @property
    def pieces(self) -> list[Piece]:
        """The whole motion; where nothing moves, one piece without a time."""
        pieces = [piece for step in self.steps for piece in step.planned.pieces]
        return pieces or [constant(self.start, tuple(0.0 for _ in self.start), 0.0)]


def walk(
    text: ProgramText,
    i_variables: Mapping[int, float],
    definitions: Sequence[AxisDefinition],
    start: Mapping[int, float],
    *,
    counts_per_turn: Mapping[int, float] | None = None,
    dialect: Dialect = PMAC,
    most_steps: int = MOST_STEPS,
    watched: bool = True,
) -> Walk:
    """Walk through a program from `start` (counts by motor); `counts_per_turn` names the motor of the spindle.

    If not `watched`, an endless loop continues until the walk is too long: for programs that are known to end.

    Raises PmacError: refusals before anything moves: a setting, the structure of the program.
    """
    variables = WatchedVariables(i_variables, dialect) if watched else VariableStore(i_variables, dialect)
    walker = _Walker(text, variables, definitions, start)
    return walker.walk(counts_per_turn or {}, most_steps)


def settle(text: ProgramText, variables: VariableStore, substitutes: dict[Substitute, None]) -> None:
    """Execute the settings before a program; what has no result is added to `substitutes`.

    Raises PmacError: 005 for anything that is not a setting, 003 for a number that is too large.
    """
    for place, line in zip(text.setting_places, text.settings, strict=True):
        for statement in line:
            if not isinstance(statement, Assign):
                raise PmacError(ErrorCode.NO_BUFFER_OPEN, "only settings may stand before OPEN PROG")
            index = int(evaluate(statement.target.index, variables))
            try:
                value = evaluate(statement.value, variables)
            except NoResultError as error:
                substitutes[Substitute(program=0, line=place, detail=error.detail)] = None
                value = evaluate(statement.value, variables, strict=False)
            variables.set(statement.target.kind, index, value)


class _CalculatedRequest(NamedTuple):
    """A request, and the state of the program when it was calculated: the first half of a `ProgramStep`."""

    program: int
    line: int
    main_line: int
    place: tuple[int, ...]
    request: Request
    by_move_time: bool


class _WatchedRun(ProgramRun):
    """Keeps the requests that the planner took: it may take one ahead."""

    def __init__(
        self, text: ProgramText, variables: VariableStore, positions: Mapping[str, float], watched: bool
    ) -> None:
        self._watched = watched
        self.taken: deque[_CalculatedRequest] = deque()
        self.switches: list[Switch] = []
        self.substitutes: dict[Substitute, None] = {}
        self._requests = 0
        self._own_modes = Modes()
        if isinstance(variables, WatchedVariables):
            variables.on_compensation = lambda on: self.switches.append(
                Switch(step=self._requests, on=on, program=self.program, line=self.line)
            )
        super().__init__(
            link(text.program),
            variables,
            self._own_modes,
            positions,
            library=text.code,
            number=text.number,
            on_substitute=self._substitute,
        )

    def _substitute(self, detail: str) -> None:
        self.substitutes[Substitute(program=self.program, line=self.line, detail=detail)] = None

    def advance(self) -> Request:
        request = super().advance()
        self.take(request)
        return request

    def take(self, request: Request) -> None:
        """Keep a request."""
        place, by_move_time = self.place() if self._watched else (), self._own_modes.by_move_time
        self.taken.append(
            _CalculatedRequest(self.program, self.line, self.first_line, place, request, by_move_time)
        )
        self._requests += 1


class _Walker:
    def __init__(
        self,
        text: ProgramText,
        variables: VariableStore,
        definitions: Sequence[AxisDefinition],
        start: Mapping[int, float],
    ) -> None:
        self._settled: dict[Substitute, None] = {}
        settle(text, variables, self._settled)
        self._compensated = variables.i(COMPENSATION) != 0.0
        self._written = variables.written if isinstance(variables, WatchedVariables) else None
        self._variables = variables
        self._text = text
        kinematics = kinematics_of(text.kinematics, variables, 1)
        ordered = sorted(definitions, key=lambda definition: definition.motor)
        self._definitions = tuple([with_kinematics(definition, kinematics) for definition in ordered])
        self._origins: dict[str, float] = {}
        self._start = tuple(float(start[d.motor]) for d in self._definitions)
        self._run = _WatchedRun(
            text, variables, self._positions(self._definitions, self._start), self._written is not None
        )
        self._planner = MotionPlanner(self._run, self._definitions, variables, self._start)
        self._segment_index = variables.dialect.index(FamilySetting.SEGMENT_MS, 1)
        self._steps: list[ProgramStep] = []
        self._left: list[LoopExit] = []

    def walk(self, counts_per_turn: Mapping[int, float], most_steps: int) -> Walk:
        turning = None
        for index, motor in enumerate(d.motor for d in self._definitions):
            if motor in counts_per_turn:
                turning = TurningMotor(index=index, counts=counts_per_turn[motor])
        loops = find_loops(self._text.program, self._text.subprograms.values())
        error = None
        try:
            ending = self._to_the_end(partial(EndlessWatch, loops, turning), most_steps)
        except PmacError as fault:
            ending, error = WalkEnding.ERROR, fault
        if ending is not WalkEnding.FINISHED:
            self._halt()
        return Walk(
            number=self._text.number,
            motors=tuple(d.motor for d in self._definitions),
            start=self._start,
            steps=tuple(self._steps),
            left=tuple(self._left),
            ending=ending,
            error=error,
            variables=self._variables,
            compensated=self._compensated,
            switches=tuple(self._run.switches),
            substitutes=(*self._settled, *self._run.substitutes),
        )

    def _to_the_end(self, new_watch: Callable[[], EndlessWatch], most_steps: int) -> WalkEnding:
        watch = new_watch()
        while len(self._steps) < most_steps:
            planned = self._planner.plan()
            self._add(planned)
            if planned.finished:
                return WalkEnding.FINISHED
            circle = None if self._written is None else watch.look(self._steps, self._written)
            if circle is not None:
                if not self._leave(circle):
                    return WalkEnding.ENDLESS
                watch = new_watch()
        return WalkEnding.TOO_LONG

    def _leave(self, circle: Circle) -> bool:
        """Set the flag that ends a loop; a loop that did not end after being left once is not tried again."""
        line = self._steps[-1].main_line
        tried = [left.circle.loop for left in self._left]
        flags: Mapping[Name, float] = {}
        if circle.loop is not None and circle.loop not in tried:
            flags = way_out(circle.loop, self._variables, self._variables.i(15) == 0.0) or {}
        for (kind, index), value in flags.items():
            self._variables.set(kind, index, value)
        self._left.append(LoopExit(circle=circle, line=line, step=len(self._steps) - 1, flags=flags))
        return bool(flags)

    def _add(self, planned: PlannedPieces) -> None:
        before = self._steps[-1] if self._steps else None
        begins_ms = ends_ms = before.ends_ms if before else 0.0
        at = before.at if before else self._start
        if planned.pieces:
            last = planned.pieces[-1]
            at = tuple([position_at(cubic, last.duration_ms) for cubic in last.cubics])
            ends_ms += sum([piece.duration_ms for piece in planned.pieces])
        if planned.event is not None:
            at = self._carry_out(planned.event, at)
        segment_ms = self._variables.i(self._segment_index)
        self._steps.append(ProgramStep(*self._run.taken.popleft(), planned, segment_ms, begins_ms, ends_ms, at))

    def _carry_out(self, event: Event, at: Vector) -> Vector:
        """Do what the program waits for: homing succeeds at zero, no trigger comes, a STOP is resumed."""
        definitions = self._definitions
        if isinstance(event, HomeRequest):
            at = tuple(0.0 if d.motor in event.motors else p for d, p in zip(definitions, at, strict=True))
        shifted = tuple(d.shift_origins(self._origins) for d in definitions)
        if isinstance(event, TriggerRequest):
            moved = [not event.moving.isdisjoint(d.axes) for d in shifted]
            ends = [d.counts(event.targets) for d in shifted]
            at = tuple(end if moves else p for end, moves, p in zip(ends, moved, at, strict=True))
        if isinstance(event, PresetRequest):
            refuse_inverse(definitions, "PSET")
            self._origins = preset_origins(self._origins, self._positions(shifted, at), event.positions)
            shifted = tuple(d.shift_origins(self._origins) for d in definitions)
        self._planner.relocate(at, shifted)
        self._run.relocate(self._positions(shifted, at))
        return at

    def _positions(self, definitions: Sequence[AxisDefinition], at: Vector) -> dict[str, float]:
        by_motor = {definition.motor: definition for definition in definitions}
        return axis_positions(by_motor, dict(zip(by_motor, at, strict=True)))

    def _halt(self) -> None:
        """Let the motion stop where the walk ends."""
        self._run.taken.clear()
        self._run.take(EndOfProgram())
        rates = tuple(self._variables.motor(d.motor, 15) for d in self._definitions)
        self._add(PlannedPieces(pieces=self._planner.halt(rates), finished=True))
