"""Every bit of every status word, where the Software References list it, and the words that they print.

A dash stands for a bit that no table names: it is reserved, the firmware's own, or part of a number.
"""

from __future__ import annotations

import pytest

from drivers.pmac.dialect import PMAC, TURBO
from drivers.pmac.status import BitTable, decode

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
