"""Program buffers over the line: opening, filling, listing, deleting, protecting."""

from __future__ import annotations

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.syntax import Line, Return
from drivers.pmac.language.text import format_line
from drivers.simulator.hosts.port import LINE_LIMIT
from profiles.machine import MachineProfile
from tests.drivers.language import trees
from tests.drivers.wire_card import Wire, wire


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    dialect: Dialect = request.param
    return wire(machine, dialect)


def listing(card: Wire, number: int = 1) -> list[str]:
    return card.listed(f"PROG {number}")


def test_what_exists_on_line_and_in_programs_goes_into_the_open_buffer(card: Wire) -> None:
    before = card.ask("P1 I5 M1")
    card.tell("OPEN PROG 1 CLEAR", "P1=1", "I5=2", "M1", "I100", "F50", "HOME1", "ENABLE PLC 3", "CLOSE")
    assert listing(card) == ["P1=1", "I5=2", "M1", "I100", "F50", "HOME1", "ENABLEPLC3"]
    assert card.ask("P1 I5 M1") == before
    assert card.card.plcs.switches.enabled == set()


@pytest.mark.parametrize("word", ["CLOSE", "CLS", "c l o s e", "c l s"])
def test_close_at_the_end_of_a_line_closes_the_buffer(card: Wire, word: str) -> None:
    card.tell("OPEN PROG 1 CLEAR", f"X10 {word}")
    assert card.card.open_buffer is None
    assert listing(card) == ["X10"]


def test_on_line_commands_act_at_once_while_a_buffer_is_open(card: Wire) -> None:
    card.tell("OPEN PROG 1 CLEAR", "#2J/")
    assert card.card.motors[2].enabled
    assert card.ask("#2P") == ["0"]
    assert len(card.ask("#1 ? ?? ??? P V F % PC SIZE VERSION M5->")) == 11
    card.tell("#2J=100", "X10", "CLOSE")
    card.settle()
    assert card.ask("#2P") == ["100"]
    assert listing(card) == ["X10"]


def test_the_centre_of_a_circle_is_no_jog(card: Wire) -> None:
    card.tell("OPEN PROG 1 CLEAR", "CIRCLE1 X10 Y10 I5 J-5", "J-", "X10 I0 J(P1)", "CLOSE")
    assert listing(card) == ["CIRCLE1X10Y10I5J-5", "X10I0J(P1)"]
    assert card.card.motors[1].jogging


def test_the_poll_of_a_client_is_refused_while_its_buffer_is_open(card: Wire) -> None:
    """That is how the client learns of it, and sends CLOSE."""
    card.tell("OPEN PROG 1 CLEAR")
    assert card.raw("i65???&1??%#1?PVFm190p99\r").startswith(b"\x07")
    card.tell("CLOSE")
    assert len(card.ask("i65???&1??%#1?PVFm190p99")) == 10


def test_close_at_the_end_of_a_line_closes(card: Wire) -> None:
    card.tell("OPEN PROG 1 CLEAR X10 Y20 CLOSE")
    assert listing(card) == ["X10Y20"]


def test_a_text_may_contain_a_semicolon_and_the_word_close(card: Wire) -> None:
    card.tell("OPEN PROG 1 CLEAR", 'SEND"a;b CLOSE"', 'CMD"P1=5" ; remark CLOSE', "CLOSE")
    assert listing(card) == ['SEND"a;b CLOSE"', 'COMMAND"P1=5"']


def test_a_part_of_a_program_is_listed(card: Wire) -> None:
    card.tell("OPEN PROG 1 CLEAR", *(f"X{n}" for n in range(10)), "CLOSE")
    assert card.ask("LIST PROG 1,7") == ["7:X7", "8:X8", "9:X9", "10:RET"]
    assert card.ask("LIST PROG 1,2,3") == ["2:X2", "3:X3", "4:X4"]
    assert card.ask("LIST PROG 1,,2") == ["0:X0", "1:X1"]
    assert card.refusal("LIST PROG 1,11,1") == 3
    assert card.refusal("LIST PROGRAM 1,20") == 3


def test_003_there_is_no_such_program(card: Wire) -> None:
    assert card.refusal("LIST PROG 7") == 3
    assert card.refusal("LIST PLC 7") == 3
    assert card.refusal("OPEN PROG 32768") == 3


def test_001_no_buffer_is_opened_while_a_program_runs(card: Wire) -> None:
    card.tell("#1J/ #2J/ #3J/", "OPEN PROG1 CLEAR", "DWELL1000", "CLOSE", "B1R")
    card.sim.wait(0.05)
    assert card.refusal("OPEN PROG 2") == 1


def test_015_nothing_runs_while_a_buffer_is_open(card: Wire) -> None:
    card.tell("#1J/ #2J/ #3J/", "OPEN PROG1 CLEAR", "X1", "CLOSE", "OPEN PROG 2")
    other = Wire(sim=card.sim, port=card.sim.connect())
    other.tell("&1B1")
    assert other.refusal("R") == 15
    assert other.refusal("S") == 15


def test_size_is_negative_while_a_buffer_is_open(card: Wire) -> None:
    (free,) = card.ask("SIZE")
    card.tell("OPEN PROG 1 CLEAR", "X1", "X2")
    assert card.ask("SIZE") == [str(2 - int(free))]
    card.tell("CLOSE")
    assert card.ask("SIZE") == [str(int(free) - 2)]


def test_programs_are_deleted_one_by_one_and_all_together(card: Wire) -> None:
    for number in (1, 2, 3):
        card.tell(f"OPEN PROG {number} CLEAR", "X1", "CLOSE")
    card.tell("DELETE PROG 2")
    assert card.refusal("LIST PROG 2") == 3
    card.tell("DELETE ALL")
    assert card.refusal("LIST PROG 1") == 3


