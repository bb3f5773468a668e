"""Variables and words of memory on the line: values, ranges, definitions, registers, pointers."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.memory import WIDTHS, Pointer, scan_pointer
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire


@pytest.fixture
def turbo(machine: MachineProfile) -> Wire:
    return wire(machine, TURBO)


@pytest.mark.parametrize("kind", ["P", "Q", "M"])
def test_a_variable_is_set_and_asked_for(card: Wire, kind: str) -> None:
    assert card.ask(f"{kind}10") == ["0"]
    card.tell(f"{kind}10=-2.5")
    assert card.ask(f"{kind}10") == ["-2.5"]


def test_a_range_answers_one_line_for_each(card: Wire) -> None:
    card.tell("P1=25", "P2=50", "P3=75")
    assert card.ask("P1..3") == ["25", "50", "75"]


def test_start_count_and_step(card: Wire) -> None:
    card.tell("Q53=1", "Q55=3", "Q57=5")
    assert card.ask("Q53,3,2") == ["1", "3", "5"]
    assert card.ask("Q53,3") == ["1", "0", "3"]


def test_a_range_is_set_with_one_assignment(card: Wire) -> None:
    card.tell("I20..44=7", "P1,3,2=4")
    assert card.ask("I20..22") == ["$7", "$7", "$7"]
    assert card.ask("P1..5") == ["4", "0", "4", "0", "4"]


def test_a_setting_of_fifteen_coordinate_systems_in_one_line(turbo: Wire) -> None:
    turbo.tell("i5213,15,100=10")
    assert turbo.ask("I5113 I5213 I6613") == ["0", "10", "10"]


def test_expressions_defaults_and_wraps_of_settings(card: Wire) -> None:
    card.tell("I130=2000", "I130=1.25*I130", "I125=0", "i125=i125|$20000")
    assert card.ask("I130 I125") == ["2500", "$20000"]
    card.tell("i125=i125&$FDFFFF")
    assert card.ask("I125") == ["$0"]
    card.tell("I116=5 I130..131=1", "I116=*", "I130..131=*")
    assert card.ask("I116 I130 I131") == ["32", "2000", "1280"]
    card.tell("I3=6")
    assert card.ask("I3") == ["2"]


@pytest.mark.parametrize(
    ("i9", "answers"),
    [
        (0, ["49152", "32", "Y:$FFC2,0"]),
        (1, ["I125=49152", "I116=32", "M11->Y:$FFC2,0"]),
        (2, ["$C000", "32", "Y:$FFC2,0"]),
        (3, ["I125=$C000", "I116=32", "M11->Y:$FFC2,0"]),
    ],
)
def test_i9_chooses_the_form_of_answers(card: Wire, i9: int, answers: list[str]) -> None:
    card.tell("I125=$C000 I116=32 M11->Y:$FFC2,0", f"I9={i9}")
    assert card.ask("I125 I116 M11->") == answers


def test_p_q_and_m_have_one_form_and_q_belong_to_the_addressed_system(card: Wire) -> None:
    card.tell("I9=3 P1=5 Q1=6 M900=7")
    assert card.ask("P1 Q1 M900") == ["5", "6", "7"]
    card.tell("&1 Q20=5", "&2 Q20=7")
    assert card.ask("&1 Q20 &2 Q20") == ["5", "7"]


@pytest.mark.parametrize(("dialect", "highest"), [(PMAC, 1023), (TURBO, 8191)])
def test_variables_go_as_far_as_they_do(machine: MachineProfile, dialect: Dialect, highest: int) -> None:
    card = wire(machine, dialect)
    card.tell(*(f"{kind}{highest}=1" for kind in "PQM"))
    assert card.ask(f"P{highest} Q{highest} M{highest}") == ["1", "1", "1"]
    assert [card.refusal(f"{kind}{highest + 1}") for kind in "IPQM"] == [3] * 4
    assert len(card.ask(f"P0..{highest}")) == highest + 1


def test_a_line_that_is_only_a_number_sets_p0(card: Wire) -> None:
    card.tell("342")
    assert card.ask("P0") == ["342"]
    card.tell("-1.5")
    assert card.ask("P0") == ["-1.5"]
    assert card.refusal("P5=1 2") == 3


@pytest.mark.parametrize("line", ["P1..", "P3..1", "P1,0,1", "P1,2,0", "P1,9999999,1", "P1=", "I1=**", "P1=*"])
def test_what_is_no_range_and_no_value(card: Wire, line: str) -> None:
    assert card.refusal(line) == 3


def test_what_the_line_did_before_a_command_is_refused_stays_done(card: Wire) -> None:
    assert card.raw("P1=5 P1 P2=6 CLEAR P3=7\r") == b"5\r\x07ERR005\r"
    assert card.ask("P1..3") == ["5", "6", "0"]


def test_of_a_line_that_is_not_understood_nothing_is_done(card: Wire) -> None:
    assert card.raw("P1=5 P1 P2=6 UUU P3=7\r") == b"\x07ERR003\r"
    assert card.ask("P1..3") == ["0", "0", "0"]


def test_the_factory_leaves_the_line_as_its_documents_say(card: Wire) -> None:
    """I4 of a Turbo as read out of real cards: its checksums are on. I9 is not confirmed."""
    card.raw("$$$***\r")
    assert card.card.variables.i(4) == (card.card.dialect is TURBO)
    card.raw("I4=0\r")
    settings = (1, 3, 0, 0, 2, 0, 0, 0)
    assert card.raw("I3 I6 I1 I4 I9 I62..64\r") == b"".join(b"\n%d\r" % value for value in settings) + b"\n"


def test_a_machine_that_is_set_up_has_no_checksums(card: Wire) -> None:
    assert card.ask("I4") == ["0"]


def test_the_factory_of_a_turbo_as_read_out_of_real_cards(turbo: Wire) -> None:
    expected = {"I192": "10", "I190": "0", "I5": "0", "I60": "15", "I61": "8", "I167": "4194304", "I187": "64"}
    hexadecimal = {"I5193": "$2000", "I124": "$40001", "I3224": "$40001"}
    for name, value in {**expected, **hexadecimal}.items():
        turbo.tell(f"{name}=*")
        assert turbo.ask(name) == [value], name


@pytest.mark.parametrize("text", ["M5 ->*", "M5 -> D:$28", "M5\t->", "M1..3 ->*"])
def test_003_a_space_in_front_of_the_arrow_of_a_definition(card: Wire, text: str) -> None:
    card.tell("M5->X:$700,4")
    assert card.refusal(text) == 3
    assert card.ask("M5->") == ["X:$700,4"]


def test_other_spaces_do_not_matter_in_a_definition(card: Wire) -> None:
    card.tell("M 5-> Y : $700, 4 ,8")
    assert card.ask("M5->") == ["Y:$700,4,8"]


# Variables and definitions as memory: what is written to their words is what they are.

DEFINITIONS = {"pmac": 0xBC00, "turbo": 0x4000}
P_VARIABLES, Q_VARIABLES = {"pmac": 0x1000, "turbo": 0x6000}, {"pmac": 0x1400, "turbo": 0x8000}


def test_pointers_and_variables_are_words_of_memory(card: Wire) -> None:
    """The idiom of public PLCs: M35 is the address that M34 points at, and so an index into memory."""
    first = DEFINITIONS[card.card.dialect.name]
    card.tell("M34->Y:$1800,0,24", f"M35->Y:${first + 34:X},0,16", "M34=5")
    assert card.ask("M35") == [str(0x1800)]
    card.tell("M35=$1801", "M34=6")
    assert card.ask("M34-> RY:$1800,2 M34") == ["Y:$1801,24", "5 6", "6"]
    first = DEFINITIONS[card.card.dialect.name]
    card.tell("M1->X:$1820,8,4,S")
    (code,) = card.ask(f"RHX:${first + 1:X}")
    card.tell(f"WX:${first + 2:X},${code}", f"WY:${first + 2:X},$1821")
    assert card.ask("M2->") == ["X:$1821,8,4,S"]
    card.tell(f"WX:${first + 2:X},0")
    assert card.ask("M2->") == ["*"]
    p, q = P_VARIABLES[card.card.dialect.name], Q_VARIABLES[card.card.dialect.name]
    card.tell("P5=1.25", "&2Q3=9", "&1Q3=-4", f"M1->L:${p + 7:X}", "M1=0.5")
    assert card.ask(f"RL:${p + 5:X} RL:${q + 3:X} P7") == ["1.25", "-4", "0.5"]
    card.tell(f"WL:${p + 5:X},3")
    assert card.ask("P5") == ["3"]


def test_the_memory_of_the_program_is_kept_apart(card: Wire) -> None:
    card.tell("WP$10,$ABC,2", "WX$10,1")
    assert card.ask("RHP$10,2 RP$10 RX$10") == ["000ABC 000002", "2748", "1"]


def test_the_clocks_that_drivers_read_at_connect(machine: MachineProfile) -> None:
    """(2 x 6527 + 3) x (0 + 1) x (3 + 1) x 640/9 is the factory's I10 within its clock's tolerance."""
    turbo = wire(machine, TURBO)
    maximum, phase, servo = (int(text) for text in turbo.ask("I7000 I7001 I7002"))
    assert (2 * maximum + 3) * (phase + 1) * (servo + 1) * 640 / 9 == pytest.approx(3_713_707, rel=1e-3)


def test_a_user_buffer_is_at_the_end_of_the_memory_for_buffers(machine: MachineProfile) -> None:
    """The example of the Turbo Software Reference, I4908; of a PMAC, X:$0F42 of its memory map."""
    turbo = wire(machine, TURBO)
    turbo.tell("I9=2")
    assert turbo.ask("I4908") == ["$10800"]
    turbo.tell("DEF UBUF 512")
    assert turbo.ask("I4908") == ["$10600"]
    turbo.tell("I4908=5", "WY:$10600,7")
    assert turbo.ask("I4908 RY:$10600") == ["$10600", "7"]
    assert turbo.refusal("DEFINE UBUFFER 60000") == 6
    turbo.tell("DEFINE UBUFFER 0")
    assert turbo.ask("I4908") == ["$10800"]
    pmac = wire(machine, PMAC)
    pmac.tell("DEFINE UBUFFER 256")
    assert pmac.ask("RHX:$F42") == ["009F00"]
    pmac.tell("DEL UBUF")
    assert pmac.ask("RHX:$F42") == ["00A000"]


# M-variable definitions, the registers that they are suggested for, and words of memory.

PARTS = 96 * 32
"""Of a count, with Ix08 and Ix09 as they are (User Manual: 1/(Ix08 x 32) count)."""


@pytest.fixture
def pmac_card(machine: MachineProfile) -> Wire:
    return wire(machine)


PMAC_DEFINITIONS = {
    "Y:$FFC2,8": "Y:$FFC2,8",
    "Y:$FFC2,8,1": "Y:$FFC2,8",
    "Y:$C0,8,1,S": "Y:$C0,8,1,S",
    "X$C003,0,24,S": "X:$C003,24,S",
    "X:$0,24": "X:$0,24",
    "X:$C003,24,S": "X:$C003,24,S",
    "Y:49155,8,16,S": "Y:$C003,8,16,S",
    "D:$28": "D:$28",
    "L:$82B": "L:$82B",
    "DP:$D201": "DP:$D201",
    "F:$D7FF": "F:$D7FF",
    "TWB:3,4,4,U": "TWB:3,4,4",
    "TWB:4,0,16,S": "TWB:4,0,16,S",
    "TWD:4,0,8,U": "TWD:4,0,8",
    "TWR:2,7": "TWR:2,7",
    "TWR0,1": "TWR:0,1",
    "TWS:40": "TWS:40",
    "*": "*",
}


@pytest.mark.parametrize(("text", "listed"), PMAC_DEFINITIONS.items())
def test_a_definition_is_listed_as_it_means(pmac_card: Wire, text: str, listed: str) -> None:
    pmac_card.tell(f"M5->{text}")
    assert pmac_card.ask("M5->") == [listed]
    pmac_card.tell(f"M5->{listed}")
    assert pmac_card.ask("M5->") == [listed]


@given(
    space=st.sampled_from("XY"),
    address=st.integers(0, 0xFFFF),
    offset=st.integers(0, 23),
    width=st.sampled_from(WIDTHS),
    signed=st.booleans(),
)
def test_every_part_of_a_word_is_read_back_from_its_listing(
    space: str, address: int, offset: int, width: int, signed: bool
) -> None:
    pointer = Pointer(space=space, address=address, offset=min(offset, 24 - width), width=width, signed=signed)
    assert scan_pointer(Scanner(str(pointer)), 0xFFFF) == pointer


def test_definitions_of_a_range(pmac_card: Wire) -> None:
    pmac_card.tell("M1..3->D:$28")
    assert pmac_card.ask("M1..3->") == ["D:$28"] * 3
    pmac_card.tell("M1..1023->*")
    assert pmac_card.ask("M2->") == ["*"]


@pytest.mark.parametrize(
    "text", "Y:$C0 Y:$C0,25 Y:$C0,8,3 Y:$C0,20,8 Y:$10000,0 TWB:256,0,1 TWR:2 TWR:2,8 D: Y:$C0,8,1,Q".split()
)
def test_what_is_no_definition(pmac_card: Wire, text: str) -> None:
    assert pmac_card.refusal(f"M5->{text}") == 3
    assert pmac_card.ask("M5->") == ["*"]


def test_parts_of_one_word(pmac_card: Wire) -> None:
    pmac_card.tell("M1->X:$700,0,24", "M2->X:$700,4,4", "M3->X:$700,8,8,S", "M4->X:$700,23")
    pmac_card.tell("M1=$8081F5")
    assert pmac_card.ask("M2 M3 M4") == ["15", "-127", "1"]
    pmac_card.tell("M3=-1", "M4=0", "M2=17")
    assert pmac_card.ask("M1 RHX:$700") == [str(0x00FF15), "00FF15"]


def test_a_number_that_does_not_fit_rolls_over_and_one_that_is_not_whole_is_rounded(pmac_card: Wire) -> None:
    """Odd numbers are 1 in a single bit (User Manual)."""
    pmac_card.tell("M1->Y:$700,0", "M2->Y:$701,0,24,S", "M1=7")
    assert pmac_card.ask("M1") == ["1"]
    pmac_card.tell("M1=6", "M2=2.5")
    assert pmac_card.ask("M1 M2") == ["0", "3"]
    pmac_card.tell("M2=8388608")
    assert pmac_card.ask("M2") == ["-8388608"]


def test_words_that_are_double_floating_or_in_a_row(pmac_card: Wire) -> None:
    pmac_card.tell("M1->D:$700", "M1=-2")
    assert pmac_card.ask("RHX:$700 RHY:$700 RHD:$700") == ["FFFFFF", "FFFFFE", "FFFFFFFFFFFE"]
    pmac_card.tell("WX:$700,1", "WY:$700,5")
    assert pmac_card.ask("M1") == [str((1 << 24) + 5)]
    pmac_card.tell("M1->L:$700", "M2->DP:$701", "M3->F:$702", "M1=1.25", "M2=-100000", "M3=-0.75")
    assert pmac_card.ask("M1..3 RL:$700") == ["1.25", "-100000", "-0.75", "1.25"]
    assert pmac_card.ask("RHX:$702 RHY:$702") == ["00BF40", "000000"]  # -0.75 is BF400000 in IEEE 754
    pmac_card.tell("WY:$720,$C000,$C004,5,-1")
    assert pmac_card.ask("RHY:$720,4") == ["00C000 00C004 000005 FFFFFF"]
    assert pmac_card.ask("RY$720,3") == ["49152 49156 5"]
    assert pmac_card.ask("RY:1824") == ["49152"]


def test_a_floating_word_is_in_x_and_y(pmac_card: Wire) -> None:
    """1 is a mantissa of 0.5 and an exponent of 1 above 2047 (Turbo User Manual, Computational Features)."""
    pmac_card.tell("M1->L:$3000", "M1=1")
    assert pmac_card.ask("RHX:$3000 RHY:$3000") == ["400000", "000800"]
    pmac_card.tell("M1=1/3", "M2->L:$3001")
    x, y = pmac_card.ask("RX:$3000 RY:$3000")
    pmac_card.tell(f"WX:$3001,{x}", f"WY:$3001,{y}")
    assert pmac_card.ask("M2 M1") == ["0.3333333333"] * 2
    pmac_card.tell("WX:$3001,$7FFFFF", "WY:$3001,$FFFFFF")
    assert float(pmac_card.ask("M2")[0]) > 1e300, "more than any number is the largest"


@pytest.mark.parametrize("line", ["RX:$10000", "RY:$700,0", "WY:$700", "WY:$700,", "WY:$FFFF,1,2"])
def test_what_cannot_be_read_or_written(pmac_card: Wire, line: str) -> None:
    assert pmac_card.refusal(line) == 3


REGISTERS = {
    "commanded": (PMAC, "D:$28", 0x3C),
    "actual": (PMAC, "D:$2B", 0x3C),
    "target": (PMAC, "D:$80B", 0xC0),
    "turbo commanded": (TURBO, "D:$88", 0x80),
    "turbo actual": (TURBO, "D:$8B", 0x80),
}


@pytest.mark.parametrize(("dialect", "place", "stride"), REGISTERS.values(), ids=REGISTERS)
def test_positions_are_in_parts_of_a_count_for_every_motor(
    machine: MachineProfile, dialect: Dialect, place: str, stride: int
) -> None:
    pmac_card = wire(machine, dialect)
    space, address = place.split(":$")
    for motor in (2, 3):
        pmac_card.tell(f"#{motor}J/", f"#{motor}J=12345")
        pmac_card.settle()
        pmac_card.tell(f"M{motor}61->{space}:${int(address, 16) + (motor - 1) * stride:X}")
        assert pmac_card.ask(f"M{motor}61") == [str(12345 * PARTS)]


@pytest.mark.parametrize(("dialect", "actual", "bias"), [(PMAC, "$67", "$8D3"), (TURBO, "$10B", "$14C")])
def test_a_reported_position_is_the_actual_one_and_the_bias(
    machine: MachineProfile, dialect: Dialect, actual: str, bias: str
) -> None:
    """P = (M162 + M164) / (Ix08 x 32), with nothing in the other terms (Quick Reference)."""
    pmac_card = wire(machine, dialect)
    pmac_card.tell("#2J/ #2J=700")
    pmac_card.settle()
    pmac_card.tell("Y=-20", f"M262->D:{actual} M264->D:{bias}")
    values = [float(text) for text in pmac_card.ask("M262 M264 #2P")]
    assert (values[0] + values[1]) / PARTS == values[2]
    assert values[1] != 0


def test_registers_of_position_velocity_and_jogs(pmac_card: Wire) -> None:
    pmac_card.tell("#2J/ #2J=-1")
    pmac_card.settle()
    assert pmac_card.ask("RHD:$64 RHX:$64 RHY:$64") == [
        f"{(1 << 48) - PARTS:012X}",
        "FFFFFF",
        f"{(1 << 24) - PARTS:06X}",
    ]
    pmac_card.tell("M272->L:$8EB M272=4321 #2J/ J=*")
    pmac_card.settle()
    assert pmac_card.ask("#2P M272") == ["4321", "4321"]
    pmac_card.tell("#2J/ #2HM M273->Y:$8D5,0,24,S")
    pmac_card.settle()
    spindle = pmac_card.card.motors[2]
    assert pmac_card.ask("M273") == [str(round(spindle.home_capture))]


def test_the_velocity_register_is_in_parts_of_a_count_a_cycle(pmac_card: Wire) -> None:
    """20 counts/ms (Ix22) in a servo cycle of 443 us."""
    pmac_card.tell("I322=20 #3J/ #3J+ M366->X:$AB,0,24,S")
    pmac_card.sim.wait(2.0)
    moved = float(pmac_card.ask("M366")[0]) / PARTS
    assert moved == pytest.approx(20 * pmac_card.card.servo_period_ms, abs=1)


@pytest.mark.parametrize(("dialect", "first", "second"), [(PMAC, "X:$79", "Y:$8D4"), (TURBO, "X:$130", "Y:$140")])
def test_a_motor_has_its_status_words(machine: MachineProfile, dialect: Dialect, first: str, second: str) -> None:
    pmac_card = wire(machine, dialect)
    pmac_card.tell("#2J/")
    pmac_card.sim.wait(0.1)
    assert "".join(pmac_card.ask(f"RH{first} RH{second}")) == pmac_card.ask("#2?")[0]


@pytest.mark.parametrize(
    ("dialect", "places"), [(PMAC, ("X:$818", "Y:$817")), (TURBO, ("X:$2040", "Y:$203F", "Y:$2040"))]
)
def test_a_system_has_its_status_words(machine: MachineProfile, dialect: Dialect, places: tuple[str, ...]) -> None:
    pmac_card = wire(machine, dialect)
    assert "".join(pmac_card.ask(" ".join(f"RH{place}" for place in places))) == pmac_card.ask("&1??")[0]


def test_a_status_bit_is_read_and_what_is_written_to_it_is_lost(pmac_card: Wire) -> None:
    """Amplifier enabled, Y:$814 bit 14, and closed loop, X:$3D bit 18."""
    pmac_card.tell("M139->Y:$814,14 M138->X:$3D,18,1")
    assert pmac_card.ask("M139 M138") == ["0", "1"]
    pmac_card.tell("#1J/")
    assert pmac_card.ask("M139 M138") == ["1", "0"]
    before = pmac_card.ask("#1?")
    pmac_card.tell("M1->X:$3D,0,24", "M1=$FFFFFF", "WY:$814,$FFFFFF")
    assert pmac_card.ask("#1?") == before


def test_a_program_waits_for_a_register(pmac_card: Wire) -> None:
    """M266 is the actual velocity; the program sees the spindle run."""
    pmac_card.tell("M262->D:$67", "#1J/ #2J/ #3J/", "OPEN PROG1 CLEAR", "P1=M262", "X10", "P2=M262/3072", "CLOSE")
    pmac_card.tell("#2J=500")
    pmac_card.settle()
    pmac_card.tell("&1B1R")
    pmac_card.settle()
    assert pmac_card.ask("P1 P2") == [str(500 * PARTS), "500"]


def test_settings_are_nowhere_in_memory(pmac_card: Wire) -> None:
    before = pmac_card.ask("I0..199")
    pmac_card.tell(*(f"WX:${address:X}" + ",1" * 64 for address in range(0, 0x1000, 64)))
    assert pmac_card.ask("I0..199") == before
