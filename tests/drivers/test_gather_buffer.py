"""The buffer of data gathering by itself: what is taken, when, and how much of it there is room for."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.gathering.gather import gather_settings, long_words_of
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.memory import Pointer
from drivers.pmac.variables import VariableStore
from drivers.simulator.card.gather_buffer import GatherBuffer
from tests.drivers.packed_samples import pack

FAMILIES = pytest.mark.parametrize("dialect", [PMAC, TURBO], ids=["pmac", "turbo"])
BITS = {"Y": 24, "X": 24, "D": 48}


@dataclass(kw_only=True)
class Words:
    """A memory that tells what it was given for a place."""

    values: dict[tuple[str, int], float] = field(default_factory=dict)

    def bits_of(self, _: Pointer) -> None:
        return None

    def passing(self, _: Pointer) -> None:
        return None

    def read(self, pointer: Pointer) -> float:
        return self.values.get((pointer.space, pointer.address), 0.0)

    def write(self, pointer: Pointer, value: float) -> None:
        self.values[pointer.space, pointer.address] = value


def word(space: str, address: int = 0x10) -> Pointer:
    return Pointer(space=space, address=address, signed=space in "XY")


def card(
    sources: list[Pointer], dialect: Dialect = PMAC, period: int = 1, size: int = 1000
) -> tuple[GatherBuffer, Words, VariableStore]:
    """A buffer that is defined and set up, with its memory and variables."""
    variables = VariableStore(dict(gather_settings(sources, period, dialect)), dialect)
    memory = Words()
    variables.memory = memory
    gather = GatherBuffer(variables)
    gather.define(size)
    return gather, memory, variables


def run(gather: GatherBuffer, cycles: int) -> None:
    """Servo cycles, as the card has them."""
    for _ in range(cycles):
        if gather.running:
            gather.sample()


def a_value(space: str) -> st.SearchStrategy[float]:
    if space == "L":
        return st.floats(-1e9, 1e9)
    limit = 1 << (BITS[space] - 1)
    return st.integers(-limit, limit - 1).map(float)


@st.composite
def gatherings(draw: st.DrawFn) -> tuple[Dialect, list[Pointer], list[list[float]]]:
    dialect = draw(st.sampled_from([PMAC, TURBO]))
    spaces = draw(st.lists(st.sampled_from("YXDL"), min_size=1, max_size=dialect.gathering.source_count))
    sources = [word(space, 0x100 + place) for place, space in enumerate(spaces)]
    row = st.tuples(*(a_value(space) for space in spaces)).map(list)
    return dialect, sources, draw(st.lists(row, min_size=1, max_size=4))


@given(gatherings())
def test_what_is_kept_is_what_the_rules_of_packing_say(
    drawn: tuple[Dialect, list[Pointer], list[list[float]]],
) -> None:
    dialect, sources, rows = drawn
    gather, memory, _ = card(sources, dialect)
    gather.start()
    for row in rows:
        for source, value in zip(sources, row, strict=True):
            memory.write(source, value)
        gather.sample()
    assert gather.long_words() == [each for row in rows for each in pack(sources, row)]


@pytest.mark.parametrize("period", [1, 3, 7])
def test_the_first_cycle_is_gathered_and_then_every_period(period: int) -> None:
    gather, memory, _ = card([word("D")], period=period)
    gather.start()
    for cycle in range(20):
        memory.write(word("D"), cycle)
        gather.sample()
    assert gather.long_words() == list(range(0, 20, period))


def test_a_period_of_0_is_one_sample_for_each_command() -> None:
    gather, memory, _ = card([word("D")], period=0)
    for value in (5, 6):
        memory.write(word("D"), value)
        gather.start()
        run(gather, 10)
        assert not gather.running
    assert gather.long_words() == [5, 6]


@pytest.mark.parametrize(("size", "samples"), [(10, 5), (11, 5), (2, 1), (3, 1)])
def test_it_ends_by_itself_when_another_sample_has_no_room(size: int, samples: int) -> None:
    sources = [word("D"), word("X")]
    gather, _, _ = card(sources, size=size)
    gather.start()
    run(gather, samples - 1)
    before_the_last = gather.running
    run(gather, 100)
    assert (before_the_last, gather.running) == (True, False)
    assert len(gather.long_words()) == samples * long_words_of(sources)


def test_a_full_buffer_takes_no_more_until_it_is_defined_again() -> None:
    gather, _, _ = card([word("D")], size=4)
    gather.start()
    run(gather, 4)
    assert refusal(gather.start) == 6
    gather.define(4)
    gather.start()
    assert gather.running


def test_data_go_on_behind_those_that_are_there_and_define_begins_anew() -> None:
    """The manuals name DEFINE GATHER alone for putting the place of storage back to the beginning."""
    gather, memory, _ = card([word("D")])
    for value in (1, 2):
        memory.write(word("D"), value)
        gather.start()
        run(gather, 2)
        gather.running = False
    assert gather.long_words() == [1, 1, 2, 2]
    gather.define(100)
    gather.start()
    run(gather, 1)
    assert gather.long_words() == [2]


@FAMILIES
def test_what_is_gathered_is_read_once_when_it_starts(dialect: Dialect) -> None:
    gather, memory, variables = card([word("D", 0x20)], dialect)
    memory.write(word("D", 0x20), 1)
    memory.write(word("D", 0x21), 2)
    gather.start()
    for index, value in gather_settings([word("D", 0x21)], 5, dialect).items():
        variables.set(VariableKind.I, index, value)
    run(gather, 2)
    gather.start()  # it runs: this changes nothing
    run(gather, 1)
    assert gather.long_words() == [1, 1, 1]
    gather.running = False
    gather.start()
    run(gather, 5)
    assert gather.long_words() == [1, 1, 1, 2]


def refusal(act: object, *arguments: object) -> int:
    assert callable(act)
    with pytest.raises(PmacError) as refused:
        act(*arguments)
    return refused.value.code


def test_what_cannot_be_gathered_is_refused() -> None:
    gather, _, variables = card([word("D")])
    gather.delete()
    assert refusal(gather.start) == 3, "no buffer"
    assert refusal(gather.define, 0) == 3
    gather.define(1)
    variables.set(VariableKind.I, PMAC.gathering.masks[0], 0)
    assert refusal(gather.start) == 3, "no sources"
    variables.set(VariableKind.I, PMAC.gathering.masks[0], 3)
    variables.set(VariableKind.I, PMAC.gathering.first_source + 1, 0x800030)
    assert refusal(gather.start) == 6, "one long word, two in a sample"
    variables.memory = None
    assert refusal(gather.start) == 3, "no memory"
    assert not gather.running


def test_while_it_runs_it_is_neither_defined_nor_deleted() -> None:
    gather, _, _ = card([word("D")])
    gather.start()
    run(gather, 3)
    assert refusal(gather.define, 10) == refusal(gather.delete) == 7
    assert len(gather.long_words()) == 3
    gather.running = False
    gather.delete()
    assert not gather.size


def test_nothing_is_listed_before_something_was_gathered() -> None:
    gather, _, _ = card([word("D")])
    assert refusal(gather.long_words) == 3
    gather.start()
    assert gather.long_words() == []
    run(gather, 2)
    assert len(gather.long_words()) == 2
    gather.running = False
    gather.define(50)
    assert refusal(gather.long_words) == 3


def test_a_part_is_listed_by_its_first_long_word_and_their_number() -> None:
    gather, memory, _ = card([word("D")])
    gather.start()
    for value in range(10):
        memory.write(word("D"), value)
        gather.sample()
    assert gather.long_words(7) == [7, 8, 9]
    assert gather.long_words(2, 3) == [2, 3, 4]
    assert gather.long_words(8, 100) == [8, 9]
    assert gather.long_words(10) == gather.long_words(11, 5) == gather.long_words(3, 0) == []


@pytest.mark.parametrize(("period", "size", "before"), [(1, 10, 0), (1, 10, 4), (3, 10, 0), (3, 10, 4), (7, 4, 1)])
def test_the_cycles_left_are_those_until_it_is_full(period: int, size: int, before: int) -> None:
    gather, _, _ = card([word("D"), word("D", 0x11)], period=period, size=size)
    gather.start()
    run(gather, before)
    left = gather.cycles_left
    run(gather, left - 1)
    assert gather.running
    run(gather, 1)
    assert not gather.running
