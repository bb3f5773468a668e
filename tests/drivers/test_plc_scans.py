"""A PLC, scan by scan: where a scan ends and the next one goes on, what it addresses, and what stops it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC, TURBO
from drivers.pmac.plcs.plc import PlcFault
from tests.drivers.plc_bench import PlcBench


def test_a_plc_is_executed_from_the_top_to_the_end_again_and_again() -> None:
    """User Manual, PLC Program Structure: the simplest PLC counts its scans."""
    bench = PlcBench("P1=P1+1")
    for count in range(1, 6):
        assert bench.scan() is None
        assert bench.value("P1") == count


def test_a_level_triggered_branch_counts_while_its_input_is_true() -> None:
    bench = PlcBench("IF(M11=1)\nP1=P1+1\nELSE\nP2=P2+1\nENDIF")
    for level in (1, 1, 0, 1, 0):
        bench.set("M11", level)
        bench.scan()
    assert (bench.value("P1"), bench.value("P2")) == (3, 2)


def test_an_edge_triggered_branch_acts_once_for_each_edge() -> None:
    """User Manual, Edge-Triggered Conditions: P11 remembers the input."""
    bench = PlcBench("IF(M11=1)\nIF(P11=0)\nP1=P1+1\nP11=1\nENDIF\nELSE\nP11=0\nENDIF")
    for level in (0, 1, 1, 1, 0, 0, 1, 1):
        bench.set("M11", level)
        bench.scan()
    assert bench.value("P1") == 2


def test_a_scan_ends_at_endwhile_and_the_next_one_goes_on_at_the_while() -> None:
    bench = PlcBench("P1=P1+1\nWHILE(P2<3)\nP2=P2+1\nENDWHILE\nP3=P3+1")
    seen = []
    for _ in range(5):
        bench.scan()
        seen.append((bench.value("P1"), bench.value("P2"), bench.value("P3")))
    # Three passes are a scan each; the fourth scan finds the condition false and goes on to the end.
    assert seen == [(1, 1, 0), (1, 2, 0), (1, 3, 0), (1, 3, 1), (2, 3, 2)]


def test_an_endless_loop_takes_one_pass_a_scan() -> None:
    bench = PlcBench("WHILE(1=1)\nP1=P1+1\nENDWHILE\nP2=1")
    for _ in range(1000):
        bench.scan()
    assert (bench.value("P1"), bench.value("P2")) == (1000, 0)


def test_begun_anew_it_leaves_its_while() -> None:
    bench = PlcBench("P1=P1+1\nWHILE(1=1)\nENDWHILE")
    bench.scan()
    bench.scan()
    assert (bench.value("P1"), bench.run.line) == (1, 1)
    bench.run.restart()
    bench.scan()
    assert bench.value("P1") == 2


def test_a_plc_without_a_statement_does_nothing() -> None:
    bench = PlcBench("")
    assert bench.scan() is None
    assert bench.run.line == 0


Body = list["Node"]
OUTPUTS = 10_000


@dataclass
class Node:
    """A statement of the reference: SEND and P1=P1+1, or a block with its condition P1%3=k."""

    word: str
    residue: int = 0
    body: Body = field(default_factory=list)
    alternative: Body = field(default_factory=list)


def blocks(inner: st.SearchStrategy[Body]) -> st.SearchStrategy[Body]:
    residues = st.integers(0, 2)
    node = st.one_of(
        st.builds(Node, st.just("say")),
        st.builds(Node, st.just("while"), residues, inner),
        st.builds(Node, st.just("if"), residues, inner, inner),
    )
    return st.lists(node, max_size=4)


bodies: st.SearchStrategy[Body] = st.recursive(st.builds(lambda: [Node("say")]), blocks, max_leaves=12)


def text_of(body: Body, numbers: Iterator[int], names: dict[int, int]) -> Iterator[str]:
    for node in body:
        if node.word == "say":
            names[id(node)] = next(numbers)
            yield f'SEND"{names[id(node)]}"'
            yield "P1=P1+1"
        else:
            yield f"{node.word.upper()}(P1%3={node.residue})"
            yield from text_of(node.body, numbers, names)
            if node.alternative:
                yield "ELSE"
                yield from text_of(node.alternative, numbers, names)
            yield f"END{node.word.upper()}"


def scans_of(body: Body, names: dict[int, int]) -> Iterator[list[int]]:
    """The reference: an interpreter of the tree, which yields what a scan has said at each end of a scan."""
    count = 0
    said: list[int] = []

    def walk(nodes: Body) -> Iterator[list[int]]:
        nonlocal count, said
        for node in nodes:
            if node.word == "say":
                said.append(names[id(node)])
                count += 1
            elif node.word == "if":
                yield from walk(node.body if count % 3 == node.residue else node.alternative)
            else:
                while count % 3 == node.residue:
                    yield from walk(node.body)
                    yield said
                    said = []

    while True:
        yield from walk(body)
        yield said
        said = []


@given(bodies)
def test_any_nesting_says_scan_by_scan_what_a_reading_of_the_tree_says(body: Body) -> None:
    names: dict[int, int] = {}
    text = "\n".join(text_of(body, iter(range(OUTPUTS)), names))
    bench = PlcBench(text)
    for _, expected in zip(range(12), scans_of(body, names), strict=False):
        assert bench.scan() is None
        said = [int(str(words[1])) for words in bench.said()]
        assert said == expected
        assert len(set(said)) == len(said)  # nothing twice: every scan has an end


def test_commands_and_messages_come_in_the_order_of_the_program() -> None:
    bench = PlcBench('CMD"#1J/"\nSEND"a"\nCMD^K\nCMDS"V"\nDISPLAY3"ready"\nENABLE PLC 2,3\nDISABLE PLC 1')
    bench.scan()
    assert bench.said() == [
        ("command", "#1J/", "", 1, 1),
        ("send", "a", ""),
        ("command", "\x0b", "", 1, 1),
        ("command", "V", "S", 1, 1),
        ("display", "ready"),
        ("enable", 2, 3),
        ("disable", 1),
    ]


def test_a_plc_that_switches_itself_off_ends_its_scan() -> None:
    bench = PlcBench("DISABLE PLC 1\nP1=1")
    bench.scan()
    assert bench.value("P1") == 1


def test_address_holds_for_the_commands_behind_it_and_from_scan_to_scan() -> None:
    """Software Reference, COMMAND: each PLC has an address of its own, at power-up motor 1 and system 1."""
    bench = PlcBench('CMD"J/"\nADDRESS#3\nCMD"J/"\nADDRESS&2\nCMD"R"', TURBO)
    bench.scan()
    bench.scan()
    bench.run.restart()
    bench.scan()
    places = [words[3:] for words in bench.said()]
    assert places == [(1, 1), (3, 1), (3, 2), *[(3, 2)] * 6]


def test_q_variables_are_those_of_the_addressed_system() -> None:
    bench = PlcBench("Q1=10\nADDRESS&2\nQ1=20\nIF(Q1=20)\nQ2=Q1+1\nENDIF")
    bench.scan()
    assert (bench.value("Q1", 1), bench.value("Q1", 2), bench.value("Q2", 2)) == (10, 20, 21)
    bench.scan()  # the address is still &2 at the top
    assert (bench.value("Q1", 1), bench.value("Q1", 2)) == (10, 20)


def test_arithmetic_without_a_result_goes_on_as_on_the_card() -> None:
    """User Manual: a division by zero is 2^47; LN of a negative number 0."""
    bench = PlcBench("P1=1/0\nP2=-1/0\nP3=LN(-1)\nP4=1")
    assert bench.scan() is None
    assert [bench.value(f"P{n}") for n in (1, 2, 3, 4)] == [2**47, -(2**47), 0, 1]


def test_angles_follow_i15_from_the_next_scan_on() -> None:
    bench = PlcBench("P1=SIN(90)\nI15=1")
    bench.scan()
    assert bench.value("P1") == pytest.approx(1.0)
    bench.scan()
    assert bench.value("P1") == pytest.approx(0.8939966636)  # sin of 90 rad


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("P1=1\nP(2000)=5\nP2=1", 1, "P2000"),
        ("P1=1\nP3=I(P1*5000)\nP2=1", 1, "I5000"),
        ("P1=1\nIF(M(0-1)=0)\nENDIF\nP2=1", 1, "M-1"),
        ("P1=1\nADDRESS#9\nP2=1", 1, "motor 9"),
        ("P1=1\n\nADDRESS&9\nP2=1", 1, "coordinate system 9"),
        ("P1=1\nP3=EXP(1000)\nP2=1", 1, "too large"),
    ],
)
def test_a_run_time_error_ends_the_scan_and_says_where_and_what(text: str, line: int, words: str) -> None:
    bench = PlcBench(text, PMAC)
    fault = bench.scan()
    assert isinstance(fault, PlcFault)
    assert (fault.line, fault.code) == (line, 3)
    assert words in fault.detail
    assert (bench.value("P1"), bench.value("P2")) == (1, 0)
    assert bench.run.line == 0


def test_after_a_run_time_error_inside_a_while_it_begins_at_its_top() -> None:
    bench = PlcBench("P1=P1+1\nWHILE(P2=0)\nP3=P(P4)\nENDWHILE")
    assert bench.scan() is None
    bench.set("P4", 5000)
    assert bench.scan() is not None
    bench.set("P4", 0)
    assert bench.scan() is None
    assert bench.value("P1") == 2
