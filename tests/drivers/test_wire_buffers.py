"""Programs and PLCs that are typed over the line, what they say, and the words that public tools use."""

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


def test_the_centre_of_a_circle_is_no_jog_and_a_text_may_contain_close(card: Wire) -> None:
    card.tell("OPEN PROG 1 CLEAR", "CIRCLE1 X10 Y10 I5 J-5", "J-", "X10 I0 J(P1)", "CLOSE")
    assert listing(card) == ["CIRCLE1X10Y10I5J-5", "X10I0J(P1)"]
    assert card.card.motors[1].jogging
    card.tell("OPEN PROG 1 CLEAR X10 Y20 CLOSE")
    assert listing(card) == ["X10Y20"]
    card.tell("OPEN PROG 1 CLEAR", 'SEND"a;b CLOSE"', 'CMD"P1=5" ; remark CLOSE', "CLOSE")
    assert listing(card) == ['SEND"a;b CLOSE"', 'COMMAND"P1=5"']


def test_the_poll_of_a_client_is_refused_while_its_buffer_is_open(card: Wire) -> None:
    """That is how the client learns of it, and sends CLOSE."""
    card.tell("OPEN PROG 1 CLEAR")
    assert card.raw("i65???&1??%#1?PVFm190p99\r").startswith(b"\x07")
    card.tell("CLOSE")
    assert len(card.ask("i65???&1??%#1?PVFm190p99")) == 10


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


def test_007_no_deletion_of_what_is_open(card: Wire) -> None:
    card.tell("OPEN PROG 1")
    assert card.refusal("DELETE PROG 1") == 7
    assert card.refusal("DELETE ALL") == 7


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
def test_every_program_that_is_typed_is_listed_as_it_is(machine: MachineProfile, lines: list[Line]) -> None:
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


# What programs say unasked: SEND, CMD, their errors, and I62 and I64.


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def moving_card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    dialect: Dialect = request.param
    made = wire(machine, dialect)
    made.tell("#1J/ #2J/ #3J/")
    return made


def run(moving_card: Wire, *lines: str, seconds: float = 0.1) -> bytes:
    """Run a program and return what the host hears while it runs."""
    moving_card.tell("OPEN PROG1 CLEAR", *lines, "CLOSE", "&1B1R")
    moving_card.sim.wait(seconds)
    return moving_card.port.take_output()


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ("I62=0 I64=0", b"Hello; you\r"),
        ("I62=1 I64=0", b"Hello; you"),
        ("I62=0 I64=1", b"\x02Hello; you\r"),
        ("I62=1 I64=1", b"\x02Hello; you"),
    ],
)
def test_send_tells_a_text_without_an_acknowledgement(moving_card: Wire, settings: str, said: bytes) -> None:
    moving_card.tell(settings)
    assert run(moving_card, 'SEND"Hello; you"') == said


@pytest.mark.parametrize(("i3", "said"), [(0, b"Hi\r"), (1, b"\nHi\r"), (2, b"Hi\r"), (3, b"\nHi\r")])
def test_send_follows_the_handshake_but_for_the_acknowledgement(moving_card: Wire, i3: int, said: bytes) -> None:
    moving_card.tell("OPEN PROG1 CLEAR", "DWELL20", 'SEND"Hi"', "CLOSE", "&1B1R")
    moving_card.raw(f"I3={i3}\r")
    moving_card.sim.wait(0.1)
    assert moving_card.port.take_output() == said


def test_every_host_hears_a_message(moving_card: Wire) -> None:
    other = moving_card.sim.connect()
    assert run(moving_card, 'SENDP"one"', 'SEND"two"') == b"one\rtwo\r"
    assert other.take_output() == b"one\rtwo\r"


def test_a_message_comes_between_two_replies_and_never_inside_one(moving_card: Wire) -> None:
    moving_card.tell(
        "OPEN PROG1 CLEAR", "WHILE(P1<20)", "P1=P1+1", 'SEND"*"', "DWELL7", "ENDWHILE", "CLOSE", "&1B1R"
    )
    said = b""
    for _ in range(60):
        moving_card.port.receive(b"Q1..3\r")
        moving_card.sim.wait(0.005)
        said += moving_card.port.take_output()
    assert said.count(b"*\r") == 20
    assert said.replace(b"*\r", b"") == b"0\r0\r0\r\x06" * 60


def test_cmd_executes_a_command_in_the_background_with_addresses_of_its_own(moving_card: Wire) -> None:
    """Motor 2 was addressed by the host; the command jogs motor 1's neighbour 3 and then asks #1."""
    moving_card.tell("#2")
    assert run(moving_card, 'CMD"#3J=100"', 'CMD"P5=7"', 'CMD"#1P"') == b""
    moving_card.settle()
    assert moving_card.ask("P5 # #3P") == ["7", "2", "100"]


