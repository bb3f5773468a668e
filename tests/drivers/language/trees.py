"""Trees of programs and PLCs, for property tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import cast

from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC, Dialect
from drivers.pmac.execution.move_times import Modes
from drivers.pmac.execution.run import ProgramRun
from drivers.pmac.language.expressions import COMPARATORS, FUNCTIONS, PRODUCTS, SUMS, negate_operand
from drivers.pmac.language.parser import (
    ARGUMENTS,
    CODES,
    HIGHEST_LABEL,
    HIGHEST_MOTOR,
    PORTS,
    READABLE,
    gather_moves,
    parse_line,
)
from drivers.pmac.language.plc_statements import HIGHEST_SYSTEM
from drivers.pmac.language.structure import ExecutableProgram, link
from drivers.pmac.language.syntax import (
    AXES,
    VECTOR,
    Address,
    Argument,
    Assign,
    AxisWord,
    Binary,
    Block,
    Call,
    CallProgram,
    Comparison,
    Condition,
    Else,
    EndIf,
    EndWhile,
    Expression,
    Feedrate,
    FurtherCondition,
    Gosub,
    Goto,
    HomeMotors,
    If,
    Junction,
    Label,
    Line,
    Message,
    Move,
    Normal,
    Number,
    Pause,
    PlcStatement,
    PlcSwitch,
    Positioning,
    Preset,
    Read,
    Return,
    SelectMode,
    Set,
    Statement,
    Stop,
    Variable,
    VariableKind,
    Wait,
    While,
)
from drivers.pmac.requests import ADDRESS_OF_PROGRAMS, BlendBreak, DefaultAddress, EndOfProgram, Request
from drivers.pmac.settings import settings_with
from drivers.pmac.variables import VariableStore

constants = (
    st.integers(-(10**6), 10**6).map(float)
    | st.decimals(-1000, 1000, places=4).map(float)
    | st.floats(-1e15, 1e15, allow_nan=False)
).map(lambda value: Number(value or 0.0))
kinds = st.sampled_from(list(VariableKind))
plain_variables = st.builds(lambda kind, n: Variable(kind, Number(float(n))), kinds, st.integers(0, 9999))


def grow(inner: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
    return (
        st.builds(Binary, st.sampled_from(SUMS + PRODUCTS), inner, inner)
        | st.builds(Call, st.sampled_from(FUNCTIONS), inner)
        | st.builds(negate_operand, inner)
        | st.builds(Variable, kinds, inner)
    )


expressions: st.SearchStrategy[Expression] = st.recursive(constants | plain_variables, grow, max_leaves=6)
variables = st.builds(Variable, kinds, expressions)
comparisons = st.builds(Comparison, st.sampled_from(COMPARATORS), expressions, expressions)


def chain(operator: str) -> Callable[[list[Condition]], Condition]:
    def fold(parts: list[Condition]) -> Condition:
        joined = parts[0]
        for part in parts[1:]:
            joined = Junction(operator, joined, part)
        return joined

    return fold


conjunctions = st.lists(comparisons, min_size=1, max_size=3).map(
    lambda parts: chain("AND")(cast(list[Condition], parts))
)
conditions = st.lists(conjunctions, min_size=1, max_size=2).map(chain("OR"))
axes = st.sampled_from(AXES)


def words_of(letters: tuple[str, ...], least: int = 1) -> st.SearchStrategy[tuple[AxisWord, ...]]:
    """Words with different letters."""
    words = st.builds(AxisWord, st.sampled_from(letters), expressions)
    return st.lists(words, min_size=least, max_size=3, unique_by=lambda word: word.axis).map(tuple)


letters = st.lists(axes, max_size=3).map(tuple)
quoted = st.text(st.characters(min_codepoint=32, max_codepoint=126, exclude_characters='"'), max_size=12)
controls = st.integers(1, 26).map(chr)
arguments = st.builds(Argument, st.sampled_from(ARGUMENTS), expressions)
codes = st.builds(CallProgram, expressions, st.sampled_from(["", *CODES]))
axis_moves = st.builds(AxisWord, axes, expressions, st.none() | expressions)
vectors = st.builds(AxisWord, st.sampled_from([*VECTOR, "R"]), expressions)
moves = (axis_moves | vectors).map(lambda word: Move((word,)))
modal: st.SearchStrategy[Statement] = st.one_of(
    st.builds(Set, st.sampled_from(["TA", "TS", "TM", "F", "PVT"]), expressions),
    st.sampled_from(["LINEAR", "RAPID", "SPLINE1", "SPLINE2", "CIRCLE1", "CIRCLE2"]).map(SelectMode),
    st.builds(Positioning, st.booleans(), st.lists(st.sampled_from([*AXES, "R"]), max_size=3).map(tuple)),
    st.builds(Feedrate, letters) | st.just(Feedrate(none=True)),
)
assignments = st.builds(Assign, variables, expressions) | st.builds(
    Assign,
    st.builds(Variable, st.just(VariableKind.M), expressions),
    expressions,
    st.just(True),
    st.sampled_from(["", "&", "|", "^"]),
)
calling: st.SearchStrategy[list[Statement]] = st.builds(
    lambda call, tail: [call, *tail], codes, st.lists(moves | modal | assignments | arguments | codes, max_size=4)
)
messages = st.one_of(
    st.builds(Message, st.sampled_from(["CMD", "SEND"]), quoted | controls, st.sampled_from(["", *PORTS])),
    st.builds(Message, st.just("DISPLAY"), quoted, place=st.none() | st.integers(0, 79)),
)
numbers = st.lists(st.integers(1, 31), min_size=1, max_size=4).map(tuple)
flow: st.SearchStrategy[Statement] = st.one_of(
    st.builds(While, conditions),
    st.builds(If, conditions),
    st.sampled_from([EndWhile(), Else(), EndIf(), Return(), Pause(), Stop(), Block(True), Block(False)]),
    st.builds(Label, st.integers(0, HIGHEST_LABEL)),
    st.builds(Goto, expressions) | st.builds(Gosub, expressions),
    st.lists(st.sampled_from(READABLE), min_size=1, max_size=4).map(tuple).map(Read),
)
others: st.SearchStrategy[Statement] = st.one_of(
    st.builds(Normal, words_of(VECTOR)),
    st.builds(Preset, words_of(AXES)),
    st.builds(HomeMotors, numbers, st.booleans()),
    st.builds(Wait, st.sampled_from(["DWELL", "DELAY"]), expressions),
    st.builds(Argument, st.just("S"), expressions),
    messages,
    st.builds(PlcSwitch, st.booleans(), numbers),
)
statements = modal | assignments | moves | flow | others


def canonical(loose: list[Statement]) -> Line:
    """Make a line as the parser would: moves joined, conditions inline unless they end the line."""
    line = gather_moves(loose)
    marked: list[Statement] = []
    for place, statement in enumerate(line):
        inline = place < len(line) - 1
        match statement:
            case While(condition):
                marked.append(While(condition, inline))
            case If(condition):
                marked.append(If(condition, inline))
            case Else():
                marked.append(Else(inline))
            case _:
                marked.append(statement)
    return tuple(marked)


def is_absorbed(line: Line) -> bool:
    """Whether NORMAL or PSET would take the first word of the move behind it as its own."""
    return any(
        isinstance(here, Normal | Preset)
        and isinstance(following, Move)
        and following.words[0].axis in (VECTOR if isinstance(here, Normal) else AXES)
        and following.words[0].axis not in [word.axis for word in here.words]
        for here, following in pairwise(line)
    )


lines = (
    st.lists(st.lists(statements, max_size=3) | calling, max_size=3)
    .map(lambda parts: canonical([statement for part in parts for statement in part]))
    .filter(lambda line: not is_absorbed(line))
)


# Strategies for property tests: lines of a PLC, as the parser makes them.

addresses = st.builds(
    Address, st.none() | st.integers(1, HIGHEST_MOTOR), st.none() | st.integers(1, HIGHEST_SYSTEM)
).filter(lambda address: address != Address())
plc_statements: st.SearchStrategy[PlcStatement] = st.one_of(
    st.builds(If, conditions),
    st.builds(While, conditions),
    st.builds(FurtherCondition, st.sampled_from(["AND", "OR"]), conditions),
    st.sampled_from([Else(), EndIf(), EndWhile()]),
    st.builds(Assign, variables, expressions),
    st.builds(PlcSwitch, st.booleans(), numbers),
    messages,
    addresses,
)
plc_lines = st.lists(plc_statements, max_size=4).map(tuple)


ORIGIN = {"X": 0.0, "Y": 0.0, "Z": 0.0}


def code_of(text: str) -> ExecutableProgram:
    return link(tuple(parse_line(line) for line in text.split("\n")))


@dataclass
class Listener:
    """A host that writes down what it is told."""

    heard: list[tuple[object, ...]] = field(default_factory=list)

    def command(self, text: str, port: str, addressed: DefaultAddress = ADDRESS_OF_PROGRAMS) -> None:
        self.heard.append(("command", text, port))

    def send(self, text: str, port: str) -> None:
        self.heard.append(("send", text, port))

    def display(self, text: str) -> None:
        self.heard.append(("display", text))

    def switch_plc(self, enable: bool, numbers: tuple[int, ...], keeping: bool = False) -> None:
        self.heard.append(
            (("resume" if enable else "pause") if keeping else ("enable" if enable else "disable"), *numbers)
        )


class Bench:
    """One coordinate system: its variables, modes and programs outlive a run."""

    def __init__(self, dialect: Dialect = PMAC, system: int = 1, **variables: float) -> None:
        self.store = VariableStore(settings_with({}, dialect), dialect)
        self.system = system
        self.modes = Modes()
        self.host = Listener()
        self.programs: dict[int, str] = {}
        for name, value in variables.items():
            self.store.set(VariableKind(name[0]), int(name[1:]), value, system)

    def value(self, name: str) -> float:
        return self.store.get(VariableKind(name[0]), int(name[1:]), self.system)

    def start(
        self,
        text: str,
        positions: Mapping[str, float] = ORIGIN,
        label: int | None = None,
        strict: bool = True,
        number: int = 0,
    ) -> ProgramRun:
        return ProgramRun(
            code_of(text),
            self.store,
            self.modes,
            positions,
            self.system,
            strict,
            library=self.library,
            host=self.host,
            label=label,
            number=number,
        )

    def library(self, number: int) -> ExecutableProgram | None:
        text = self.programs.get(number)
        return None if text is None else code_of(text)

    def run(self, text: str, positions: Mapping[str, float] = ORIGIN, looks: int = 1000) -> list[Request]:
        """Return every request up to the end, without that."""
        return requests_of(self.start(text, positions), looks)


def requests_of(run: ProgramRun, looks: int = 1000) -> list[Request]:
    requests: list[Request] = []
    for _ in range(looks):
        request = run.advance()
        if isinstance(request, EndOfProgram):
            return requests
        if not isinstance(request, BlendBreak):
            requests.append(request)
    raise AssertionError(f"no end after {looks} requests")


def targets(requests: list[Request], axis: str = "X") -> list[float]:
    """Where the moves go."""
    return [request.targets[axis] for request in requests if hasattr(request, "targets")]
