"""Texts of other people's editors: their comments and names are understood, and each line keeps its place."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.preprocessor import MOST_LINES, preprocess


def sent(text: str) -> list[tuple[int, str]]:
    lines = list(preprocess(text))
    assert not [line.error for line in lines if line.error is not None]
    return [(int(line.place), line.text) for line in lines]


@pytest.mark.parametrize(
    ("text", "kept"),
    [
        ("X1 // to the part", [(1, "X1")]),
        ("X1 /* there */ Y2", [(1, "X1   Y2")]),
        ("/* one\ntwo ; three // four\n*/ X1\nY2", [(3, "X1"), (4, "Y2")]),
        ("/*/ not closed yet\n*/X1", [(2, "X1")]),
        ('CMD"#1J/" // a slash and quotes', [(1, 'CMD"#1J/"')]),
        ('SEND"a // b /* c ; d"', [(1, 'SEND"a // b /* c ; d"')]),
        ("P1=6/2 ; half", [(1, "P1=6/2")]),
        ('// "one quote\nX1', [(2, "X1")]),
    ],
)
def test_comments_of_an_editor_are_not_sent(text: str, kept: list[tuple[int, str]]) -> None:
    assert sent(text) == kept


@given(st.lists(st.sampled_from(["/*", "*/", "//", ";", '"', "X1", "/", "*", "\n", "CMD"]), max_size=12))
def test_no_comment_breaks_the_reader(pieces: list[str]) -> None:
    lines = list(preprocess("".join(pieces)))
    assert all(line.text and int(line.place) >= 1 for line in lines)


def test_an_open_comment_is_told_with_its_place() -> None:
    (last,) = [line for line in preprocess("X1\n/* for ever\nX2") if line.error is not None]
    assert last.place == 2 and "without" in str(last.error)


@pytest.mark.parametrize(
    ("line", "becomes"),
    [
        ("M1->X:$VarAdr30,4", "M1->X:$6030,4"),
        ("P1=Var2", "P1=Var2"),
        ("P1=VarAdr", "P1=60"),
        ("P1=VarAdrX", "P1=VarAdrX"),
    ],
)
def test_a_name_is_replaced_in_front_of_digits(line: str, becomes: str) -> None:
    assert sent(f"#define VarAdr 60\n{line}") == [(2, becomes)]


def test_a_whole_name_comes_before_the_beginning_of_one() -> None:
    assert sent("#define Ax 5\n#define Ax1 7\nP1=Ax1 P2=Ax2") == [(3, "P1=7 P2=52")]


def test_the_backup_of_a_full_controller_is_read() -> None:
    text = "\n".join(["OPEN PROG1", *("X1" for _ in range(150_095)), "CLOSE"])
    assert len(sent(text)) == 150_097
    refused = list(preprocess("X1\n" * (MOST_LINES + 1)))[-1]
    assert refused.error is not None and str(MOST_LINES) in str(refused.error)
