"""Any program is executed or ends with an error, in blocks of written code as statement by statement."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.analysis.watched_variables import WatchedVariables
from drivers.pmac.dialect import PMAC, TURBO
from drivers.pmac.execution import run as running
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.structure import link
from drivers.pmac.language.syntax import Line, VariableKind
from drivers.pmac.language.text import format_line
from drivers.pmac.requests import BlendBreak, EndOfProgram, Request
from drivers.pmac.settings import settings_with
from drivers.pmac.variables import VariableStore
from tests.drivers.language.trees import Bench, lines

LOOKS = 30

programs = st.lists(lines, max_size=8).map(tuple)

FLOW = (
    "N1|N2|GOTO1|GOTO2|GOSUB1|GOSUB2|RETURN|CALL5|CALL5.00002|G1|M2|WHILE(P1<9)|ENDW|IF(P1<5)|ELSE|ENDIF|WAIT|STOP"
)
WORDS = (
    "P1=P1+1|P2=P2-1|READ(X,P)|X(P1)|Y2 I3|P7|PSET X1|M1==P1|M1^=4|TM5|TA0|F0|PVT5|SPLINE1|CIRCLE2|RAPID|INC|HOME1"
)
phrases = st.sampled_from([*FLOW.split("|"), *WORDS.split("|")])
texts = st.lists(st.lists(phrases, max_size=4).map(" ".join), max_size=12).map("\n".join)


def run_as_far_as_it_goes(bench: Bench, text: str, strict: bool) -> None:
    """Nothing but a PmacError may come out of it."""
    try:
        run = bench.start(text, strict=strict)
        for _ in range(LOOKS):
            if isinstance(run.advance(), EndOfProgram):
                return
    except PmacError:
        return


def written(program: tuple[Line, ...]) -> str:
    return "\n".join(map(format_line, program))


@given(programs, programs, st.booleans())
def test_any_tree_is_executed_or_ends_with_an_error_of_the_card(
    program: tuple[Line, ...], other: tuple[Line, ...], turbo: bool
) -> None:
    bench = Bench(TURBO if turbo else PMAC)
    bench.programs = dict.fromkeys((1, 1000, 1001), written(other))
    run_as_far_as_it_goes(bench, written(program), strict=not turbo)


@given(texts, texts)
def test_any_order_of_words_is_executed_or_ends_with_an_error_of_the_card(text: str, other: str) -> None:
    bench = Bench()
    bench.programs = dict.fromkeys((5, 1000, 1001), other)
    run_as_far_as_it_goes(bench, text, strict=False)


@given(programs)
def test_a_program_that_is_written_and_read_again_is_the_same(program: tuple[Line, ...]) -> None:
    again = tuple(parse_line(line) for line in map(format_line, program))
    assert again == program
    try:
        code = link(program)
    except PmacError as refused:
        assert refused.code in (9, 16)
        return
    assert link(again) == code
    assert all(0 <= place < len(code.instructions) for place in code.labels.values())


# What a program does again and again is written as Python, and stays what its statements are one by one.

EVERY_OPERATOR = """P1=0 P2=-3
WHILE(P1<60)
P1=P1+1
P2=P2*-1.5+P1/7-P1%4+P1/0+P1%(P1-30)
P3=(P1&5)|(P1^3) P4=-P2
P(10+P1%3)=P1 Q1=Q1+P(10+P1%3) M5=P3-M5 I200=P1*0.001
P5=SIN(P1)+COS(P2)+TAN(P1)+ATAN(P2)+ATAN2(P1)+ASIN(P1/30)+ACOS(0.5)
P6=LN(P1-20)+EXP(P1/20)+SQRT(P1-30)+ABS(P2)+INT(P2)
IF(P1>20 AND P1!>40 OR P2~P3)
P7=P7+1
ELSE
P8=P8+1
ENDIF
IF(P1!~P7) P9=P9+P1
X(P2/1E3):(P5) Y(-P6) P1000=P1000+1
IF(P2>1E6) P2=0
M9==P1
ENDWHILE""".replace("1E3", "1000").replace("1E6", "1000000")

CALLS = """P1=0
N10
P1=P1+1
GOSUB100
IF(P1<40) GOTO10
RETURN
N100 P2=P2+P1
IF(P2>500) P2=P2-500 P3=P3+1
X(P2)
CALL2
RETURN"""

CALLED = "P5=P5+P1\nP6=P6+P5"  # a program that ends with a calculation


@dataclass
class Seen:
    """What a program asks for, with the line of each, and what it leaves behind."""

    requests: list[tuple[int, Request]]
    variables: list[float]
    error: tuple[int, str, int] | None


def seen(text: str, store: VariableStore, strict: bool) -> Seen:
    bench = Bench()
    bench.store = store
    bench.programs[2] = CALLED
    run = bench.start("PVT3\n" + text if ":" in text else text, strict=strict)
    requests: list[tuple[int, Request]] = []
    error = None
    try:
        for _ in range(1000):
            request = run.advance()
            requests.append((run.line, request))
            if isinstance(request, EndOfProgram):
                break
    except PmacError as fault:
        error = run.line, str(fault), run.first_line
    left = [store.get(kind, index) for kind in VariableKind for index in range(1024)]
    return Seen(requests, left, error)


def both(text: str, strict: bool = False) -> tuple[Seen, Seen]:
    """Executed with blocks, and by the statement, as where each assignment is watched."""
    settings = settings_with({}, PMAC)
    quick, singly = VariableStore(settings), WatchedVariables(settings, PMAC)
    assert quick.p_values is not None
    assert singly.p_values is None
    return seen(text, quick, strict), seen(text, singly, strict)


@pytest.mark.parametrize("text", [EVERY_OPERATOR, CALLS])
def test_a_loop_of_many_turns_is_that_of_its_statements(text: str) -> None:
    quick, singly = both(text)
    assert quick == singly
    assert (len(quick.requests) > 40, quick.error) == (True, None)


@pytest.mark.parametrize(
    "calculation",
    (
        "P2=P2*1000000000000 P3=1 | P2=1/(P1-30) | P2=LN(30-P1) | P2=P1%(P1-30) | P2=EXP(P1*25) | "
        "P(1000+P1)=1 | P2=P(1000+P1) | Q(1000+P1)=1 | IF(SQRT(30-P1)>2) P3=1 | X(P1/(P1-30)) | F(0-P1) X(1)"
    ).split(" | "),
)
def test_a_run_time_error_in_a_late_turn_is_the_same_in_the_same_line(calculation: str) -> None:
    quick, singly = both(f"P2=1\nWHILE(P1<60)\nP1=P1+1\n{calculation}\nP4=P4+1\nX(P1)\nENDWHILE", strict=True)
    assert quick == singly
    assert quick.error is not None


def test_a_long_calculation_gives_way_after_the_same_statement(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "STEPS_PER_LOOK", 333)
    calculations = "\n".join(["M9==P1 P1=P1+1 P2=P2+P1", "IF(P1>P2) P3=P3+1", "P4=P4+P1"] * 40)
    quick, singly = both(f"WHILE(P5<60)\nP5=P5+1\n{calculations}\nENDWHILE")
    assert quick == singly
    assert sum(isinstance(request, BlendBreak) for _, request in quick.requests) > 30  # of the ways back alone


def test_the_longest_and_deepest_expressions_are_those_of_their_statements() -> None:
    """100 operands, and parentheses inside each other: more is refused when a line is read."""
    long, deep = "+".join(["P1"] * 99), "ABS(" * 12 + "-P1" + ")" * 12
    quick, singly = both(f"WHILE(P1<40)\nP1=P1+1\nP2={long}\nP3={deep}\nENDWHILE")
    assert quick == singly
    assert quick.variables[1024 + 2 : 1024 + 4] == [99 * 40, 40]
