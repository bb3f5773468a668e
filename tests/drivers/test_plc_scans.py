"""PLCs scan by scan, when they have their scans, and the timers that they wait by."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.plcs.plc import (
    PlcFault,
    PlcSwitches,
    background_order,
    foreground_runs,
    timer_variables,
)
from drivers.pmac.settings import settings_with
from drivers.pmac.variables import VariableStore
from profiles.machine import MachineProfile
from tests.drivers.plc_bench import BLOCK, PlcBench, plc_card, reset, run_for, store, values
from tests.drivers.wire_card import Wire


def test_a_plc_is_executed_from_the_top_to_the_end_again_and_again() -> None:
    """User Manual, PLC Program Structure: the simplest PLC counts its scans."""
    bench = PlcBench("P1=P1+1")
    for count in range(1, 6):
        assert bench.scan() is None
        assert bench.value("P1") == count


def test_a_level_triggered_branch_counts_and_an_edge_triggered_one_acts_once() -> None:
    bench = PlcBench("IF(M11=1)\nP1=P1+1\nELSE\nP2=P2+1\nENDIF")
    for level in (1, 1, 0, 1, 0):
        bench.set("M11", level)
        bench.scan()
    assert (bench.value("P1"), bench.value("P2")) == (3, 2)
    # User Manual, Edge-Triggered Conditions: P11 remembers the input.
    bench = PlcBench("IF(M11=1)\nIF(P11=0)\nP1=P1+1\nP11=1\nENDIF\nELSE\nP11=0\nENDIF")
    for level in (0, 1, 1, 1, 0, 0, 1, 1):
        bench.set("M11", level)
        bench.scan()
    assert bench.value("P1") == 2


def test_a_scan_ends_at_endwhile_and_goes_on_there_unless_it_is_begun_anew() -> None:
    bench = PlcBench("P1=P1+1\nWHILE(P2<3)\nP2=P2+1\nENDWHILE\nP3=P3+1")
    seen = []
    for _ in range(5):
        bench.scan()
        seen.append((bench.value("P1"), bench.value("P2"), bench.value("P3")))
    # Three passes are a scan each; the fourth scan finds the condition false and goes on to the end.
    assert seen == [(1, 1, 0), (1, 2, 0), (1, 3, 0), (1, 3, 1), (2, 3, 2)]
    bench = PlcBench("P1=P1+1\nWHILE(1=1)\nENDWHILE")
    bench.scan()
    bench.scan()
    assert (bench.value("P1"), bench.run.line) == (1, 1)
    bench.run.restart()
    bench.scan()
    assert bench.value("P1") == 2


def test_a_plc_that_is_empty_or_switches_itself_off_ends_its_scan() -> None:
    bench = PlcBench("")
    assert bench.scan() is None
    assert bench.run.line == 0
    bench = PlcBench("DISABLE PLC 1\nP1=1")
    bench.scan()
    assert bench.value("P1") == 1


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


def test_addresses_hold_from_scan_to_scan_for_commands_and_q_variables() -> None:
    """Software Reference, COMMAND: each PLC has an address of its own, at power-up motor 1 and system 1."""
    bench = PlcBench('CMD"J/"\nADDRESS#3\nCMD"J/"\nADDRESS&2\nCMD"R"', TURBO)
    bench.scan()
    bench.scan()
    bench.run.restart()
    bench.scan()
    places = [words[3:] for words in bench.said()]
    assert places == [(1, 1), (3, 1), (3, 2), *[(3, 2)] * 6]
    bench = PlcBench("Q1=10\nADDRESS&2\nQ1=20\nIF(Q1=20)\nQ2=Q1+1\nENDIF")
    bench.scan()
    assert (bench.value("Q1", 1), bench.value("Q1", 2), bench.value("Q2", 2)) == (10, 20, 21)
    bench.scan()  # the address is still &2 at the top
    assert (bench.value("Q1", 1), bench.value("Q1", 2)) == (10, 20)


def test_arithmetic_goes_on_as_on_the_card_and_angles_follow_i15_from_the_next_scan_on() -> None:
    """User Manual: a division by zero is 2^47; LN of a negative number 0."""
    bench = PlcBench("P1=1/0\nP2=-1/0\nP3=LN(-1)\nP4=1")
    assert bench.scan() is None
    assert [bench.value(f"P{n}") for n in (1, 2, 3, 4)] == [2**47, -(2**47), 0, 1]
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


# Which PLCs run: I5, the switches of each, and where one begins that is switched on again.

ALL = frozenset(range(32))
numbers = st.frozensets(st.integers(0, 31))


@pytest.mark.parametrize(
    ("i5", "foreground", "background"), [(0, False, 0), (1, True, 0), (2, False, 31), (3, True, 31)]
)
def test_i5_permits_the_foreground_and_the_background(i5: float, foreground: bool, background: int) -> None:
    """Software Reference, I5: the table of its four values."""
    assert foreground_runs(i5, ALL, ALL) is foreground
    assert len(background_order(i5, ALL, ALL)) == background


@given(numbers, numbers)
def test_what_is_stored_and_on_runs_in_order(enabled: frozenset[int], stored: frozenset[int]) -> None:
    order = background_order(2, enabled, stored)
    assert list(order) == [number for number in range(1, 32) if number in enabled and number in stored]
    assert foreground_runs(1, enabled, stored) is (0 in enabled and 0 in stored)


def test_at_power_up_every_plc_that_there_is_is_on_and_at_its_top() -> None:
    switches = PlcSwitches().enable([3, 1, 0])
    assert switches.enabled == switches.at_top == {0, 1, 3}


@given(st.lists(st.tuples(st.sampled_from(["enable", "disable", "scan"]), st.integers(0, 31)), max_size=30))
def test_only_what_is_on_can_be_at_its_top(steps: list[tuple[str, int]]) -> None:
    switches = PlcSwitches()
    fresh: dict[int, bool] = {}
    for what, number in steps:
        if what == "enable":
            switches = switches.enable([number])
            fresh.setdefault(number, True)
        elif what == "disable":
            switches = switches.disable([number])
            fresh.pop(number, None)
        elif number in fresh:
            switches = switches.begin_scan(number)
            fresh[number] = False
        assert switches.enabled == set(fresh)
        assert switches.at_top == {n for n, top in fresh.items() if top}


# What PLCs wait by: the timers of both families, and the settings that permit and guard them.


def test_each_family_has_its_timers_and_its_watchdog() -> None:
    """User Manual, Precise Timing."""
    assert timer_variables(PMAC, 15) == ()
    assert PMAC.timer_words == (("X", 0x700), ("Y", 0x700), ("X", 0x701), ("Y", 0x701))
    assert TURBO.timer_words == ()
    # Turbo: 4096 servo cycles, or one more than I40; non-Turbo: 512 real-time interrupts.
    assert (TURBO.watchdog.count + 1, TURBO.watchdog.number, TURBO.watchdog.of_interrupts) == (4096, 40, False)
    assert (PMAC.watchdog.count + 1, PMAC.watchdog.number, PMAC.watchdog.of_interrupts) == (512, None, True)
    store = VariableStore(settings_with({}, TURBO), TURBO)
    assert store.i(40) == 0
    store.set(VariableKind.I, 40, 65_536 + 226)
    assert store.i(40) == 226


# The timers of the simulated card, in the only unit that they have: servo cycles.

WORDS = ("X:$700", "Y:$700", "X:$701", "Y:$701")
"""Non-Turbo, User Manual, Precise Timing."""

LOWEST = -8_388_608


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    """A card whose timers are read and written as M70 to M73, or I5111, I5112, I5211 and I5212."""
    dialect: Dialect = request.param
    made = plc_card(machine, dialect)
    if dialect is PMAC:
        made.tell(*(f"M7{n}->{word},0,24,S" for n, word in enumerate(WORDS)))
    return made


def names(card: Wire) -> tuple[str, ...]:
    return ("M70", "M71", "M72", "M73") if card.card.dialect is PMAC else ("I5111", "I5112", "I5211", "I5212")


def test_timers_count_servo_cycles_down_through_zero(card: Wire) -> None:
    starts = (100, 5, -7, 8_388_607)
    card.tell(*(f"{name}={start}" for name, start in zip(names(card), starts, strict=True)))
    before = card.card.cycles
    for blocks in (0, 1, 10, 100):
        run_for(card, blocks)
        elapsed = card.card.cycles - before
        assert values(card, " ".join(names(card))) == [start - elapsed for start in starts]
    assert elapsed == 111 * BLOCK


def test_a_timer_stays_at_its_lowest_value(card: Wire) -> None:
    name = names(card)[0]
    card.tell(f"{name}={LOWEST + BLOCK + 3}")
    run_for(card)
    assert values(card, name) == [LOWEST + 3]
    run_for(card, 5)
    assert values(card, name) == [LOWEST]
    card.tell(f"{name}=4")
    run_for(card)
    assert values(card, name) == [4 - BLOCK], "and goes on from what is written"


def test_plc_0_reads_a_timer_in_the_servo_cycle_in_which_it_has_its_scan(card: Wire) -> None:
    name = names(card)[1]
    card.tell("I5=1 I8=3", f"{name}=1000")
    store(card, 0, f"P(P1+10)={name}\nP1=P1+1")
    run_for(card, 4)
    count = int(values(card, "P1")[0])
    assert count == 4 * BLOCK // 4
    seen = values(card, f"P10..{9 + count}")
    assert seen == [seen[0] - 4 * scan for scan in range(count)]
    assert 1000 - 4 <= seen[0] < 1000


def test_a_program_waits_by_a_timer(card: Wire) -> None:
    """The timer is looked at once a real-time interrupt (two backward jumps); the wait ends with its zero."""
    name = names(card)[0]
    text = (f"{name}=300", f"WHILE({name}>0)", "P1=P1+1", "ENDWHILE", f"P2={name}")
    card.tell("I8=2 #1J/ #2J/ #3J/", "OPEN PROG 1 CLEAR", *text, "CLOSE", "&1B1R")
    card.tell("P2=999")
    run_for(card, 300 // BLOCK)
    assert values(card, "P2") == [999], "it still waits"
    run_for(card, 2)
    assert -2 * BLOCK < values(card, "P2")[0] <= 0


def test_only_the_timers_of_activated_systems_run(machine: MachineProfile) -> None:
    """Turbo Software Reference, I68: systems 1 to I68 + 1."""
    card = plc_card(machine, TURBO)
    timers = "I5111 I5112 I5211 I5212 I5311 I6612"
    card.tell("I68=1", "I5111..5112=500 I5211..5212=500 I5311=500 I6612=500")
    run_for(card, 10)
    assert values(card, timers) == [390, 390, 390, 390, 500, 500]
    card.tell("I68=15")
    run_for(card, 10)
    assert values(card, timers) == [280, 280, 280, 280, 390, 390]
    card.tell("I68=0")
    run_for(card, 10)
    assert values(card, timers) == [170, 170, 280, 280, 390, 390]


def test_a_timer_of_24_bits_rolls_over_when_it_is_written(card: Wire) -> None:
    name = names(card)[0]
    for written, kept in ((8_388_608, LOWEST), (-5, -5), (2.6, 3)):
        card.tell(f"{name}={written}")
        assert values(card, name) == [kept]


def test_a_part_of_a_timer_word_is_a_part_of_what_it_says(machine: MachineProfile) -> None:
    card = plc_card(machine, PMAC)
    card.tell("M1->X:$700,8,8", "M2->X:$700,24", "M2=65536")
    assert values(card, "M1") == [0]
    run_for(card)
    assert values(card, "M2 M1") == [65536 - BLOCK, 255]
    assert card.ask("RHX$700") == [f"{65536 - BLOCK:06X}"]


def test_a_reset_begins_the_timers_of_a_turbo_at_0_and_save_does_not_keep_them(machine: MachineProfile) -> None:
    card = plc_card(machine, TURBO)
    card.tell("I5111=100000", "SAVE", "I5111=200000")
    reset(card)
    assert values(card, "I5111") == [0]
    run_for(card)
    assert values(card, "I5111") == [-BLOCK]
