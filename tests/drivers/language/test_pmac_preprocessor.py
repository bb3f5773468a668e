"""#define, #include and #ifdef, with the line of the source in what is said of it."""

from __future__ import annotations

import pytest

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.preprocessor import MOST_CHARACTERS, MOST_LINES, Place, preprocess
from drivers.pmac.program_text import RefusedLine, read_program

FILES = {
    "speeds.h": "#define FAST 20\n\nX(FAST) ; here\nX10 bad\n",
    "again.h": '#include "again.h"\nX1\n',
    "twice.h": '#include "twice.h"\n' * 20,
}


def include(name: str) -> str:
    if name not in FILES:
        raise PmacError(ErrorCode.DATA_ERROR, f"#include {name}: no file that can be read")
    return FILES[name]


def lines(text: str) -> list[tuple[int, str]]:
    found = list(preprocess(text, include))
    assert [line.error for line in found if line.error] == []
    return [(line.place, line.text) for line in found]


def errors(text: str) -> list[tuple[int, str]]:
    return [(line.place, line.error.detail) for line in preprocess(text, include) if line.error is not None]


def test_names_are_replaced_where_they_are_whole_words() -> None:
    text = "#define FAST 20\n#define AT P(FAST+1)\nF(FAST) AT=FASTER fast ; FAST\nXFAST"
    assert lines(text) == [(3, "F(20) P(20+1)=FASTER fast"), (4, "XFAST")]


def test_names_in_quotes_are_those_of_commands() -> None:
    text = '#define TOOL #1\n#define GO J+\nCMD"TOOL GO" SEND"TOOL GO"\ncommandS"TOOL"'
    assert lines(text) == [(3, 'CMD"#1 J+" SEND"TOOL GO"'), (4, 'commandS"#1"')]


def test_conditions() -> None:
    text = "#define A\n#ifdef A\nX1\n#ifdef B\nX2\n#else\nX3\n#endif\n#else\nX4\n#endif\n#ifndef B\nX5\n#endif"
    assert lines(text) == [(3, "X1"), (7, "X3"), (13, "X5")]
    assert lines('#define A 1\n#undef A\n#ifdef A\n#include "gone.h"\n#endif\nX1') == [(6, "X1")]


def test_an_included_line_names_its_own_file_and_the_line_that_includes_it() -> None:
    found = list(preprocess('X1\n#include "speeds.h"\nX(FAST)', include))
    assert [(line.place, line.source, line.text) for line in found] == [
        (1, "", "X1"),
        (2, "speeds.h:3", "X(20)"),
        (2, "speeds.h:4", "X10 bad"),
        (3, "", "X(20)"),
    ]


@pytest.mark.parametrize(
    ("text", "place", "detail"),
    [
        ("X1\n#if 1\nX2", 2, "#if is not carried out"),
        ("#define F(x) x", 1, "with arguments"),
        ("X1\n#endif", 2, "without #ifdef"),
        ("#ifdef A\nX1", 1, "without #endif"),
        ("#ifdef A\n#else\n#else\n#endif", 3, "without #ifdef"),
        ('#include "gone.h"', 1, "no file"),
        ("#include", 1, "a file as in"),
        ("#define 5", 1, "a name as in"),
        ("#define A B\n#define B A\nA", 3, "defined by itself"),
    ],
)
def test_what_cannot_be_carried_out_is_said_with_its_line(text: str, place: int, detail: str) -> None:
    ((where, said),) = errors(text)
    assert where == place
    assert detail in said


def test_texts_that_grow_without_end_are_refused() -> None:
    assert errors('#include "again.h"')
    assert len(list(preprocess('#include "twice.h"', include))) <= MOST_LINES
    doubling = "\n".join(f"#define A{n} A{n + 1} A{n + 1}" for n in range(40)) + "\nA0"
    found = list(preprocess(doubling, include))
    assert all(len(line.text) <= MOST_CHARACTERS for line in found)
    assert found[-1].error is not None


def test_a_program_is_read_with_its_directives_carried_out() -> None:
    text = '#define SPEED 20\nP1=SPEED\nOPEN PROG 5 CLEAR\n#include "speeds.h"\nF(SPEED)\nCLOSE'
    refused: list[RefusedLine] = []
    read = read_program(text, refused, include=include)
    assert read.lines == ("P1=20", "OPEN PROG 5 CLEAR", "X(20)", "X10 bad", "F(20)", "CLOSE")
    assert read.places == {5: (Place(4, "speeds.h:3"), 5)}
    assert [(line.place, line.where, line.text) for line in refused] == [
        (Place(4, "speeds.h:4"), "4, speeds.h:4", "X10 bad")
    ]
    with pytest.raises(PmacError, match=r"line 4, speeds\.h:4"):
        read_program(text, include=include)


def test_a_number_is_the_line_of_the_text_itself_and_of_no_included_file() -> None:
    places = [3, Place(3), Place(3, "a.h:1"), Place(3, "a.h:2"), Place(4, "a.h:1")]
    same = [[one == other for other in places] for one in places]
    of_the_text = [True, True, False, False, False]
    assert same[0] == same[1] == of_the_text
    assert [row.count(True) for row in same[2:5]] == [1, 1, 1]
    assert all((one != other) is not (one == other) for one in places for other in places)
    assert len(set(places)) == 4 and Place(3) + 1 == 4


def test_a_text_of_refused_lines_names_the_first_of_them_with_its_file() -> None:
    with pytest.raises(PmacError, match=r"line 1, speeds\.h:3: .*; no OPEN PROG in the text"):
        read_program('#include "speeds.h"', [], include=include)


def test_without_a_folder_no_file_is_included() -> None:
    with pytest.raises(PmacError, match="line 1: #include: other files are not read here"):
        read_program('#include "speeds.h"\nOPEN PROG 1 CLEAR\nCLOSE')


def test_a_file_that_includes_itself_is_named_once() -> None:
    lines = list(preprocess('#include "a.h"\nX1', lambda name: f'P1=1\n#include "{name}"'))
    assert [line.text for line in lines if line.error is None] == ["P1=1", "X1"]
    (refused,) = [line for line in lines if line.error is not None]
    assert "a.h: it includes itself" in str(refused.error)


def test_a_text_of_which_nothing_is_left_says_what_took_it() -> None:
    with pytest.raises(PmacError, match="line 1: #ifdef without #endif"):
        read_program("#ifdef TURBO\nOPEN PROG 1 CLEAR\nX1\nCLOSE\n", [])
