"""Status words and forms of answers, as the references of both families list them."""

from __future__ import annotations

import re

import pytest

from drivers.pmac.dialect import PMAC, TURBO
from drivers.pmac.status import BitTable, decode, digits_of, pack
from profiles.machine import MachineProfile
from tests.drivers.conftest import Bench
from tests.drivers.wire_card import Wire, wire

ASSIGNED, AMPLIFIER, HOMED, TRIGGER, FATAL, WARNING, ARRIVED = 23, 14, 10, 7, 2, 1, 0


def bits(word: str) -> set[int]:
    return {bit for bit in range(24) if int(word, 16) >> bit & 1}


def words(bench: Bench, line: str) -> tuple[set[int], set[int]]:
    reply = bench.ask(line)
    assert len(reply) == 12
    assert reply == reply.upper()
    return bits(reply[:6]), bits(reply[6:])


def test_a_motor_of_no_coordinate_system_and_one_of_the_third(bench: Bench) -> None:
    bench.client.request("#3->0")
    assert words(bench, "#3?")[1] == set()
    bench.client.request("&3 #3->Z")
    assert words(bench, "#3?")[1] == {ASSIGNED, 21}  # number - 1 in bits 22 to 20


@pytest.mark.parametrize("table", [PMAC.motor_bits, PMAC.system_bits, PMAC.global_bits])
def test_every_bit_is_one_bit_and_survives_the_way_to_the_host(table: dict[str, tuple[int, int]]) -> None:
    assert len(set(table.values())) == len(table)
    for name in table:
        assert decode(digits_of(pack({name: True}, table)), table) == {name}
    assert decode(digits_of(pack(dict.fromkeys(table, True), table)), table) == set(table)


@pytest.mark.parametrize("digits", ["", "81200080440", "812000", "81200080440G", "8120008044010"])
def test_what_is_no_status_is_refused(digits: str) -> None:
    with pytest.raises(ValueError, match=r".*"):
        decode(digits, PMAC.motor_bits)


def test_a_reset_keeps_the_settings_of_the_machine_and_forgets_where_it_stands(closed: Bench) -> None:
    closed.lathe.home()
    closed.program("INC", "X5", "RETURN")
    closed.client.request("#1J=3000")
    closed.settle()
    closed.client.request("I116=3 #1->7X")
    assert closed.number("#1P") == pytest.approx(3000, abs=10)
    closed.raw("$$$\r")
    closed.lathe.connect()
    assert closed.number("I116") == 500
    assert closed.ask("#1->") == "X"
    assert closed.client.request("LIST PROG 1") == ("INC", "X5", "RET")
    snapshot = closed.lathe.snapshot()
    assert not snapshot.loops_closed
    assert not snapshot.homed
    assert closed.lathe.verify() == ()
    assert closed.client.numbers("#1P", "#2P", "#3P") == pytest.approx((0, 0, 0), abs=20)
    closed.client.request("#1HM")
    closed.sim.wait(2.0)
    true_position = closed.sim.controller.motors[1]
    assert true_position.axis.origin == pytest.approx(0, abs=1), "the iron stood where it was"


def test_a_factory_reset_leaves_factory_settings_no_axes_and_no_programs(closed: Bench) -> None:
    closed.program("X5")
    closed.raw("$$$***\r")
    closed.lathe.connect()
    factory = {"I10": 3713707, "I116": 32, "I117": 0.015625, "I115": 0.25, "I130": 2000, "I169": 20480, "I188": 50}
    assert closed.client.numbers(*factory) == tuple(factory.values())
    assert [closed.ask(f"#{motor}->") for motor in (1, 2, 3)] == ["0", "0", "0"]
    assert closed.raw("LIST PROG 1\r") == b"\x07ERR003\r"
    assert any(problem.key == "I116" for problem in closed.lathe.verify())


# Every bit of every status word, where the Software References list it, and the words that they print.
#
# A dash stands for a bit that no table names: it is reserved, the firmware's own, or part of a number.