def test_cmd_tells_its_answer_without_an_acknowledgement_and_may_be_a_control_character(
    moving_card: Wire,
) -> None:
    moving_card.tell("P5=25 P6=50")
    assert run(moving_card, 'CMDS"P5..6"', 'CMD"P5"') == b"25\r50\r"
    run(moving_card, "CMD^K", "DWELL10")
    assert not any(motor.enabled for motor in moving_card.card.motors.values())


@pytest.mark.parametrize(("i6", "said"), [(0, b"\x07"), (1, b"\x07ERR003\r"), (2, b""), (3, b"\x07\rERR003\r")])
def test_an_error_of_a_program_is_told_unless_i6_is_2(moving_card: Wire, i6: int, said: bytes) -> None:
    moving_card.tell("OPEN PROG1 CLEAR", "DWELL20", 'CMD"UUU"', "CLOSE", "&1B1R")
    moving_card.raw(f"I6={i6}\r")
    moving_card.sim.wait(0.1)
    assert moving_card.port.take_output() == said


def test_a_program_starts_another_coordinate_system(moving_card: Wire) -> None:
    moving_card.tell("#3->0", "&2 #3->Z", "OPEN PROG2 CLEAR", "INC TA10 TS0 TM50 Z30", "CLOSE")
    run(moving_card, 'CMD"&2B2R"', "DWELL10")
    moving_card.settle()
    assert moving_card.ask("#3P") == ["30"]


def test_a_flood_of_messages_does_not_stop_the_card(moving_card: Wire) -> None:
    moving_card.tell(
        "OPEN PROG1 CLEAR", "WHILE(1=1)", 'SEND"0123456789"', 'CMDS"P1..3"', "ENDWHILE", "CLOSE", "&1B1R"
    )
    moving_card.sim.wait(1.0)
    assert moving_card.raw("\x01\x18P1\r").endswith(b"0\r\x06")


@pytest.mark.parametrize("stop", [b"\x01", b"\x0b"], ids=["control-A", "control-K"])
def test_a_stop_forgets_the_commands_that_wait(moving_card: Wire, stop: bytes) -> None:
    """More than a background cycle has room for, and a jog behind them."""
    moving_card.tell("OPEN PROG1 CLEAR", *['CMD"P1=P1+1"'] * 60, 'CMD"#3J+"', "CLOSE", "P1=0", "&1B1R")
    moving_card.sim.wait(0.01)
    assert 0 < float(moving_card.ask("P1")[0]) < 60
    moving_card.raw(stop)
    moving_card.sim.wait(0.5)
    assert float(moving_card.ask("P1")[0]) < 60
    assert not moving_card.card.motors[3].jogging
    assert moving_card.card.motors[3].velocity == 0.0


# Words that public programs and drivers use, each as a host would type it.


@pytest.fixture
def turbo_card(machine: MachineProfile) -> Wire:
    return wire(machine, TURBO)


def test_a_plc_addresses_by_a_variable(turbo_card: Wire) -> None:
    turbo_card.tell(
        "I5=2 P1=2 P2=3", "&3Q5=33", "&1Q5=11", "OPEN PLC 4 CLEAR", "ADDRESS#P1 ADDRESS&P2", "P9=Q5", "CLOSE"
    )
    turbo_card.tell("OPEN PLC 5 CLEAR", "ADR#P1", 'CMD"J/"', "DISABLE PLC 5", "CLOSE", "ENABLE PLC 4,5")
    turbo_card.sim.wait(0.1)
    assert turbo_card.ask("P9") == ["33"]
    assert [turbo_card.card.motors[number].enabled for number in (1, 2, 3)] == [False, True, False]
    assert turbo_card.listed("PLC 4") == ["ADDRESS#P1ADDRESS&P2", "P9=Q5"]


def test_a_plc_that_addresses_what_does_not_exist_is_switched_off(turbo_card: Wire) -> None:
    turbo_card.tell("I5=2 P1=0", "OPEN PLC 4 CLEAR", "ADDRESS#P1", "P9=1", "CLOSE", "ENABLE PLC 4")
    turbo_card.sim.wait(0.1)
    assert turbo_card.ask("P9") == ["0"]
    assert turbo_card.card.plcs.switches.enabled == set()


def test_a_paused_plc_goes_on_where_it_was(turbo_card: Wire) -> None:
    turbo_card.tell(
        "I5=2", "OPEN PLC 4 CLEAR", "P1=P1+1", "WHILE(P3=0)", "P2=P2+1", "ENDWHILE", "CLOSE", "ENABLE PLC 4"
    )
    turbo_card.sim.wait(0.05)
    turbo_card.tell("PAUSE PLC 4")
    (first,) = turbo_card.ask("P2")
    turbo_card.sim.wait(0.05)
    assert turbo_card.ask("P1 P2") == ["1", first]
    turbo_card.tell("RESUME PLC 4")
    turbo_card.sim.wait(0.05)
    assert turbo_card.ask("P1") == ["1"], "from the WHILE, not from the top"
    assert int(turbo_card.ask("P2")[0]) > int(first)
    turbo_card.tell("PAUSE PLC 4", "ENABLE PLC 4")
    turbo_card.sim.wait(0.05)
    assert turbo_card.ask("P1") == ["2"], "from the top"


