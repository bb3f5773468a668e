"""What a Turbo answers otherwise than its elder: words of status, identity, ranges and forms of numbers."""

from __future__ import annotations

import re

import pytest

from drivers.pmac.dialect import PMAC, TURBO
from drivers.pmac.status import decode, pack
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire


@pytest.fixture
def card(machine: MachineProfile) -> Wire:
    return wire(machine, TURBO)


@pytest.fixture
def elder(machine: MachineProfile) -> Wire:
    return wire(machine, PMAC)


def bits(digits: str) -> list[set[int]]:
    words = [digits[start : start + 6] for start in range(0, len(digits), 6)]
    return [{bit for bit in range(24) if int(word, 16) >> bit & 1} for word in words]


def test_a_motor_that_is_activated_and_killed(card: Wire) -> None:
    """As read from a controller in the field: activated, open loop, integration mode."""
    card.tell("I2000=1 I2034=1")
    assert card.ask("#20?") == ["850000000000"]


def test_the_worked_example_with_the_amplifier_where_the_bit_list_has_it(card: Wire) -> None:
    """81200001C401 in the Software Reference, whose bit list has moved bit 14 of word 2 to bit 19 of word 1."""
    card.tell("#2->0", "#2->A", "I234=1 #2J/ #2HM")
    card.settle()
    card.sim.wait(0.1)
    assert card.ask("#2?") == ["892000018401"]


@pytest.mark.parametrize(
    ("axis", "code"), [("A", 1), ("B", 2), ("C", 3), ("U", 4), ("V", 4), ("W", 4), ("X", 7), ("Y", 7), ("Z", 7)]
)
def test_the_axis_of_a_motor_is_told_by_its_code(card: Wire, axis: str, code: int) -> None:
    card.tell("#2->0", f"#2->{axis}")
    second = int(card.ask("#2?")[0][6:], 16)
    assert second >> 16 & 0xF == code
    assert second >> 15 & 1
    card.tell("#2->0")
    assert int(card.ask("#2?")[0][6:], 16) == 0


@pytest.mark.parametrize("system", [1, 2, 9, 16])
def test_the_coordinate_system_of_a_motor_is_its_number_less_one_in_four_bits(card: Wire, system: int) -> None:
    card.tell("#2->0", f"&{system} #2->X")
    assert int(card.ask("#2?")[0][6:], 16) >> 20 == system - 1


def test_a_coordinate_system_reports_three_words(card: Wire) -> None:
    (digits,) = card.ask("&16??")
    assert len(digits) == 18
    assert bits(digits) == [{23, 21, 19, 5}, set(), set()]


def test_a_coordinate_system_at_rest_is_in_position(card: Wire) -> None:
    card.tell("#1J/ #2J/ #3J/")
    card.sim.wait(0.1)
    assert bits(card.ask("&1??")[0])[1] == {17}


def test_the_bits_of_the_third_word_have_their_places() -> None:
    assert pack({"circle_radius_error": True}, TURBO.system_bits, 3) == (0, 0, 8)
    assert pack({"stopped_on_desired_limit": True, "resume_error": False}, TURBO.system_bits, 3) == (0, 0, 2)
    assert decode("000000" * 2 + "00000F", TURBO.system_bits) == {
        "circle_radius_error",
        "resume_error",
        "stopped_on_desired_limit",
        "position_matching",
    }


def test_a_condition_without_a_bit_is_left_out() -> None:
    assert pack({"program_hold": True, "running_program": True}, TURBO.system_bits, 3) == (1, 0, 0)
    assert pack({"program_hold": True}, PMAC.system_bits) == (0, 1 << 23)


def test_the_global_status_of_an_idle_card_reports_no_hardware_problem(card: Wire) -> None:
    """Bits 9, 10, 11, 13, 15 and 20 of the first word are taken for one by clients."""
    (digits,) = card.ask("???")
    assert bits(digits) == [{0}, set()]
    card.tell("OPEN PROG 1")
    assert bits(card.ask("???")[0])[1] == {19}


@pytest.mark.parametrize("word", ["VERSION", "VER"])
def test_the_version_is_a_number_and_two_blanks(card: Wire, word: str) -> None:
    assert re.fullmatch(rb"^\d+\.\d+\s*\r\x06$", card.raw(f"{word}\r"))


def test_words_of_identity(card: Wire) -> None:
    assert card.ask("TYPE CID CPU") == ["TURBO2, X4", "603382", "DSP56321"]
    assert len(card.ask("DATE VID CHECKSUM CHKS TIME TODAY")) == 6


def test_003_a_word_that_the_family_has_not(elder: Wire) -> None:
    assert elder.refusal("TIME") == elder.refusal("TODAY") == 3
    assert len(elder.ask("VER TYPE DATE CID CPU VID CHKS")) == 7


def test_settings_of_systems_have_their_own_thousands(card: Wire) -> None:
    card.tell("I5187=20 I6688=7", "&1")
    assert card.ask("I5187 I6688") == ["20", "7"]
    assert card.ask("I5190 I6694") == ["1000", "1644"]


def test_addresses_are_hexadecimal_where_the_family_has_them(card: Wire) -> None:
    card.tell("I20=$78400 I103=$3501 I5113=10 I124=$840001 I125=$78000")
    assert card.ask("I20 I103 I5113 I124 I125") == ["$78400", "$3501", "10", "$840001", "$78000"]


def test_positions_are_told_in_thirty_seconds_of_a_count(card: Wire) -> None:
    card.card.motors[2].bias = 5797.54
    assert card.ask("#2P") == ["5797.53125"]


def test_thirty_two_motors_and_sixteen_systems(card: Wire) -> None:
    assert card.ask("#32 &16 # &") == ["32", "16"]
    assert [card.refusal(line) for line in ("#33", "&17", "#32J+")] == [3, 3, 13]
    card.tell("I3200=1 #32->X", "I3208=96 #32J/ #32J=500")
    card.settle()
    assert card.ask("#32P") == ["500"]


def test_i58_leaves_the_handshake_alone(card: Wire) -> None:
    card.tell("P1=25")
    card.raw("I58=1 I3=1\r")
    assert card.raw("P1\r") == b"\n25\r\n"


def test_eight_positions_are_told_with_spaces_in_thirty_seconds_of_a_count(card: Wire) -> None:
    for number, bias in enumerate((0.01, 0.02, -5797.53, 1, 0, 0, 0, 1e6), 1):
        card.card.motors[number].bias = bias
    assert card.raw("\x10") == b"0 0.03125 -5797.53125 1 0 0 0 1000000\r"


def test_eight_positions_of_its_elder_are_told_in_tenths(elder: Wire) -> None:
    for number, bias in enumerate((0.04, 0.06, -5797.53, 1, 0, 0, 0, 1e6), 1):
        elder.card.motors[number].bias = bias
    assert elder.raw("\x10") == b"0 0.1 -5797.5 1 0 0 0 1000000\r"


def test_the_time_between_phase_interrupts_is_told_to_who_divides_by_it(card: Wire) -> None:
    """By factory settings the phase clock is 9.035 kHz (Turbo Software Reference, I7000)."""
    card.tell("M70->X:$FFFF8C,0,24", "M70=1")
    (told,) = card.ask("M70")
    assert float(told) == pytest.approx(120_000 / 9.035, rel=0.001)
    card.tell("I7002=0")
    assert float(card.ask("M70")[0]) == pytest.approx(4 * float(told), abs=3)