AXES = " ".join(f"{axis}_feedrate {axis}_incremental" for axis in "zyxwvucba")
SYSTEM_1 = (
    f"{AXES} radius_incremental continuous_request by_move_time continuous_motion single_step running_program"
)
SYSTEM_2 = """runtime_error {} amplifier_fault fatal_following_error warning_following_error in_position
    rotary_request delayed_calculation end_of_block_stop synchronous_assignment dwell_buffered - - -
    pre_jog segmented_move - - pvt_or_spline - - rapid circle_or_spline"""

FAULTS = "trigger_move integrated_fatal_error i2t_fault backlash_direction amplifier_fault"
ERRORS = "fatal_following_error warning_following_error in_position"
MOTION = """integration_mode dwell data_block_error desired_velocity_zero abort_deceleration block_request
    home_search"""

TABLES: dict[str, tuple[BitTable, tuple[str, ...]]] = {
    "pmac motor": (
        PMAC.motor_bits,
        (
            f"""activated negative_limit positive_limit following_enabled phased_motor open_loop move_timer_active
            {MOTION} - - - - - - - - - -""",
            f"""assigned - - - - - - - - amplifier_enabled - - stopped_on_limit home_complete - phasing_error
            {FAULTS} {ERRORS}""",
        ),
    ),
    "turbo motor": (
        TURBO.motor_bits,
        (
            f"""activated negative_limit positive_limit extended_servo amplifier_enabled open_loop
            move_timer_active {MOTION} user_phase user_servo alternate_addressing phased_motor following_offset
            following_enabled error_trigger software_capture alternate_output maximum_rapid_speed""",
            f"""- - - - - - - - assigned - foreground_in_position stopped_on_desired_limit stopped_on_limit
            home_complete phasing_active phasing_error {FAULTS} {ERRORS}""",
        ),
    ),
    "pmac system": (PMAC.system_bits, (SYSTEM_1, "program_hold " + SYSTEM_2.format("circle_radius_error"))),
    "turbo system": (
        TURBO.system_bits,
        (
            SYSTEM_1,
            "lookahead_active " + SYSTEM_2.format("move_in_stack"),
            "- " * 20 + "circle_radius_error resume_error stopped_on_desired_limit position_matching",
        ),
    ),
    "pmac card": (
        PMAC.global_bits,
        (
            """interrupt_active interrupt_overrun servo_active servo_error gathering gather_on_servo
            gather_on_trigger - - compensation_on checksum_error - - - - - - - - - - - all_cards_addressed
            this_card_addressed""",
            "- - - - motion_buffer_open rotary_open plc_buffer_open" + " -" * 17,
        ),
    ),
    "turbo card": (
        TURBO.global_bits,
        (
            """- interrupt_overrun - servo_error gathering - gather_on_trigger - watchdog compensation_on
            checksum_error - dpram_error flash_error interrupt_warning - configuration_error - - -
            phase_clock_missing - all_cards_addressed this_card_addressed""",
            "- - - - motion_buffer_open rotary_open plc_buffer_open - - - - - fixed_buffer_full"
            + " -" * 10
            + " abort_input",
        ),
    ),
}
"""Of each word bit 23 first."""


@pytest.mark.parametrize("title", TABLES)
def test_a_bit_means_what_its_list_says(title: str) -> None:
    table, words = TABLES[title]
    for word, row in enumerate(words, 1):
        for place, name in enumerate(row.split()):
            digits = "".join(f"{1 << 23 - place if each == word else 0:06X}" for each in range(1, len(words) + 1))
            assert decode(digits, table) == ({name} - {"-"}), (word, 23 - place)


@pytest.mark.parametrize("title", TABLES)
def test_each_list_is_of_whole_words_and_leaves_nothing_out(title: str) -> None:
    table, words = TABLES[title]
    assert [len(row.split()) for row in words] == [24] * len(words)
    assert set(table) == {name for row in words for name in row.split()} - {"-"}