def test_resume_of_a_plc_that_is_not_paused_does_nothing(turbo_card: Wire) -> None:
    turbo_card.tell(
        "I5=2", "OPEN PLC 4 CLEAR", "P1=P1+1", "CLOSE", "RESUME PLC 4", "DISABLE PLC 4", "RESUME PLC 4"
    )
    turbo_card.sim.wait(0.05)
    assert turbo_card.ask("P1") == ["0"]


def test_a_rapid_move_until_the_trigger_ends_past_it(turbo_card: Wire) -> None:
    """The trigger of motor 1 is a flag below its home position: it is found at once on the way down."""
    turbo_card.tell("#1J/#2J/#3J/", "#1HM")
    turbo_card.settle()
    turbo_card.tell("#1J=4000")
    turbo_card.settle()
    turbo_card.tell("OPEN PROG 1 CLEAR", "RAPID ABS", "P2=300", "X(-9000)^(P2)", "P9=1", "CLOSE", "&1B1R")
    turbo_card.settle()
    (place,) = turbo_card.ask("#1P")
    assert turbo_card.ask("P9") == ["1"]
    assert float(place) == pytest.approx(300, abs=60), "the flag is at 0, within the counts of one look"
    assert turbo_card.listed("PROG 1")[2] == "X(-9000)^(P2)"


def test_a_move_until_a_trigger_that_never_comes_ends_at_its_target(turbo_card: Wire) -> None:
    turbo_card.tell("#1J/#2J/#3J/", "OPEN PROG 1 CLEAR", "RAPID INC", "X500^10 Y200", "P9=1", "CLOSE", "&1B1R")
    turbo_card.settle()
    assert turbo_card.ask("P9") == ["1"]
    assert [turbo_card.card.motors[number].desired for number in (1, 2)] == [500, 200]


def test_a_move_until_a_trigger_belongs_to_rapid(turbo_card: Wire) -> None:
    turbo_card.tell("#1J/#2J/#3J/", "OPEN PROG 1 CLEAR", "LINEAR TA10 TM20", "X500^10", "CLOSE", "&1B1R")
    turbo_card.settle()
    assert turbo_card.ask("#1P") == ["0"]


def test_e_closes_the_loops_of_a_system(turbo_card: Wire) -> None:
    turbo_card.tell("&1E")
    assert [turbo_card.card.motors[number].enabled for number in (1, 2, 3)] == [True, True, True]
    assert turbo_card.refusal("&2E") == 14
    turbo_card.tell("I200=0")
    assert turbo_card.refusal("&1E") == 13


def test_a_pvt_sequence_may_end_in_a_dwell(turbo_card: Wire) -> None:
    turbo_card.tell(
        "#1J/#2J/#3J/", "OPEN PROG 1 CLEAR", "INC PVT100 X50:1000", "X100:1000", "DWELL10", "P9=1", "CLOSE"
    )
    turbo_card.tell("&1B1R")
    turbo_card.settle()
    assert turbo_card.ask("P9") == ["1"]
    (place,) = turbo_card.ask("#1P")
    assert float(place) > 150, "past the point, as far as Ix15 takes to stop"


@pytest.mark.parametrize(
    "line", ["DEFINE LOOKAHEAD 1000,100", "DEFINE UBUFFER 256", "DELETE TEMPS", "DEL LOOKAHEAD"]
)
def test_buffers_that_are_accepted(turbo_card: Wire, line: str) -> None:
    turbo_card.tell(line)


@pytest.mark.parametrize("line", ["MS0,MI910", "MSR0,MI910,P1", "MSW0,MI910,P1", "MSCLRF0", "MS0,I5=1"])
def test_without_a_ring_no_station_answers(turbo_card: Wire, line: str) -> None:
    assert turbo_card.refusal(line) == 8


def test_what_drivers_ask_at_connect(turbo_card: Wire, machine: MachineProfile) -> None:
    assert turbo_card.ask("IDNUMBER SID MOVETIME") == ["0", "0", "0"]
    assert wire(machine, PMAC).refusal("IDNUMBER") == 3


def test_a_computed_variable_on_line(turbo_card: Wire) -> None:
    turbo_card.tell("P1=4", "P(P1+1)=7", "M(P1)=8", "Q(2*P1)=9")
    assert turbo_card.ask("P5 P(P1+1) M4 Q8") == ["7", "7", "8", "9"]
    assert turbo_card.refusal("P(0-1)") == 3


@pytest.mark.parametrize("line", ["OPEN PLCC 1", "OPEN ROT", "LEARN", "CC1", "!X5"])
def test_what_is_not_there_is_refused(turbo_card: Wire, line: str) -> None:
    assert turbo_card.refusal(line) in (3, 5)
