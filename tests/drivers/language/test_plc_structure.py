"""The blocks of a PLC, and conditions that go on over several lines."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.plc_statements import MOST_CONDITION_LINES
from tests.drivers.plc_bench import PlcBench, code_of

LINES = st.lists(st.tuples(st.sampled_from(["AND", "OR"]), st.booleans()), min_size=1, max_size=6)


def verdict(text: str, **variables: float) -> bool:
    bench = PlcBench(text, PMAC, **variables)
    assert bench.scan() is None
    return bench.value("P99") == 1


def test_the_example_of_the_manual() -> None:
    """Turbo User Manual, Multiple-Line Conditions: each line is a unit of its own."""
    text = "IF(P11=1 OR P12=1)\nAND(P13=1 OR P14=1)\nP99=1\nENDIF"
    for p11, p12, p13, p14 in itertools.product((0, 1), repeat=4):
        expected = bool((p11 or p12) and (p13 or p14))
        assert verdict(text, P11=p11, P12=p12, P13=p13, P14=p14) is expected


def test_between_lines_and_binds_tighter_than_or() -> None:
    text = "IF(P1=1)\nOR(P2=1)\nAND(P3=1)\nP99=1\nENDIF"
    for p1, p2, p3 in itertools.product((0, 1), repeat=3):
        assert verdict(text, P1=p1, P2=p2, P3=p3) is bool(p1 or (p2 and p3))


@given(st.booleans(), LINES)
def test_any_chain_of_lines_is_what_python_makes_of_it(first: bool, further: list[tuple[str, bool]]) -> None:
    """The words and their precedence are Python's, too."""
    lines = [f"IF({int(first)}=1)", *(f"{word}({int(truth)}=1)" for word, truth in further), "P99=1", "ENDIF"]
    python = " ".join([str(first), *(f"{word.lower()} {truth}" for word, truth in further)])
    assert verdict("\n".join(lines)) is eval(python)


def test_a_while_may_go_on_over_lines_with_blank_ones_and_comments_between() -> None:
    bench = PlcBench("WHILE(P1<3)\n; and the lease\nAND(P2=0)\n\nP1=P1+1\nENDWHILE\nP99=1")
    assert [bench.scan() or bench.value("P99") for _ in range(4)] == [0, 0, 0, 1]


def test_a_false_line_spares_the_and_lines_behind_it() -> None:
    """P9999 does not exist on a non-Turbo card: to look at it would be a run-time error."""
    bench = PlcBench("IF(P1=1)\nAND(P9999=0)\nP2=1\nENDIF")
    assert bench.scan() is None
    bench.set("P1", 1)
    assert bench.scan() is not None


@pytest.mark.parametrize(
    ("text", "code", "line"),
    [
        ("ENDIF", 9, 1),
        ("P1=1\nENDWHILE", 9, 2),
        ("ELSE", 9, 1),
        ("WHILE(P1=1)\nELSE\nENDWHILE", 9, 2),
        ("IF(P1=1)\nELSE\nELSE\nENDIF", 9, 3),
        ("IF(P1=1)\nENDWHILE", 9, 2),
        ("AND(P1=1)", 9, 1),
        ("IF(P1=1)\nP2=1\nAND(P1=1)\nENDIF", 9, 3),
        ("IF(P1=1)\nELSE\nOR(P1=1)\nENDIF", 9, 3),
        ("IF(P1=1)\n" + "AND(P1=1)\n" * MOST_CONDITION_LINES, 9, MOST_CONDITION_LINES + 1),
        ("P1=1\nIF(P1=1)\nP2=1", 16, 2),
        ("WHILE(P1=1)\nIF(P1=1)\nENDIF", 16, 1),
        ("IF(P1=1) P2=1", 16, 1),
    ],
)
def test_a_block_that_does_not_fit_is_refused_with_its_line(text: str, code: int, line: int) -> None:
    with pytest.raises(PmacError) as refusal:
        code_of(text)
    assert refusal.value.code == code
    assert refusal.value.detail.startswith(f"line {line}:")


def test_the_longest_condition_can_be_run() -> None:
    long = " AND ".join(["1=1"] * 50)
    text = f"IF({long})\n" + f"AND({long})\n" * (MOST_CONDITION_LINES - 1) + "P99=1\nENDIF"
    assert verdict(text)