EXAMPLES = [
    pytest.param(
        PMAC.motor_bits,
        "812000804401",
        "activated integration_mode desired_velocity_zero assigned amplifier_enabled home_complete in_position",
        id="a motor of a PMAC, as printed",
    ),
    pytest.param(
        TURBO.motor_bits,
        "81200001C401",
        "activated integration_mode desired_velocity_zero assigned home_complete in_position",
        id="a motor of a Turbo, as printed: bit 14 is no longer the amplifier",
    ),
    pytest.param(
        TURBO.motor_bits,
        "850000000000",
        "activated open_loop integration_mode",
        id="a killed motor of a Turbo, as read in the field",
    ),
    pytest.param(
        PMAC.system_bits,
        "A8002A020010",
        "z_feedrate y_feedrate x_feedrate radius_incremental by_move_time single_step in_position pvt_or_spline",
        id="a coordinate system, as printed",
    ),
    pytest.param(
        TURBO.system_bits, "000000020000000000", "in_position", id="an idle system, as clients are tested"
    ),
    pytest.param(
        TURBO.system_bits,
        "000005000010000000",
        "running_program continuous_motion pvt_or_spline",
        id="a running system, as clients are tested",
    ),
]


@pytest.mark.parametrize(("table", "digits", "names"), EXAMPLES)
def test_an_example_is_read_as_it_is_explained(table: BitTable, digits: str, names: str) -> None:
    assert decode(digits, table) == set(names.split())


@pytest.mark.parametrize("place", range(6))
def test_the_first_character_is_the_highest_four_bits_of_the_first_word(place: int) -> None:
    """Character 1 is bits 23 to 20, character 6 bits 3 to 0, character 7 begins the second word."""
    everything = {f"{word}.{bit}": (word, bit) for word in (1, 2) for bit in range(24)}
    lowest = 20 - 4 * place
    for word, before in ((1, 0), (2, 6)):
        digits = ("0" * (before + place) + "F").ljust(12, "0")
        assert decode(digits, everything) == {f"{word}.{bit}" for bit in range(lowest, lowest + 4)}


# What a Turbo answers otherwise than its elder: words of status, identity, ranges and forms of numbers.


@pytest.fixture
def card(machine: MachineProfile) -> Wire:
    return wire(machine, TURBO)


@pytest.fixture
def elder(machine: MachineProfile) -> Wire:
    return wire(machine, PMAC)


def turbo_bits(digits: str) -> list[set[int]]:
    words = [digits[start : start + 6] for start in range(0, len(digits), 6)]
    return [{bit for bit in range(24) if int(word, 16) >> bit & 1} for word in words]


def test_a_motor_is_told_by_its_words_and_the_worked_example(card: Wire) -> None:
    """As read from a controller in the field: activated, open loop, integration mode."""
    card.tell("I2000=1 I2034=1")
    assert card.ask("#20?") == ["850000000000"]
    # 81200001C401 in the Software Reference, whose bit list has moved bit 14 of word 2 to bit 19 of word 1.
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


def test_a_coordinate_system_reports_three_words_and_is_in_position_at_rest(card: Wire) -> None:
    (digits,) = card.ask("&16??")
    assert len(digits) == 18
    assert turbo_bits(digits) == [{23, 21, 19, 5}, set(), set()]
    card.tell("#1J/ #2J/ #3J/")
    card.sim.wait(0.1)
    assert turbo_bits(card.ask("&1??")[0])[1] == {17}


def test_bits_have_their_places_and_conditions_without_one_are_left_out() -> None:
    assert pack({"circle_radius_error": True}, TURBO.system_bits, 3) == (0, 0, 8)
    assert pack({"stopped_on_desired_limit": True, "resume_error": False}, TURBO.system_bits, 3) == (0, 0, 2)
    assert decode("000000" * 2 + "00000F", TURBO.system_bits) == {
        "circle_radius_error",
        "resume_error",
        "stopped_on_desired_limit",
        "position_matching",
    }
    assert pack({"program_hold": True, "running_program": True}, TURBO.system_bits, 3) == (1, 0, 0)
    assert pack({"program_hold": True}, PMAC.system_bits) == (0, 1 << 23)


def test_the_global_status_of_an_idle_card_reports_no_hardware_problem(card: Wire) -> None:
    """Bits 9, 10, 11, 13, 15 and 20 of the first word are taken for one by clients."""
    (digits,) = card.ask("???")
    assert turbo_bits(digits) == [{0}, set()]
    card.tell("OPEN PROG 1")
    assert turbo_bits(card.ask("???")[0])[1] == {19}


