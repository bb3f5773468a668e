"""Linked programs: who jumps where, and what is refused. The branches are the manual's examples."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.evaluate import compile_condition, compile_expression
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.structure import Code, link
from drivers.pmac.language.syntax import Assign, Else, EndWhile, If, VariableKind, While


class Store:
    """Variables that a program can set."""

    def __init__(self, **values: float) -> None:
        self.values = dict(values)

    def get(self, kind: VariableKind, index: int) -> float:
        return self.values.get(f"{kind}{index}", 0.0)


def code_of(text: str) -> Code:
    return link(tuple(parse_line(line) for line in text.split("\n")))


def run(text: str, **values: float) -> dict[str, float]:
    """Run the assignments of a program and return its variables."""
    code, store = code_of(text), Store(**values)
    counter = steps = 0
    while counter < len(code.instructions):
        steps += 1
        assert steps < 1000
        statement, target = code.instructions[counter], code.jumps[counter]
        counter += 1
        if isinstance(statement, Assign):
            index = int(compile_expression(statement.target.index)(store))
            store.values[f"{statement.target.kind}{index}"] = compile_expression(statement.value)(store)
        elif isinstance(statement, While | If):
            counter = counter if compile_condition(statement.condition)(store) else target
        elif isinstance(statement, EndWhile | Else):
            counter = target
    return store.values


def test_the_jumps_of_a_loop() -> None:
    code = code_of("WHILE(P1<3)\n\nP1=P1+1\nENDW\nX1")
    assert code.jumps == (3, -1, 0, -1)
    assert code.line_of == (0, 2, 3, 4)


def test_the_jumps_of_a_branch() -> None:
    code = code_of("IF(P1=0)\nX1\nELSE\nX2\nENDIF\nX3")
    assert code.jumps == (3, -1, 5, -1, -1, -1)


def test_a_loop_counts() -> None:
    assert run("WHILE(P1<10)\nP1=P1+1\nENDWHILE\nP2=P1")["P2"] == 10
    assert run("WHILE(P1<10) P1=P1+1\nP2=P1")["P2"] == 10


MULTI_MULTI = "IF (M11=1)\nP1=17\nP2=13\nELSE\nP1=13\nP2=17\nENDIF\nP3=1"
MULTI_SINGLE = "IF (M11=1)\nP1=17\nP2=13\nELSE P1=13 P2=17\nP3=1"
SINGLE_MULTI = "IF (M11=1) P1=17 P2=13\n; comment\nELSE\nP1=13\nP2=17\nENDIF\nP3=1"
SINGLE_SINGLE = "IF (M11=1) P1=17 P2=13\nELSE P1=13 P2=17\nP3=1"
ONE_LINE = "IF (M11=1) P1=17 P2=13 ELSE P1=13 P2=17\nP3=1"


@pytest.mark.parametrize("text", [MULTI_MULTI, MULTI_SINGLE, SINGLE_MULTI, SINGLE_SINGLE, ONE_LINE])
def test_the_forms_of_a_branch(text: str) -> None:
    chosen = run(text, M11=1)
    assert (chosen["P1"], chosen["P2"], chosen["P3"]) == (17, 13, 1)
    chosen = run(text, M11=0)
    assert (chosen["P1"], chosen["P2"], chosen["P3"]) == (13, 17, 1)


def test_a_single_line_branch_ends_with_its_line() -> None:
    assert run("IF(P9=1) P1=1\nP2=2") == {"P2": 2}
    assert run("IF(P9=1) P1=1 ENDIF\nP2=2") == {"P2": 2}


def test_an_else_belongs_to_the_nearest_single_line_branch() -> None:
    text = "IF(P8=1)\nIF(P9=1) P1=1\nELSE P1=2\nENDIF"
    assert run(text, P8=0) == {"P8": 0}
    assert run(text, P8=1)["P1"] == 2
    assert run("IF(P8=1) IF(P9=1) P1=1\nELSE P1=2", P8=0) == {"P8": 0}


def test_loops_and_branches_nest() -> None:
    text = "WHILE(P1<4)\nP1=P1+1\nIF(P1%2=0) P2=P2+1\nELSE\nWHILE(P3<P1) P3=P3+1\nENDIF\nENDW"
    values = run(text)
    assert (values["P1"], values["P2"], values["P3"]) == (4, 2, 3)


def test_an_implied_end_belongs_to_the_line_it_closes() -> None:
    code = code_of("WHILE(P1<3) P1=P1+1\nX1")
    assert code.line_of == (0, 0, 0, 1)
    assert code.instructions[2] == EndWhile()


def test_labels_are_found_and_the_beginning_is_n0_unless_another_line_is() -> None:
    code = code_of("X1\nN10 X2\nN10 X3\nIF(P1=0)\nN20 X4\nENDIF")
    assert [code.find(label) for label in (10, 20, 0, 30)] == [1, 6, 0, None]
    assert code_of("X1\nN0 X2").find(0) == 1
    assert code_of("").find(0) == 0


def test_the_empty_program_has_no_instructions() -> None:
    assert code_of("\n\n") == Code((), (), ())


@pytest.mark.parametrize(
    "text",
    [
        "ENDW",
        "ENDIF",
        "ELSE",
        "WHILE(P1=0)\nENDIF",
        "IF(P1=0)\nENDW\nENDIF",
        "IF(P1=0)\nELSE\nELSE\nENDIF",
        "WHILE(P1=0)\nELSE\nENDW",
        "WHILE(P1=0) X1\nENDW",
        "IF(P1=0) X1\nX2\nELSE X3",
        "IF(P1=0) WHILE(P2=0)\nX1\nENDW",
        "IF(P1=0) X1\nELSE X2\nELSE X3",
    ],
)
def test_an_end_without_its_beginning_is_a_structural_error(text: str) -> None:
    with pytest.raises(PmacError) as refusal:
        code_of(text)
    assert refusal.value.code == 9


@pytest.mark.parametrize("text", ["WHILE(P1=0)\nX1", "IF(P1=0)", "IF(P1=0) X1\nELSE\nX2", "WHILE(P1=0)"])
def test_a_missing_end_is_an_improper_structure(text: str) -> None:
    with pytest.raises(PmacError) as refusal:
        code_of(text)
    assert refusal.value.code == 16


SHAPES = [
    "",
    "X1",
    "WHILE(P1=0)",
    "ENDW",
    "IF(P1=0)",
    "ELSE",
    "ENDIF",
    "IF(P1=0) X1",
    "ELSE X2",
    "WHILE(P1=0) X1",
]
SHAPES += ["IF(P1=0) WHILE(P2=0) X1", "WHILE(P1=0) IF(P2=0) X1", "IF(P1=0) X1 ELSE X2", "IF(P1=0) IF(P2=0)"]


@given(st.lists(st.sampled_from(SHAPES), max_size=12).map("\n".join))
def test_any_program_is_linked_or_refused(text: str) -> None:
    try:
        code = code_of(text)
    except PmacError as refusal:
        assert refusal.code in (9, 16)
        return
    assert len(code.instructions) == len(code.line_of) == len(code.jumps)
    for place, (statement, jump) in enumerate(zip(code.instructions, code.jumps, strict=True)):
        if isinstance(statement, EndWhile):
            assert isinstance(code.instructions[jump], While) and jump < place
        elif isinstance(statement, While | If | Else):
            assert place < jump <= len(code.instructions)
        else:
            assert jump == -1
    assert list(code.line_of) == sorted(code.line_of)
