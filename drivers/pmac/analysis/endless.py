"""Detect when a program loops for ever, how long to watch the loop, and the flag with which a host would end it.

Two signs: a WHILE that nothing inside it can end, and a program that returns to a place with exactly the same
values in its variables as before. The first is a static analysis: nothing inside can change what the condition
reads, and no GOTO or RETURN leads out of it. What a called subroutine changes counts as changed inside.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations, product

from drivers.pmac.analysis.timeline import ProgramStep, same_motion
from drivers.pmac.language import syntax
from drivers.pmac.language.errors import EvaluationError
from drivers.pmac.language.evaluate import Variables, holds
from drivers.pmac.language.syntax import VariableKind

Name = tuple[VariableKind, int]  # One numbered variable

Written = Mapping[tuple[VariableKind, int, int], float]
"""The values that a program has set: by kind, number and coordinate system."""

MOST_PASSES = 400  # Maximum passes of an endless loop whose motion never repeats

STEADY_PASSES = 3
STEADY_TURNS = 3.0
"""How long the repeated motion of an endless loop is watched: passes, and turns of the spindle."""

MOST_FLAGS = 3  # Maximum variables of a condition that are tried together; with more it is not a plain flag


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """A WHILE from its line to that of its end (counted from 0, inclusive).

    `names` are the variables of its condition, `free` those that nothing inside assigns. `endless` when all are.
    """

    first: int
    last: int
    condition: syntax.Condition
    names: tuple[Name, ...]
    free: tuple[Name, ...]
    endless: bool


def find_loops(program: syntax.Program, called: Iterable[syntax.Program] = ()) -> tuple[Loop, ...]:
    """Return every WHILE of a program, inner ones before those around them; `called` are its subprograms."""
    others = [line for other in called for line in other]
    return tuple(_loop(program, head, first, last, others) for head, first, last in _whiles(program))


def find_enclosing_loops(loops: Iterable[Loop], line: int) -> Iterator[Loop]:
    """Yield the loops that contain a line, from the inside out."""
    return (loop for loop in loops if loop.first <= line <= loop.last)


def way_out(loop: Loop, variables: Variables, degrees: bool) -> Mapping[Name, float] | None:
    """Return values of variables for which the condition fails, None where there are none.

    A host ends such a loop by setting a flag; of several ways the one with the fewest variables is taken, and
    those that the loop does not set come first.
    """
    names = loop.free or loop.names
    if not 0 < len(names) <= MOST_FLAGS:
        return None
    constants = {number.value for number in _walk(loop.condition) if isinstance(number, syntax.Number)}
    for count in range(1, len(names) + 1):
        for chosen in permutations(names, count):
            # First 1 and 0, then either side of the constants and of now.
            places = [sorted(constants | {variables.get(*name)}) for name in chosen]
            tried = [[1.0, 0.0, *(at + step for at in each for step in (1.0, -1.0, 0.0))] for each in places]
            for values in product(*tried):
                changed = dict(zip(chosen, values, strict=True))
                if _fails(loop.condition, _ChangedVariables(variables, changed), degrees):
                    return changed
    return None


@dataclass(frozen=True, slots=True)
class _ChangedVariables:
    """Variables, some of them with other values."""

    under: Variables
    values: Mapping[Name, float]

    def get(self, kind: VariableKind, index: int) -> float:
        changed = self.values.get((kind, index))
        return self.under.get(kind, index) if changed is None else changed


def _whiles(program: syntax.Program) -> Iterator[tuple[syntax.While, int, int]]:
    """Yield each WHILE with its first and last line; one without an end reaches to the end of the program."""
    opened: list[tuple[syntax.While, int]] = []
    for number, line in enumerate(program):
        for statement in line:
            if isinstance(statement, syntax.While):
                opened.append((statement, number))
            elif isinstance(statement, syntax.EndWhile) and opened:
                yield (*opened.pop(), number)
        while opened and opened[-1][0].inline:
            yield (*opened.pop(), number)
    while opened:
        yield (*opened.pop(), len(program) - 1)


def _loop(program: syntax.Program, head: syntax.While, first: int, last: int, others: list[syntax.Line]) -> Loop:
    inside = program[first : last + 1]
    body = [statement for line in inside for statement in line]
    if any(isinstance(statement, syntax.Gosub | syntax.CallProgram) for statement in body):
        body += [statement for line in (*program[last + 1 :], *others) for statement in line]
    names, computed = _names(head.condition)
    fixed, anywhere = _find_assigned(body)
    free = tuple(name for name in names if name not in fixed and name[0] not in anywhere)
    commands = any(isinstance(statement, syntax.Message) and statement.word == "CMD" for statement in body)
    leaves = any(_leaves(statement, inside) for line in inside for statement in line)
    endless = len(free) == len(names) and not (computed or commands or leaves)
    return Loop(first=first, last=last, condition=head.condition, names=names, free=free, endless=endless)


def _find_assigned(body: list[syntax.Statement]) -> tuple[set[Name | None], set[VariableKind]]:
    """Return the variables that statements assign, and the kinds of which they assign any."""
    targets = [statement.target for statement in body if isinstance(statement, syntax.Assign)]
    anywhere = {target.kind for target in targets if _name(target) is None}
    if any(isinstance(statement, syntax.Read) for statement in body):
        anywhere.add(VariableKind.Q)
    return {_name(target) for target in targets}, anywhere


def _leaves(statement: syntax.Statement, inside: syntax.Program) -> bool:
    if isinstance(statement, syntax.Return):
        return True
    if not isinstance(statement, syntax.Goto):
        return False
    labels = {other.number for line in inside for other in line if isinstance(other, syntax.Label)}
    return not (isinstance(statement.label, syntax.Number) and int(statement.label.value) in labels)


def _names(condition: syntax.Condition) -> tuple[tuple[Name, ...], bool]:
    """Return the variables of a condition, each once, and whether the number of one is computed."""
    variables = [part for part in _walk(condition) if isinstance(part, syntax.Variable)]
    names = [_name(part) for part in variables]
    return tuple(dict.fromkeys(name for name in names if name is not None)), None in names


def _name(variable: syntax.Variable) -> Name | None:
    """Return the variable, None where its number is computed."""
    index = variable.index
    return (variable.kind, int(index.value)) if isinstance(index, syntax.Number) else None


def _walk(part: syntax.Condition | syntax.Expression) -> Iterator[syntax.Condition | syntax.Expression]:
    yield part
    match part:
        case syntax.Junction(_, left, right) | syntax.Comparison(_, left, right) | syntax.Binary(_, left, right):
            yield from _walk(left)
            yield from _walk(right)
        case syntax.Negate(operand):
            yield from _walk(operand)
        case syntax.Call(_, argument):
            yield from _walk(argument)
        case syntax.Variable(_, index) if not isinstance(index, syntax.Number):
            yield from _walk(index)


def _fails(condition: syntax.Condition, variables: Variables, degrees: bool) -> bool:
    try:
        return not holds(condition, variables, degrees)
    except EvaluationError:
        return False


@dataclass(frozen=True, slots=True, kw_only=True)
class TurningMotor:
    """The motor that turns the part, by its place in every vector, and its counts per turn."""

    index: int
    counts: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Circle:
    """An endless loop of a program: the WHILE (None: without one), and whether its motion repeats.

    The last `period` steps, where they repeat, are one round; there were `passes` of them.
    """

    loop: Loop | None
    period: int | None
    passes: int


class EndlessWatch:
    """Checks every step of a walk for endless loops."""

    def __init__(self, loops: Sequence[Loop], turning: TurningMotor | None) -> None:
        """Take the loops of the program that is started."""
        self._endless = tuple(loop for loop in loops if loop.endless)
        self._loops = tuple(loops)
        self._turning = turning
        self._recurrence = _Recurrence()
        self._rounds: dict[tuple[Loop | None, tuple[int, ...]], _Rounds] = {}

    def look(self, steps: Sequence[ProgramStep], written: Written) -> Circle | None:
        """Return the endless loop that the program is in, once it has been watched for long enough."""
        newest = steps[-1]
        loop = next(find_enclosing_loops(self._loops, newest.main_line), None)
        if loop is not None and any(find_enclosing_loops(self._endless, newest.main_line)):
            # A line of an inner loop, which ends by itself, recurs within one pass.
            return self._pass(steps, loop) if loop.endless else None
        return self._pass(steps, loop) if self._recurrence.has_come_again(newest.place, written) else None

    def _pass(self, steps: Sequence[ProgramStep], loop: Loop | None) -> Circle | None:
        # Which of the places in a loop recurs shows in time: each is counted by itself.
        rounds = self._rounds.setdefault((loop, steps[-1].place), _Rounds())
        rounds.starts.append(len(steps) - 1)
        passes = len(rounds.starts) - 1
        if not passes:
            return None
        repeats = False
        if passes >= 2:
            first, second, third = (start + 1 for start in rounds.starts[-3:])
            repeats = same_motion(steps[second:third], steps[first:second])
        rounds.steady = rounds.steady + 1 if repeats else 0
        if rounds.steady >= STEADY_PASSES and self._has_turned(steps, rounds):
            return Circle(loop=loop, period=rounds.starts[-1] - rounds.starts[-2], passes=passes)
        return Circle(loop=loop, period=None, passes=passes) if passes >= MOST_PASSES else None

    def _has_turned(self, steps: Sequence[ProgramStep], rounds: _Rounds) -> bool:
        """Return whether the spindle stands, or has made its turns since the motion repeats."""
        if self._turning is None:
            return True
        index = self._turning.index
        now, before = steps[-1].at[index], steps[rounds.starts[-2]].at[index]
        since = steps[rounds.starts[-1 - rounds.steady]].at[index]
        return now == before or abs(now - since) >= STEADY_TURNS * self._turning.counts


@dataclass(slots=True)
class _Rounds:
    """The steps at which a place was reached, and how many of the last rounds repeat the one before them."""

    starts: list[int] = field(default_factory=list)
    steady: int = 0


@dataclass(slots=True)
class _Recurrence:
    """Detects a recurring program state, by Brent's method: one state is kept, at distances that double."""

    place: tuple[int, ...] = ()
    written: dict[tuple[VariableKind, int, int], float] = field(default_factory=dict)
    since: int = 0
    power: int = 1

    def has_come_again(self, place: tuple[int, ...], written: Written) -> bool:
        self.since += 1
        if place == self.place and written == self.written:
            self.since = 0
            return True
        if self.since >= self.power:
            self.place, self.written = place, dict(written)
            self.power, self.since = 2 * self.power, 0
        return False