@pytest.mark.parametrize("word", ["VERSION", "VER"])
def test_the_version_is_a_number_and_two_blanks(card: Wire, word: str) -> None:
    assert re.fullmatch(rb"^\d+\.\d+\s*\r\x06$", card.raw(f"{word}\r"))


def test_words_of_identity(card: Wire) -> None:
    assert card.ask("TYPE CID CPU") == ["TURBO2, X4", "603382", "DSP56321"]
    assert len(card.ask("DATE VID CHECKSUM CHKS TIME TODAY")) == 6


def test_003_a_word_that_the_family_has_not(elder: Wire) -> None:
    assert elder.refusal("TIME") == elder.refusal("TODAY") == 3
    assert len(elder.ask("VER TYPE DATE CID CPU VID CHKS")) == 7


def test_settings_of_systems_and_addresses_have_their_forms(card: Wire) -> None:
    card.tell("I5187=20 I6688=7", "&1")
    assert card.ask("I5187 I6688") == ["20", "7"]
    assert card.ask("I5190 I6694") == ["1000", "1644"]
    card.tell("I20=$78400 I103=$3501 I5113=10 I124=$840001 I125=$78000")
    assert card.ask("I20 I103 I5113 I124 I125") == ["$78400", "$3501", "10", "$840001", "$78000"]


def test_positions_are_told_in_thirty_seconds_of_a_count(card: Wire) -> None:
    card.card.motors[2].bias = 5797.54
    assert card.ask("#2P") == ["5797.53125"]
    for number, bias in enumerate((0.01, 0.02, -5797.53, 1, 0, 0, 0, 1e6), 1):
        card.card.motors[number].bias = bias
    assert card.raw("\x10") == b"0 0.03125 -5797.53125 1 0 0 0 1000000\r"


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


# How the factory settings of a Turbo are reported: in the form in which a real card reported all 8192 of them.
#
# The numbers below are those of a public read-out of a re-initialised card (firmware 1.94, I9=2) whose answers
# began with `$`; every other answer was decimal.

GLOBAL = (
    *(20, 21, 22, 23, 24, 37, 67, *range(69, 78), *range(90, 100)),
    *(4900, 4901, 4902, 4903, 4904, 4908, *range(5001, 5049), 5050, 5051, *range(5061, 5077), *range(5081, 5097)),
    *(6805, 6806, 6840, 6841, *range(8000, 8192)),
)
OF_A_MOTOR = (2, 3, 4, 5, 10, 24, 25, 42, 43, 55, 81, 82, 83, 84, 91, 95)
OF_A_SYSTEM = (93,)


@pytest.fixture
def turbo_at_factory(machine: MachineProfile) -> Wire:
    made = wire(machine, TURBO)
    made.raw("$$$***\r")
    made.raw("I3=2I6=1I4=0\r")
    return made


def reported(turbo_at_factory: Wire) -> list[str]:
    return [text for first in range(0, 8192, 256) for text in turbo_at_factory.ask(f"I{first}..{first + 255}")]


def test_a_setting_is_reported_in_the_form_of_a_real_card(turbo_at_factory: Wire) -> None:
    wanted = {
        *GLOBAL,
        *(100 * motor + number for motor in range(1, 33) for number in OF_A_MOTOR),
        *(5000 + 100 * system + number for system in range(1, 17) for number in OF_A_SYSTEM),
    }
    assert {number for number, text in enumerate(reported(turbo_at_factory)) if text.startswith("$")} == wanted
    # Public programs take it as it is, and have that many systems and one.
    assert turbo_at_factory.ask("I68") == ["15"]
    assert turbo_at_factory.ask("I9=3 I68 I20") == ["I68=15", "I20=$0"]
    for form in (0, 1):
        turbo_at_factory.tell(f"I9={form}")
        assert not [text for text in reported(turbo_at_factory) if "$" in text]


def test_addresses_of_a_pmac_are_those_that_the_manual_names(machine: MachineProfile) -> None:
    """Software Reference I9: I20 to I44, I47, and those of motors and coordinate systems."""
    turbo_at_factory = wire(machine, PMAC)
    assert turbo_at_factory.ask("I9=2 I20 I44 I47 I48 I105") == ["$0", "$0", "$0", "0", "$73F"]
