"""The non-Turbo PMAC, the controller of the paper: 8 motors, 8 coordinate systems, variables 0 to 1023.

Replies and defaults that no source confirms are choices (docs/pmac-emulation.md).
"""

from __future__ import annotations

from drivers.pmac.families.family import (
    BufferDirectory,
    ConversionTable,
    Dialect,
    FamilySetting,
    GatherSettings,
    Register,
    SettingPlace,
    SettingScope,
    UserBuffer,
    Watchdog,
)
from drivers.pmac.status import BitTable, bit_table

_MOTOR_BITS = bit_table(
    {
        (1, 23): (
            "activated negative_limit positive_limit following_enabled phased_motor open_loop move_timer_active "
            "integration_mode dwell data_block_error desired_velocity_zero abort_deceleration block_request "
            "home_search"
        ),
        (2, 23): "assigned",
        (2, 14): "amplifier_enabled",
        (2, 11): "stopped_on_limit home_complete",
        (2, 8): (
            "phasing_error trigger_move integrated_fatal_error i2t_fault backlash_direction amplifier_fault "
            "fatal_following_error warning_following_error in_position"
        ),
    }
)

SYSTEM_BITS_SHARED: BitTable = {
    **{f"{axis}_feedrate": (1, 23 - 2 * place) for place, axis in enumerate("zyxwvucba")},
    **{f"{axis}_incremental": (1, 22 - 2 * place) for place, axis in enumerate("zyxwvucba")},
    **bit_table(
        {
            (1, 5): (
                "radius_incremental continuous_request by_move_time continuous_motion single_step running_program"
            ),
            (2, 22): "runtime_error",
            (2, 20): (
                "amplifier_fault fatal_following_error warning_following_error in_position rotary_request "
                "delayed_calculation end_of_block_stop synchronous_assignment dwell_buffered"
            ),
            (2, 8): "pre_jog segmented_move",
            (2, 4): "pvt_or_spline",
            (2, 1): "rapid circle_or_spline",
        }
    ),
}
"""Bits that both families report in the same place."""

PMAC = Dialect(
    name="pmac",
    type_prefix="PMAC",
    replies={
        "VERSION": "1.17",
        "TYPE": "PMAC1, X1",
        "DATE": "07/14/2000",
        "CID": "602191",
        "CPU": "DSP56002",
        "VID": "1",
        "CHECKSUM": "4A6B7C",
    },
    motor_count=8,
    system_count=8,
    highest_index=1023,
    system_offset=0,
    places={
        FamilySetting.JOG_DELAY_MS: SettingPlace(SettingScope.GLOBAL, 12),
        FamilySetting.SEGMENT_MS: SettingPlace(SettingScope.GLOBAL, 13),
        FamilySetting.IN_POSITION_LOOKS: SettingPlace(SettingScope.GLOBAL, 7),
        FamilySetting.RAPID_AT_PROGRAM_SPEED: SettingPlace(SettingScope.GLOBAL, 50),
        FamilySetting.LEAST_ARC: SettingPlace(SettingScope.GLOBAL, 90),
        FamilySetting.FLAG_MODE: SettingPlace(SettingScope.MOTOR, 25),
    },
    global_defaults={3: 1, 5: 0, 6: 3, 8: 2, 9: 2, 10: 3_713_707, 12: 10},
    motor_defaults={
        5: 0x73F,
        **dict.fromkeys((7, 8, 9), 96),
        11: 32_000,
        12: 16_000,
        15: 0.25,
        **dict.fromkeys((16, 22, 23), 32),
        **dict.fromkeys((17, 19), 0.015625),
        20: 0,
        21: 50,
        28: 160,
        30: 2000,
        **dict.fromkeys((31, 32), 1280),
        34: 1,
        63: 4_194_304,
        69: 20_480,
    },
    system_defaults={87: 0, 88: 50, 89: 1000, 90: 1000, 94: 1644, 95: 1644},
    global_ranges={
        **dict.fromkeys((1, 3, 4, 5, 6, 9), (0, 4)),
        **dict.fromkeys((10, 19), (0, 2**23)),
        **dict.fromkeys(range(20, 45), (0, 2**24)),
        **dict.fromkeys((15, 50, 51, 58, 62, 63, 64), (0, 2)),
    },
    motor_ranges={
        **dict.fromkeys((0, 6, 34), (0, 2)),
        5: (0, 2**24),
        7: (-(2**23), 2**24),
        **dict.fromkeys((8, 9), (0, 2**23)),
        80: (0, 4),
    },
    motor_fractions=dict.fromkeys((36, 37, 38, 39), 22),
    system_ranges={92: (0, 2), 93: (0, 2**24), 94: (0, 2**23), 95: (0, 2**23)},
    motor_bits=_MOTOR_BITS,
    system_bits={**SYSTEM_BITS_SHARED, "program_hold": (2, 23), "circle_radius_error": (2, 21)},
    system_words=2,
    global_bits=bit_table(
        {
            (1, 23): (
                "interrupt_active interrupt_overrun servo_active servo_error gathering gather_on_servo "
                "gather_on_trigger"
            ),
            (1, 14): "compensation_on checksum_error",
            (1, 1): "all_cards_addressed this_card_addressed",
            (2, 19): "motion_buffer_open rotary_open plc_buffer_open",
        }
    ),
    axis_codes={},
    position_step=0.1,
    highest_address=0xFFFF,
    conversion_table=ConversionTable(
        first_address=0x720,
        lines=32,
        channels=tuple(range(0xC000, 0xC020, 4)),
        factory=(0x400723, 1024),  # a time base from the fourth encoder
    ),
    gathering=GatherSettings(period=19, masks=(20,), first_source=21),
    offset_following=(5, 16),
    no_line_feeds_switch=58,
    global_addresses=(*range(20, 45), 47),
    motor_addresses=(2, 3, 4, 5, 10, 25, 81, 83),
    system_addresses=(93,),
    variable_addresses={"P": 0x1000, "Q": 0x1400},
    definitions_address=0xBC00,
    buffer_directory=BufferDirectory(range(0xE00, 0xF00), range(0xF00, 0xF20), 0x1800),
    user_buffer=UserBuffer(0x1800, (0xA000,), x_address=0xF42),
    watchdog=Watchdog(count=511, of_interrupts=True),
    timer_words=(("X", 0x700), ("Y", 0x700), ("X", 0x701), ("Y", 0x701)),
    registers={
        "commanded": Register("D", 0x28, 0x3C),
        "actual": Register("D", 0x2B, 0x3C),
        "velocity": Register("X", 0x33, 0x3C),
        "output": Register("X", 0x45, 0x3C),
        "master": Register("D", 0x2D, 0x3C),
        "compensation": Register("D", 0x46, 0x3C),
        "target": Register("D", 0x80B, 0xC0),
        "bias": Register("D", 0x813, 0xC0),
        "variable_jog": Register("L", 0x82B, 0xC0),
        "home_capture": Register("Y", 0x815, 0xC0),
        "filtered_velocity": Register("Y", 0x82A, 0xC0),
        "following_error": Register("D", 0x840, 0xC0),
        "motor_status_1": Register("X", 0x3D, 0x3C),
        "motor_status_2": Register("Y", 0x814, 0xC0),
        "system_status_1": Register("X", 0x818, 0xC0, SettingScope.SYSTEM),
        "system_status_2": Register("Y", 0x817, 0xC0, SettingScope.SYSTEM),
        "global_status_1": Register("X", 0x3, scope=SettingScope.GLOBAL),
        "global_status_2": Register("Y", 0x3, scope=SettingScope.GLOBAL),
    },
)
