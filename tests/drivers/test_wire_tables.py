"""Compensation tables and data gathering over the line."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import pytest

from drivers.pmac.compensation.table_text import table_lines
from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.status import decode
from drivers.simulator.card import buffers
from drivers.simulator.commands.line import commands
from drivers.simulator.context import Context
from drivers.simulator.hosts.port import Port
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from tests.drivers.plc_bench import reset
from tests.drivers.wire_card import Wire, wire

EIGHT = ("#1", "DEFINE COMP 8,4000", "160 80 120 96", "20 -56 -12 0")
"""The table of the User Manual: of motor 1, by its own position."""
GRID = ("#2DEF COMP 2.3,#3D,#1,300,200", "16 32 48 160 176 192 208 320 336 352 368")
COMPENSATION_ON = 1 << 14
"""Word 1 of ??? (Software Reference)."""


def corrections(card: Wire, motor: int, *positions: tuple[float, ...]) -> list[float]:
    table = card.card.tables.tables[motor]
    return [table.correction(*place) for place in positions]


def say(card: Wire, port: Port, line: str) -> bytes:
    """Another host says something."""
    port.receive(line.encode() + b"\r")
    card.sim.attend(port)
    return port.take_output()


def test_the_table_of_the_manual_is_by_the_position_of_its_own_motor(card: Wire) -> None:
    """First entry at 500 counts, 160/16 count; 750 is half way to 80/16; -500 is 3500."""
    card.tell(*EIGHT)
    assert corrections(card, 1, (500,), (750,), (0,), (-500,)) == [10.0, 7.5, 0.0, -0.75]
    assert card.ask("#1LIST COMP DEF") == ["8,#1,#1,4000"]
    assert card.ask("#1LIST COMP") == ["160 80 120 96 20 -56 -12 0"]


def test_a_table_with_rows_and_columns(card: Wire) -> None:
    card.tell(*GRID)
    assert corrections(card, 2, (0, 0), (100, 0), (0, 100), (100, 100)) == [0.0, 1.0, 10.0, 11.0]
    assert card.ask("LIST COMP DEF LIST COMP") == ["2.3,#3D,#1,#2,300,200", GRID[1]]


def test_what_is_listed_can_be_sent_again(card: Wire) -> None:
    card.tell(*EIGHT)
    first = card.card.tables.tables[1]
    definition, *lines = card.ask("#1LIST COMP DEF LIST COMP")
    card.tell("DELETE COMP", f"DEFINE COMP {definition}", *lines)
    assert card.card.tables.tables[1] == first


def test_a_long_table_is_listed_in_lines_that_a_card_takes(card: Wire) -> None:
    sent = [(-1) ** k * (8_388_607 - k) for k in range(360)]
    card.tell("#3DEFINE COMP 360,#2,#1,10000", *(" ".join(map(str, sent[k : k + 20])) for k in range(0, 360, 20)))
    listed = card.ask("LIST COMP")
    assert [int(entry) for line in listed for entry in line.split()] == sent
    assert max(map(len, listed)) < 255


def test_tables_are_defined_from_high_to_low_and_deleted_from_low_to_high(card: Wire) -> None:
    card.tell("#4DEFINE COMP 1,100", "0", "#2DEFINE COMP 1,100", "0")
    assert card.refusal("#3DEFINE COMP 1,100") == 3
    assert card.refusal("#2DEFINE COMP 1,100") == 3  # it has one
    assert card.refusal("#4DELETE COMP") == 3
    assert set(card.card.tables.tables) == {2, 4}
    card.tell("#1DELETE COMP", "#2DEL COMP", "#4DELETE COMP", "#4DELETE COMP")
    assert card.card.tables.tables == {}


def test_a_table_that_is_not_full_is_in_the_way_too(card: Wire) -> None:
    card.tell("#2DEFINE COMP 2,100", "0")
    assert card.refusal("#3DEFINE COMP 1,100") == 3
    card.tell("#2DELETE COMP", "#3DEFINE COMP 1,100", "0")
    assert set(card.card.tables.tables) == {3}


def test_the_gather_buffer_is_deleted_before_tables_change(card: Wire) -> None:
    card.tell("#2DEFINE COMP 1,100", "0", "DEFINE GATHER 100")
    assert card.refusal("#1DEFINE COMP 1,100") == 3
    assert card.refusal("#2DELETE COMP") == 3
    card.tell("DELETE GATHER", "#1DEFINE COMP 1,100", "0", "#1DELETE COMP", "#2DELETE COMP")


def test_a_table_corrects_nothing_until_its_last_entry_has_come(card: Wire) -> None:
    card.tell("#1DEFINE COMP 3,100", "16", "32")
    assert card.card.tables.tables == {}
    assert card.ask("LIST COMP") == ["16 32"]
    card.tell("0")
    assert corrections(card, 1, (100 / 3,)) == [pytest.approx(1.0)]


def test_other_commands_are_executed_between_two_entries(card: Wire) -> None:
    card.tell("#1DEFINE COMP 3,100", "16 32", "#2J/", "P1=5", "CLOSE")
    assert card.ask("P1 #2P") == ["5", "0"]
    card.tell("0")
    assert card.ask("#1LIST COMP") == ["16 32 0"]


def test_a_number_sets_p0_but_for_a_table_that_waits_for_it(card: Wire) -> None:
    """User Manual, Special-Use P-Variable."""
    card.tell("P0=1", "#1DEFINE COMP 2,100", "7", "0")
    assert card.ask("P0") == ["1"]
    card.tell("342")
    assert card.ask("P0") == ["342"]


def test_entries_go_to_the_table_that_was_defined_last(card: Wire) -> None:
    card.tell("#2DEFINE COMP 2,100", "7", "#1DEFINE COMP 1,100", "0", "P0=1", "8")
    assert set(card.card.tables.tables) == {1}
    assert card.ask("P0 #2LIST COMP") == ["8", "7"]


def test_only_the_host_that_defined_a_table_fills_it(card: Wire) -> None:
    other = card.sim.connect()
    card.tell("P0=1", "#1DEFINE COMP 2,100", "7")
    assert say(card, other, "8") == b"\x06"
    assert card.ask("P0") == ["8"]
    assert card.ask("LIST COMP") == ["7"]
    assert say(card, other, "#1LIST COMP DEF") == b"2,#1,#1,100\r\x06"
    card.tell("0")
    assert 1 in card.card.tables.tables


@pytest.mark.parametrize("line", ["1 2 3", "1.5", "8388608", "-", "1 X", ".5", "1 2 #1J+"])
def test_a_line_with_something_else_than_the_entries_left_is_refused_whole(card: Wire, line: str) -> None:
    card.tell("P0=1", "#1DEFINE COMP 3,100", "16")
    assert card.refusal(line) == 3
    assert card.ask("P0 LIST COMP") == ["1", "16"]
    assert not card.card.motors[1].jogging
    card.tell("-32 0")
    assert card.ask("LIST COMP") == ["16 -32 0"]


def test_no_table_is_defined_while_a_program_is_stored(card: Wire) -> None:
    card.tell("OPEN PROG 1 CLEAR", "X1")
    assert card.refusal("#1DEFINE COMP 1,100") == 7
    card.tell("CLOSE", "#1DEFINE COMP 1,100", "OPEN PROG 1")
    assert card.raw("0\r").startswith(b"\x07")
    card.tell("CLOSE", "0")
    assert card.ask("LIST PROG 1 LIST COMP") == ["X1", "RET", "0"]


@pytest.mark.parametrize("word", ["LIST COMP", "LIST COMP DEF"])
def test_what_is_not_there_is_not_listed(card: Wire, word: str) -> None:
    card.tell(*EIGHT)
    assert card.refusal(f"#2{word}") == 3


def test_a_definition_that_is_none_defines_nothing(card: Wire) -> None:
    beyond = card.card.dialect.motor_count + 1
    for line in (
        "DEFINE COMP",
        "DEFINE COMP 0,100",
        f"DEFINE COMP 8,#{beyond},#1,100",
        "DEFINE COMP 8,#1,#2D,100",
    ):
        assert card.refusal(line) == 3
    assert card.card.tables.motors == frozenset()


def test_tables_and_programs_share_the_memory(card: Wire) -> None:
    before = int(card.ask("SIZE")[0])
    card.tell("#1DEFINE COMP 100,4000")
    assert int(card.ask("SIZE")[0]) == before - 100
    card.tell("DELETE COMP")
    assert int(card.ask("SIZE")[0]) == before


def test_memory_ends(card: Wire, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(buffers, "ROOM_LINES", 8)
    assert card.refusal("#1DEFINE COMP 9,4000") == 6
    card.tell(*EIGHT, "OPEN PROG 1 CLEAR")
    assert card.refusal("X1") == 6


def test_delete_all_deletes_tables(card: Wire) -> None:
    card.tell(*EIGHT, "DELETE ALL")
    assert card.card.tables.motors == frozenset()


def test_the_status_tells_when_a_table_corrects(card: Wire) -> None:
    def on() -> bool:
        return bool(int(card.ask("???")[0][:6], 16) & COMPENSATION_ON)

    card.tell("I51=1")
    assert not on()
    card.tell(*EIGHT)
    assert on()
    card.tell("I51=0")
    assert not on()
    card.tell("I51=1", "#1DELETE COMP")
    assert not on()


def test_every_change_counts_up(card: Wire) -> None:
    tables = card.card.tables
    seen = [tables.revision]
    for line in ("#1DEFINE COMP 2,100", "1", "0", "DELETE COMP"):
        card.tell(line)
        seen.append(tables.revision)
    assert sorted(set(seen)) == seen


def test_saved_tables_come_back_with_a_reset(card: Wire) -> None:
    card.tell(*GRID, *EIGHT)
    kept = dict(card.card.tables.tables)
    card.tell("SAVE", "#1DELETE COMP", "#2DELETE COMP", "#7DEFINE COMP 1,100", "0")
    reset(card)
    assert card.card.tables.tables == kept


def test_without_save_a_reset_leaves_tables_as_it_leaves_programs(card: Wire) -> None:
    card.tell(*EIGHT, "OPEN PROG 5 CLEAR", "X1", "CLOSE")
    reset(card)
    assert card.ask("#1LIST COMP DEF LIST PROG 5") == ["8,#1,#1,4000", "X1", "RET"]


def test_the_factory_has_no_tables(card: Wire) -> None:
    card.tell(*EIGHT, "SAVE")
    reset(card, "$$$***")
    assert card.card.tables.motors == frozenset()
    reset(card)
    assert set(card.card.tables.tables) == {1}


def test_a_table_that_is_not_full_is_not_saved(card: Wire) -> None:
    card.tell("#2DEFINE COMP 2,100", "1", "SAVE")
    reset(card)
    assert card.card.tables.motors == frozenset()
    card.tell("P0=1", "8")
    assert card.ask("P0") == ["8"]


@pytest.mark.parametrize("dialect", [PMAC, TURBO], ids=lambda dialect: dialect.name)
def test_saved_tables_outlive_the_process(machine: MachineProfile, tmp_path: Path, dialect: Dialect) -> None:
    path = tmp_path / "saved.json"
    first = wire(machine, dialect, saved=path)
    first.tell(*GRID, *EIGHT, "SAVE")
    again = wire(machine, dialect, saved=path)
    assert again.card.tables.tables == first.card.tables.tables
    kept = json.loads(path.read_text(encoding="ascii"))["tables"]
    assert kept == {str(motor): table_lines(table) for motor, table in first.card.tables.tables.items()}


@pytest.mark.parametrize("lines", [[], ["#1DEFINE COMP 2,#1,#1,100", "1"], ["#99DEFINE COMP 1,#1,#1,100", "1"]])
def test_a_file_of_lines_of_no_table_is_refused(machine: MachineProfile, tmp_path: Path, lines: list[str]) -> None:
    path = tmp_path / "saved.json"
    wire(machine, saved=path).tell("SAVE")
    kept = json.loads(path.read_text(encoding="ascii"))
    kept["tables"] = {"1": lines}
    path.write_text(json.dumps(kept), encoding="ascii")
    with pytest.raises(ProfileError) as refused:
        wire(machine, saved=path)
    assert refused.value.problems[0].code == "file.unreadable"


# Data gathering over the line: DEFINE, GATHER, ENDGATHER, LIST and DELETE, and what else notices of it.

SET_UP = {"pmac": "I19=1 I20=1 I21=$800028", "turbo": "I5049=1 I5050=1 I5051=0 I5001=$800088"}
"""The commanded position of motor 1, in each servo cycle (Software Reference, suggested M-variables)."""


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def gather_card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    dialect: Dialect = request.param
    made = wire(machine, dialect)
    made.tell(SET_UP[dialect.name])
    return made


def gathering(gather_card: Wire) -> bool:
    return "gathering" in decode(gather_card.ask("???")[0], gather_card.card.dialect.global_bits)


def words(gather_card: Wire, command: str = "LIST GATHER") -> list[str]:
    return [text for line in gather_card.ask(command) for text in line.split()]


def pass_cycles(gather_card: Wire, cycles: int) -> None:
    """Let at least so many servo cycles pass, in whole background cycles."""
    end = gather_card.card.cycles + cycles
    while gather_card.card.cycles < end:
        gather_card.sim.wait(0.005)


def test_a_gather_fills_its_buffer_and_ends_by_itself(gather_card: Wire) -> None:
    gather_card.tell("#1J/", "#1J=100")
    gather_card.settle()
    gather_card.tell("DEFINE GATHER 20", "GATHER")
    assert gathering(gather_card)
    pass_cycles(gather_card, 20)
    assert not gathering(gather_card)
    # 100 counts in 1/(96 x 32) count
    assert gather_card.ask("LIST GATHER") == [" ".join(16 * ["00000004B000"]), " ".join(4 * ["00000004B000"])]


def test_the_bit_of_the_global_status_says_that_it_gathers(gather_card: Wire) -> None:
    """Bit 19 of the first word, in both families (Software Reference, ???)."""
    before = int(gather_card.ask("???")[0], 16)
    gather_card.tell("DEFINE GATHER 1000", "GATHER")
    assert int(gather_card.ask("???")[0], 16) == before | 1 << 19 + 24
    gather_card.tell("ENDGATHER")
    assert int(gather_card.ask("???")[0], 16) == before


def test_endgather_keeps_what_there_is(gather_card: Wire) -> None:
    gather_card.tell("DEF GAT 1000", "GAT")
    pass_cycles(gather_card, 20)
    gather_card.tell("ENDG")
    kept = words(gather_card)
    assert 20 <= len(kept) < 1000
    pass_cycles(gather_card, 20)
    assert words(gather_card, "LIST GAT") == kept
    gather_card.tell("ENDGATHER")


def test_each_gather_follows_servo_cycles_without_a_hole(gather_card: Wire) -> None:
    """A jog of one count a cycle: consecutive samples are one count apart, over background cycles."""
    gather_card.tell("#1J/", f"I119=1 I120=1 I121=0 I122={1.0 / gather_card.card.cycle_ms}", "#1J+")
    pass_cycles(gather_card, 50)
    gather_card.tell("DEFINE GATHER 200", "GATHER")
    pass_cycles(gather_card, 200)
    found = [int(text, 16) / (96 * 32) for text in words(gather_card)]
    assert len(found) == 200
    steps = [after - before for before, after in pairwise(found)]
    assert steps == pytest.approx([1.0] * 199, abs=1e-3)


def test_a_part_of_the_buffer_is_listed(gather_card: Wire) -> None:
    gather_card.tell("#1J/", "#1J+", "DEFINE GATHER 60", "GATHER")
    pass_cycles(gather_card, 60)
    every = words(gather_card)
    assert len(every) == 60
    assert len(set(every)) > 1
    assert words(gather_card, "LIST GATHER 50") == every[50:]
    assert words(gather_card, "LIST GATHER 10,7") == every[10:17]
    assert words(gather_card, "LIST GATHER ,7") == every[:7]
    assert words(gather_card, "LIST GATHER 60,7") == []


def test_a_listing_costs_its_host_as_much_as_one_of_a_program(gather_card: Wire) -> None:
    gather_card.tell("DEFINE GATHER 320", "GATHER")
    pass_cycles(gather_card, 320)
    gather_card.tell("OPEN PROG 1 CLEAR", *(f"X{n}" for n in range(19)), "CLOSE")
    contexts = [Context(gather_card.card), Context(gather_card.card)]
    for context, line in zip(contexts, ("LIST PROG 1", "LIST GATHER"), strict=True):
        for _ in commands(line, context):
            pass
        assert len(context.lines) == 20
    assert contexts[0].work == contexts[1].work


def test_003_no_input_of_this_card_starts_a_gather(gather_card: Wire) -> None:
    gather_card.tell("DEFINE GATHER 10")
    assert gather_card.refusal("GATHER TRIGGER") == 3
    assert not gathering(gather_card)


def test_while_it_gathers_it_is_neither_defined_nor_deleted(gather_card: Wire) -> None:
    """Software Reference, DEFINE GATHER; Turbo Software Reference, DELETE GATHER: an error, until ENDGATHER."""
    gather_card.tell("DEFINE GATHER 1000", "GATHER")
    for line in ("DEFINE GATHER 10", "DELETE GATHER", "DEL GAT", "DELETE ALL"):
        assert gather_card.refusal(line) == 7, line
    gather_card.tell("GATHER", "ENDGATHER", "DELETE GATHER", "DELETE GATHER")
    assert gather_card.refusal("GATHER") == 3


def test_size_is_what_is_left_and_no_more_can_be_defined(gather_card: Wire) -> None:
    free = int(gather_card.ask("SIZE")[0])
    gather_card.tell("DEFINE GATHER 1000")
    assert int(gather_card.ask("SIZE")[0]) == free - 1000
    assert gather_card.refusal(f"DEFINE GATHER {free + 1}") == 6
    gather_card.tell(f"DEFINE GATHER {free}")
    assert gather_card.ask("SIZE") == ["0"]
    gather_card.tell("DELETE GATHER")
    assert int(gather_card.ask("SIZE")[0]) == free


def test_without_a_number_all_memory_is_taken_and_no_program_can_be_entered(gather_card: Wire) -> None:
    """Software Reference, DEFINE GATHER: until the buffer is deleted."""
    gather_card.tell("DEFINE GATHER", "OPEN PROG 1 CLEAR")
    assert gather_card.refusal("X10") == 6
    gather_card.tell("CLOSE", "DELETE GATHER", "OPEN PROG 1 CLEAR", "X10", "CLOSE")


def test_006_a_full_memory_has_no_room_for_it(gather_card: Wire, monkeypatch: pytest.MonkeyPatch) -> None:
    gather_card.tell("OPEN PROG 1 CLEAR", "X1", "X2", "CLOSE")
    monkeypatch.setattr(buffers, "ROOM_LINES", 2)
    assert gather_card.refusal("DEFINE GATHER") == gather_card.refusal("DEFINE GATHER 1") == 6
    gather_card.tell("DELETE PROG 1", "DEFINE GATHER 2")


def test_007_not_while_a_program_is_entered(gather_card: Wire) -> None:
    gather_card.tell("OPEN PROG 1 CLEAR")
    assert gather_card.refusal("DEFINE GATHER 10") == 7
    gather_card.tell("CLOSE", "DEFINE GATHER 10")


def test_the_words_act_at_once_while_a_program_is_entered(gather_card: Wire) -> None:
    gather_card.tell("DEFINE GATHER 1000", "OPEN PROG 1 CLEAR", "GATHER", "X10", "ENDG", "CLOSE")
    assert gather_card.listed("PROG 1") == ["X10"]
    assert words(gather_card) == []


def test_a_program_starts_and_ends_it_by_command(gather_card: Wire) -> None:
    """GATHER is no word of a program: CMD is how one gives it."""
    gather_card.tell("#1J/ #2J/ #3J/", "DEFINE GATHER 10000")
    gather_card.tell("OPEN PROG 1 CLEAR", 'CMD"GATHER"', "DWELL100", 'CMD"ENDGATHER"', "CLOSE", "&1B1R")
    gather_card.settle()
    assert not gathering(gather_card)
    cycles = 100 / gather_card.card.cycle_ms
    assert len(words(gather_card)) == pytest.approx(cycles, abs=25), "to a background cycle at each end"


def test_a_table_is_not_defined_while_there_is_a_buffer(gather_card: Wire) -> None:
    """Software Reference, DEFINE COMP: an ERR003 that DELETE GATHER takes away."""
    gather_card.tell("DEFINE GATHER 10")
    assert gather_card.refusal("#1DEFINE COMP 4,#2,#1,4000") == 3
    gather_card.tell("DELETE GATHER", "#1DEFINE COMP 4,#2,#1,4000")


def test_a_reset_ends_it(gather_card: Wire) -> None:
    gather_card.tell("DEFINE GATHER 1000", "GATHER")
    gather_card.raw("$$$\rI3=2 I6=1\r")
    assert not gathering(gather_card)


def test_an_address_of_nothing_is_gathered_as_the_word_that_is_there(gather_card: Wire) -> None:
    first = {"pmac": 21, "turbo": 5001}[gather_card.card.dialect.name]
    gather_card.tell(f"I{first}=$1234", "WY:$1234,$ABCDEF", "DEFINE GATHER 2", "GATHER")
    pass_cycles(gather_card, 2)
    assert words(gather_card) == ["000000ABCDEF"] * 2