@pytest.mark.parametrize("what", ["GATHER", "GAT", "ROT", "ROTARY", "COMP", "TRACE", "TBUF", "BLCOMP"])
def test_what_was_never_defined_is_deleted_without_a_word(card: Wire, what: str) -> None:
    card.tell(f"DELETE {what}")


def test_007_no_deletion_of_what_is_open(card: Wire) -> None:
    card.tell("OPEN PROG 1")
    assert card.refusal("DELETE PROG 1") == 7
    assert card.refusal("DELETE ALL") == 7


def test_plcs_are_kept_listed_and_switched(card: Wire) -> None:
    lines = ["IF(P1=1)", "P2=P2+1", 'CMD"#1J/"', "ENDIF"]
    card.tell("ENABLE PLC 5", "OPEN PLC 5 CLEAR", *lines, "CLOSE")
    assert card.listed("PLC 5") == [line.replace("CMD", "COMMAND") for line in lines]
    assert card.ask("LIST PLC 5,1,1") == ["1:P2=P2+1"]
    assert card.refusal("LIST PLC 5,9,1") == 3
    assert card.card.plcs.switches.enabled == set()
    card.tell("ENABLE PLC 1,5..7", "DISABLE PLC 6")
    assert card.card.plcs.switches.enabled == {1, 5, 7}
    card.tell("DELETE PLC 5")
    assert card.refusal("LIST PLC 5") == 3
    assert card.card.plcs.switches.enabled == {1, 7}


def test_an_open_plc_shows_in_the_global_status_and_takes_no_motion(card: Wire) -> None:
    card.tell("OPEN PLC 5")
    assert card.ask("???") == ["000001020000"]
    assert card.refusal("X10") == 3
    assert card.refusal("OPEN PROG 1") == 7


def test_a_password_protects_programs_from_1000_on_and_plcs_to_15(card: Wire) -> None:
    card.tell("OPEN PROG 1000 CLEAR", "X1", "CLOSE", "OPEN PLC 3 CLEAR", "CLOSE", "PASSWORD=Bush 1;2")
    assert listing(card, 1000) == ["X1"]
    card.raw("$$$\rI3=2 I6=1\r")
    for line in (
        "LIST PROG 1000",
        "OPEN PROG 1000",
        "OPEN PROG 32767",
        "DELETE PROG 1000",
        "LIST PLC 3",
        "OPEN PLC 15",
    ):
        assert card.refusal(line) == 2
    assert card.refusal("PASSWORD=bush 1;2") == 2
    card.tell("OPEN PROG 999", "CLOSE", "OPEN PLC 16", "CLOSE", "PASSWORD=Bush 1;2")
    assert listing(card, 1000) == ["X1"]


def test_a_password_that_was_given_can_be_changed(card: Wire) -> None:
    card.tell("PASSWORD=one", "PASSWORD=two")
    card.raw("$$$\rI3=2 I6=1\r")
    assert card.refusal("PASSWORD=one") == 2
    card.tell("PASSWORD=two", "PASSWORD=")
    card.raw("$$$\rI3=2 I6=1\r")
    card.tell("OPEN PROG 1000")


def test_a_listing_that_is_typed_again_is_the_same_program(machine: MachineProfile) -> None:
    source = """
        linear ta 100 ts(P5/2) F(50*P1)
        while(p1<3) p1 = p1 +1 endwhile
        while (p1 !< 3 and p2=0 or p3~1)
        Inc(x, y) X(P1) Y-5.25 z(sin(30))
        if(m1=1) dwell 10 else delay20
        end while
        N100 GoSub200 Goto 100
        call 500.1 x5 y6 read(x,y)
        pvt 20
        X10:5 Y1:0
        CIRCLE2 X1 Y2 R5
        M1==1 M2==P1+1
        G1 X5 M3 T2 D7
        homez1..3,5 PSET X0 stop
        sendp"Hi; there" CMD"&1A" display 3 "text"
        N200 return
    """.strip().splitlines()
    card = wire(machine, TURBO)
    card.tell("OPEN PROG 1 CLEAR", *(line.strip() for line in source), "CLOSE")
    first = listing(card)
    card.tell("OPEN PROG 2 CLEAR", *first, "CLOSE")
    assert listing(card, 2) == first
    assert card.card.programs[1] == card.card.programs[2]


@given(lines=st.lists(trees.lines, min_size=1, max_size=6))
def test_every_program_that_is_typed_is_stored_and_listed_as_it_is(
    machine: MachineProfile, lines: list[Line]
) -> None:
    """No word of a program is taken for a command."""
    typed = [line for line in lines if line]
    texts = [format_line(line) for line in typed]
    assume(all(len(text) <= LINE_LIMIT for text in texts))
    card = wire(machine)
    card.tell("OPEN PROG 1 CLEAR", *texts, "CLOSE")
    # A RETURN that is typed last is the one that ends every listing.
    kept = typed[:-1] if typed[-1:] == [(Return(),)] else typed
    assert [parse_line(text) for text in listing(card)] == kept


@pytest.mark.parametrize("line", ["DEL GAT", "DEL PROG 1", "DEL ALL", "DEL PLC 3", "DELETE PLC 3"])
def test_delete_has_a_short_spelling_that_is_not_delay(card: Wire, line: str) -> None:
    card.tell("OPEN PROG 1 CLEAR", "DELAY40", "DELAY(P1)", "DLY5", "CLOSE")
    assert len(listing(card)) == 3
    card.tell(line)
