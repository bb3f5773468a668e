"""M-variable definitions, the registers that they are suggested for, and words of memory."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.memory import WIDTHS, Pointer, scan_pointer
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire

PARTS = 96 * 32
"""Of a count, with Ix08 and Ix09 as they are (User Manual: 1/(Ix08 x 32) count)."""


@pytest.fixture
def card(machine: MachineProfile) -> Wire:
    return wire(machine)


DEFINITIONS = {
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


@pytest.mark.parametrize(("text", "listed"), DEFINITIONS.items())
def test_a_definition_is_listed_as_it_means(card: Wire, text: str, listed: str) -> None:
    card.tell(f"M5->{text}")
    assert card.ask("M5->") == [listed]
    card.tell(f"M5->{listed}")
    assert card.ask("M5->") == [listed]


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


def test_definitions_of_a_range(card: Wire) -> None:
    card.tell("M1..3->D:$28")
    assert card.ask("M1..3->") == ["D:$28"] * 3
    card.tell("M1..1023->*")
    assert card.ask("M2->") == ["*"]


@pytest.mark.parametrize(
    "text",
    [
        "Y:$C0",
        "Y:$C0,25",
        "Y:$C0,8,3",
        "Y:$C0,20,8",
        "Y:$10000,0",
        "TWB:256,0,1",
        "TWR:2",
        "TWR:2,8",
        "D:",
        "Y:$C0,8,1,Q",
    ],
)
def test_what_is_no_definition(card: Wire, text: str) -> None:
    assert card.refusal(f"M5->{text}") == 3
    assert card.ask("M5->") == ["*"]


def test_parts_of_one_word(card: Wire) -> None:
    card.tell("M1->X:$700,0,24", "M2->X:$700,4,4", "M3->X:$700,8,8,S", "M4->X:$700,23")
    card.tell("M1=$8081F5")
    assert card.ask("M2 M3 M4") == ["15", "-127", "1"]
    card.tell("M3=-1", "M4=0", "M2=17")
    assert card.ask("M1 RHX:$700") == [str(0x00FF15), "00FF15"]


def test_a_number_that_does_not_fit_rolls_over_and_one_that_is_not_whole_is_rounded(card: Wire) -> None:
    """Odd numbers are 1 in a single bit (User Manual)."""
    card.tell("M1->Y:$700,0", "M2->Y:$701,0,24,S", "M1=7")
    assert card.ask("M1") == ["1"]
    card.tell("M1=6", "M2=2.5")
    assert card.ask("M1 M2") == ["0", "3"]
    card.tell("M2=8388608")
    assert card.ask("M2") == ["-8388608"]


def test_a_double_word_is_x_above_y(card: Wire) -> None:
    card.tell("M1->D:$700", "M1=-2")
    assert card.ask("RHX:$700 RHY:$700 RHD:$700") == ["FFFFFF", "FFFFFE", "FFFFFFFFFFFE"]
    card.tell("WX:$700,1", "WY:$700,5")
    assert card.ask("M1") == [str((1 << 24) + 5)]


def test_floating_and_dual_ported_words(card: Wire) -> None:
    card.tell("M1->L:$700", "M2->DP:$701", "M3->F:$702", "M1=1.25", "M2=-100000", "M3=-0.75")
    assert card.ask("M1..3 RL:$700") == ["1.25", "-100000", "-0.75", "1.25"]
    assert card.ask("RHX:$702 RHY:$702") == ["00BF40", "000000"]  # -0.75 is BF400000 in IEEE 754


def test_a_floating_word_is_in_x_and_y(card: Wire) -> None:
    """1 is a mantissa of 0.5 and an exponent of 1 above 2047 (Turbo User Manual, Computational Features)."""
    card.tell("M1->L:$3000", "M1=1")
    assert card.ask("RHX:$3000 RHY:$3000") == ["400000", "000800"]
    card.tell("M1=1/3", "M2->L:$3001")
    x, y = card.ask("RX:$3000 RY:$3000")
    card.tell(f"WX:$3001,{x}", f"WY:$3001,{y}")
    assert card.ask("M2 M1") == ["0.3333333333"] * 2
    card.tell("WX:$3001,$7FFFFF", "WY:$3001,$FFFFFF")
    assert float(card.ask("M2")[0]) > 1e300, "more than any number is the largest"


def test_words_are_read_in_a_row_and_written_in_a_row(card: Wire) -> None:
    card.tell("WY:$720,$C000,$C004,5,-1")
    assert card.ask("RHY:$720,4") == ["00C000 00C004 000005 FFFFFF"]
    assert card.ask("RY$720,3") == ["49152 49156 5"]
    assert card.ask("RY:1824") == ["49152"]


@pytest.mark.parametrize("line", ["RX:$10000", "RY:$700,0", "WY:$700", "WY:$700,", "WY:$FFFF,1,2"])
def test_what_cannot_be_read_or_written(card: Wire, line: str) -> None:
    assert card.refusal(line) == 3


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
    card = wire(machine, dialect)
    space, address = place.split(":$")
    for motor in (2, 3):
        card.tell(f"#{motor}J/", f"#{motor}J=12345")
        card.settle()
        card.tell(f"M{motor}61->{space}:${int(address, 16) + (motor - 1) * stride:X}")
        assert card.ask(f"M{motor}61") == [str(12345 * PARTS)]


@pytest.mark.parametrize(("dialect", "actual", "bias"), [(PMAC, "$67", "$8D3"), (TURBO, "$10B", "$14C")])
def test_a_reported_position_is_the_actual_one_and_the_bias(
    machine: MachineProfile, dialect: Dialect, actual: str, bias: str
) -> None:
    """P = (M162 + M164) / (Ix08 x 32), with nothing in the other terms (Quick Reference)."""
    card = wire(machine, dialect)
    card.tell("#2J/ #2J=700")
    card.settle()
    card.tell("Y=-20", f"M262->D:{actual} M264->D:{bias}")
    values = [float(text) for text in card.ask("M262 M264 #2P")]
    assert (values[0] + values[1]) / PARTS == values[2]
    assert values[1] != 0


def test_the_words_of_a_position_are_those_of_the_double_word(card: Wire) -> None:
    card.tell("#2J/ #2J=-1")
    card.settle()
    assert card.ask("RHD:$64 RHX:$64 RHY:$64") == [
        f"{(1 << 48) - PARTS:012X}",
        "FFFFFF",
        f"{(1 << 24) - PARTS:06X}",
    ]


def test_the_velocity_register_is_in_parts_of_a_count_a_cycle(card: Wire) -> None:
    """20 counts/ms (Ix22) in a servo cycle of 443 us."""
    card.tell("I322=20 #3J/ #3J+ M366->X:$AB,0,24,S")
    card.sim.wait(2.0)
    moved = float(card.ask("M366")[0]) / PARTS
    assert moved == pytest.approx(20 * card.card.servo_period_ms, abs=1)


def test_the_variable_jog_register_is_what_j_star_goes_to(card: Wire) -> None:
    card.tell("M272->L:$8EB M272=4321 #2J/ J=*")
    card.settle()
    assert card.ask("#2P M272") == ["4321", "4321"]


def test_the_home_capture_register(card: Wire) -> None:
    card.tell("#2J/ #2HM M273->Y:$8D5,0,24,S")
    card.settle()
    spindle = card.card.motors[2]
    assert card.ask("M273") == [str(round(spindle.home_capture))]


@pytest.mark.parametrize(("dialect", "first", "second"), [(PMAC, "X:$79", "Y:$8D4"), (TURBO, "X:$130", "Y:$140")])
def test_the_status_words_of_a_motor_are_where_its_family_has_them(
    machine: MachineProfile, dialect: Dialect, first: str, second: str
) -> None:
    card = wire(machine, dialect)
    card.tell("#2J/")
    card.sim.wait(0.1)
    assert "".join(card.ask(f"RH{first} RH{second}")) == card.ask("#2?")[0]


@pytest.mark.parametrize(
    ("dialect", "places"), [(PMAC, ("X:$818", "Y:$817")), (TURBO, ("X:$2040", "Y:$203F", "Y:$2040"))]
)
def test_the_status_words_of_a_system_are_where_its_family_has_them(
    machine: MachineProfile, dialect: Dialect, places: tuple[str, ...]
) -> None:
    card = wire(machine, dialect)
    assert "".join(card.ask(" ".join(f"RH{place}" for place in places))) == card.ask("&1??")[0]


def test_a_status_bit_as_an_m_variable(card: Wire) -> None:
    """Amplifier enabled, Y:$814 bit 14, and closed loop, X:$3D bit 18."""
    card.tell("M139->Y:$814,14 M138->X:$3D,18,1")
    assert card.ask("M139 M138") == ["0", "1"]
    card.tell("#1J/")
    assert card.ask("M139 M138") == ["1", "0"]


def test_what_is_written_to_a_status_word_is_lost(card: Wire) -> None:
    before = card.ask("#1?")
    card.tell("M1->X:$3D,0,24", "M1=$FFFFFF", "WY:$814,$FFFFFF")
    assert card.ask("#1?") == before


def test_a_program_waits_for_a_register(card: Wire) -> None:
    """M266 is the actual velocity; the program sees the spindle run."""
    card.tell("M262->D:$67", "#1J/ #2J/ #3J/", "OPEN PROG1 CLEAR", "P1=M262", "X10", "P2=M262/3072", "CLOSE")
    card.tell("#2J=500")
    card.settle()
    card.tell("&1B1R")
    card.settle()
    assert card.ask("P1 P2") == [str(500 * PARTS), "500"]


def test_settings_are_nowhere_in_memory(card: Wire) -> None:
    before = card.ask("I0..199")
    card.tell(*(f"WX:${address:X}" + ",1" * 64 for address in range(0, 0x1000, 64)))
    assert card.ask("I0..199") == before
