"""Data gathering over the line: DEFINE, GATHER, ENDGATHER, LIST and DELETE, and what else notices of it."""

from __future__ import annotations

from itertools import pairwise

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.status import decode
from drivers.simulator.card import buffers
from drivers.simulator.commands.line import commands
from drivers.simulator.context import Context
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire

SET_UP = {
    "pmac": "I19=1 I20=1 I21=$800028",
    "turbo": "I5049=1 I5050=1 I5051=0 I5001=$800088",
}
"""The commanded position of motor 1, in each servo cycle (Software Reference, suggested M-variables)."""


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    dialect: Dialect = request.param
    made = wire(machine, dialect)
    made.tell(SET_UP[dialect.name])
    return made


def gathering(card: Wire) -> bool:
    return "gathering" in decode(card.ask("???")[0], card.card.dialect.global_bits)


def words(card: Wire, command: str = "LIST GATHER") -> list[str]:
    return [text for line in card.ask(command) for text in line.split()]


def pass_cycles(card: Wire, cycles: int) -> None:
    """Let at least so many servo cycles pass, in whole background cycles."""
    end = card.card.cycles + cycles
    while card.card.cycles < end:
        card.sim.wait(0.005)


def test_a_gather_fills_its_buffer_and_ends_by_itself(card: Wire) -> None:
    card.tell("#1J/", "#1J=100")
    card.settle()
    card.tell("DEFINE GATHER 20", "GATHER")
    assert gathering(card)
    pass_cycles(card, 20)
    assert not gathering(card)
    # 100 counts in 1/(96 x 32) count
    assert card.ask("LIST GATHER") == [" ".join(16 * ["00000004B000"]), " ".join(4 * ["00000004B000"])]


def test_the_bit_of_the_global_status_says_that_it_gathers(card: Wire) -> None:
    """Bit 19 of the first word, in both families (Software Reference, ???)."""
    before = int(card.ask("???")[0], 16)
    card.tell("DEFINE GATHER 1000", "GATHER")
    assert int(card.ask("???")[0], 16) == before | 1 << 19 + 24
    card.tell("ENDGATHER")
    assert int(card.ask("???")[0], 16) == before


def test_endgather_keeps_what_there_is(card: Wire) -> None:
    card.tell("DEF GAT 1000", "GAT")
    pass_cycles(card, 20)
    card.tell("ENDG")
    kept = words(card)
    assert 20 <= len(kept) < 1000
    pass_cycles(card, 20)
    assert words(card, "LIST GAT") == kept
    card.tell("ENDGATHER")


def test_each_gather_follows_servo_cycles_without_a_hole(card: Wire) -> None:
    """A jog of one count a cycle: consecutive samples are one count apart, over background cycles."""
    card.tell("#1J/", f"I119=1 I120=1 I121=0 I122={1.0 / card.card.cycle_ms}", "#1J+")
    pass_cycles(card, 50)
    card.tell("DEFINE GATHER 200", "GATHER")
    pass_cycles(card, 200)
    found = [int(text, 16) / (96 * 32) for text in words(card)]
    assert len(found) == 200
    steps = [after - before for before, after in pairwise(found)]
    assert steps == pytest.approx([1.0] * 199, abs=1e-3)


def test_a_part_of_the_buffer_is_listed(card: Wire) -> None:
    card.tell("#1J/", "#1J+", "DEFINE GATHER 60", "GATHER")
    pass_cycles(card, 60)
    every = words(card)
    assert len(every) == 60
    assert len(set(every)) > 1
    assert words(card, "LIST GATHER 50") == every[50:]
    assert words(card, "LIST GATHER 10,7") == every[10:17]
    assert words(card, "LIST GATHER ,7") == every[:7]
    assert words(card, "LIST GATHER 60,7") == []


def test_a_listing_costs_its_host_as_much_as_one_of_a_program(card: Wire) -> None:
    card.tell("DEFINE GATHER 320", "GATHER")
    pass_cycles(card, 320)
    card.tell("OPEN PROG 1 CLEAR", *(f"X{n}" for n in range(19)), "CLOSE")
    contexts = [Context(card.card), Context(card.card)]
    for context, line in zip(contexts, ("LIST PROG 1", "LIST GATHER"), strict=True):
        for _ in commands(line, context):
            pass
        assert len(context.lines) == 20
    assert contexts[0].work == contexts[1].work


@pytest.mark.parametrize("word", ["GATHER", "LIST GATHER"])
def test_003_without_a_buffer(card: Wire, word: str) -> None:
    assert card.refusal(word) == 3


def test_003_nothing_is_chosen(card: Wire) -> None:
    card.tell(f"I{card.card.dialect.gathering.masks[0]}=0", "DEFINE GATHER 10")
    assert card.refusal("GATHER") == 3


