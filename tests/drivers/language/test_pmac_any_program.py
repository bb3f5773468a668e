"""Whatever stands in a program: it is refused or it runs, an error is one of the card's, and the time goes on."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC, TURBO
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.structure import link
from drivers.pmac.language.syntax import Line
from drivers.pmac.language.text import format_line
from drivers.pmac.requests import Finished
from tests.drivers.language.runs import Bench
from tests.drivers.language.trees import lines

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
            if isinstance(run.advance(), Finished):
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