def test_003_no_input_of_this_card_starts_a_gather(card: Wire) -> None:
    card.tell("DEFINE GATHER 10")
    assert card.refusal("GATHER TRIGGER") == 3
    assert not gathering(card)


def test_while_it_gathers_it_is_neither_defined_nor_deleted(card: Wire) -> None:
    """Software Reference, DEFINE GATHER; Turbo Software Reference, DELETE GATHER: an error, until ENDGATHER."""
    card.tell("DEFINE GATHER 1000", "GATHER")
    for line in ("DEFINE GATHER 10", "DELETE GATHER", "DEL GAT", "DELETE ALL"):
        assert card.refusal(line) == 7, line
    card.tell("GATHER", "ENDGATHER", "DELETE GATHER", "DELETE GATHER")
    assert card.refusal("GATHER") == 3


def test_a_buffer_that_is_defined_again_lists_nothing(card: Wire) -> None:
    card.tell("DEFINE GATHER 10", "GATHER")
    pass_cycles(card, 10)
    assert len(words(card)) == 10
    card.tell("DEFINE GATHER 10")
    assert card.refusal("LIST GATHER") == 3


def test_size_is_what_is_left_and_no_more_can_be_defined(card: Wire) -> None:
    free = int(card.ask("SIZE")[0])
    card.tell("DEFINE GATHER 1000")
    assert int(card.ask("SIZE")[0]) == free - 1000
    assert card.refusal(f"DEFINE GATHER {free + 1}") == 6
    card.tell(f"DEFINE GATHER {free}")
    assert card.ask("SIZE") == ["0"]
    card.tell("DELETE GATHER")
    assert int(card.ask("SIZE")[0]) == free


def test_without_a_number_all_memory_is_taken_and_no_program_can_be_entered(card: Wire) -> None:
    """Software Reference, DEFINE GATHER: until the buffer is deleted."""
    card.tell("DEFINE GATHER", "OPEN PROG 1 CLEAR")
    assert card.refusal("X10") == 6
    card.tell("CLOSE", "DELETE GATHER", "OPEN PROG 1 CLEAR", "X10", "CLOSE")


def test_006_a_full_memory_has_no_room_for_it(card: Wire, monkeypatch: pytest.MonkeyPatch) -> None:
    card.tell("OPEN PROG 1 CLEAR", "X1", "X2", "CLOSE")
    monkeypatch.setattr(buffers, "ROOM_LINES", 2)
    assert card.refusal("DEFINE GATHER") == card.refusal("DEFINE GATHER 1") == 6
    card.tell("DELETE PROG 1", "DEFINE GATHER 2")


def test_007_not_while_a_program_is_entered(card: Wire) -> None:
    card.tell("OPEN PROG 1 CLEAR")
    assert card.refusal("DEFINE GATHER 10") == 7
    card.tell("CLOSE", "DEFINE GATHER 10")


def test_the_words_act_at_once_while_a_program_is_entered(card: Wire) -> None:
    card.tell("DEFINE GATHER 1000", "OPEN PROG 1 CLEAR", "GATHER", "X10", "ENDG", "CLOSE")
    assert card.listed("PROG 1") == ["X10"]
    assert words(card) == []


def test_a_program_starts_and_ends_it_by_command(card: Wire) -> None:
    """GATHER is no word of a program: CMD is how one gives it."""
    card.tell("#1J/ #2J/ #3J/", "DEFINE GATHER 10000")
    card.tell("OPEN PROG 1 CLEAR", 'CMD"GATHER"', "DWELL100", 'CMD"ENDGATHER"', "CLOSE", "&1B1R")
    card.settle()
    assert not gathering(card)
    cycles = 100 / card.card.cycle_ms
    assert len(words(card)) == pytest.approx(cycles, abs=25), "to a background cycle at each end"


def test_a_table_is_not_defined_while_there_is_a_buffer(card: Wire) -> None:
    """Software Reference, DEFINE COMP: an ERR003 that DELETE GATHER takes away."""
    card.tell("DEFINE GATHER 10")
    assert card.refusal("#1DEFINE COMP 4,#2,#1,4000") == 3
    card.tell("DELETE GATHER", "#1DEFINE COMP 4,#2,#1,4000")


def test_a_reset_ends_it(card: Wire) -> None:
    card.tell("DEFINE GATHER 1000", "GATHER")
    card.raw("$$$\rI3=2 I6=1\r")
    assert not gathering(card)


def test_an_address_of_nothing_is_gathered_as_the_word_that_is_there(card: Wire) -> None:
    first = {"pmac": 21, "turbo": 5001}[card.card.dialect.name]
    card.tell(f"I{first}=$1234", "WY:$1234,$ABCDEF", "DEFINE GATHER 2", "GATHER")
    pass_cycles(card, 2)
    assert words(card) == ["000000ABCDEF"] * 2
