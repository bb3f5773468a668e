"""The eight-axis Turbo PMAC2: 32 motors and 16 coordinate systems in its variables, 0 to 8191.

Replies and defaults that no source confirms are choices (docs/pmac-emulation.md).
"""

from __future__ import annotations

from drivers.pmac.families.family import (
    ConversionTable,
    Dialect,
    FamilySetting,
    GatherSettings,
    PhaseClock,
    Register,
    SettingPlace,
    SettingScope,
    UserBuffer,
    Watchdog,
)
from drivers.pmac.families.pmac import PMAC, SYSTEM_BITS_SHARED
from drivers.pmac.status import bit_table

_MOTOR_BITS = bit_table(
    {
        (1, 23): (
            "activated negative_limit positive_limit extended_servo amplifier_enabled open_loop "
            "move_timer_active integration_mode dwell data_block_error desired_velocity_zero abort_deceleration "
            "block_request home_search user_phase user_servo alternate_addressing phased_motor following_offset "
            "following_enabled error_trigger software_capture alternate_output maximum_rapid_speed"
        ),
        (2, 15): "assigned",
        (2, 13): (
            "foreground_in_position stopped_on_desired_limit stopped_on_limit home_complete phasing_active "
            "phasing_error trigger_move integrated_fatal_error i2t_fault backlash_direction amplifier_fault "
            "fatal_following_error warning_following_error in_position"
        ),
    }
)

_TIMERS = (11, 12)

_BUFFERS, _BUFFERS_ENDS = 0x6000, (0x10800, 0x40000)  # of the standard and of the extended memory
_OPEN_MEMORY_END = 4908

_CONVERSION_TABLE = ConversionTable(
    first_address=0x3501,
    lines=192,
    channels=(*range(0x78000, 0x78020, 8), *range(0x78100, 0x78120, 8)),
    first_setting=8000,
)

TURBO = Dialect(
    name="turbo",
    type_prefix="TURBO",
    replies={
        "VERSION": "1.947  ",
        "TYPE": "TURBO2, X4",
        "DATE": "05/10/2012",
        "CID": "603382",  # the eight-axis brick: clients that query the number of axes get eight
        "CPU": "DSP56321",
        "VID": "1",
        "CHECKSUM": "5C2A91",
        "TIME": "00:00:00",
        "TODAY": "01/01/2012",
        "IDNUMBER": "0",
        "SID": "0",
    },
    motor_count=32,
    system_count=16,
    highest_index=8191,
    system_offset=5000,
    places={
        FamilySetting.JOG_DELAY_MS: SettingPlace(SettingScope.MOTOR, 92),
        FamilySetting.SEGMENT_MS: SettingPlace(SettingScope.SYSTEM, 13),
        FamilySetting.IN_POSITION_LOOKS: SettingPlace(SettingScope.MOTOR, 88),
        FamilySetting.RAPID_AT_PROGRAM_SPEED: SettingPlace(SettingScope.MOTOR, 90),
        FamilySetting.LEAST_ARC: SettingPlace(SettingScope.SYSTEM, 97),
        FamilySetting.FLAG_MODE: SettingPlace(SettingScope.MOTOR, 24),
    },
    global_defaults={
        3: 1,
        4: 1,
        5: 0,
        6: 3,
        8: 2,
        9: 2,
        10: 3_713_707,
        40: 0,
        60: 15,
        61: 8,
        68: 15,
        # The phase clock of the first MACRO and servo chips, 9 kHz, and the servo clock, a quarter of it.
        **{6800: 6527, 6802: 3, 7000: 6527, 7002: 3},
        _OPEN_MEMORY_END: _BUFFERS_ENDS[0],
        5049: 1,
        # The register of `%`, one for each coordinate system.
        **{5093 + 100 * system: 0x1F00 + 0x100 * system for system in range(1, 17)},
        **dict(enumerate(_CONVERSION_TABLE.setup, 8000)),
    },
    motor_defaults={**PMAC.motor_defaults, 5: 0x35C0, 24: 0x40001, 67: 4_194_304, 87: 64, 90: 0, 92: 10},
    system_defaults=PMAC.system_defaults,
    global_ranges={
        **{number: PMAC.global_ranges[number] for number in (1, 3, 4, 5, 6, 9, 10, 15, 51, 62, 63, 64)},
        40: (0, 2**16),
        5049: (0, 2**23),
        **dict.fromkeys((*range(5001, 5049), 5050, 5051, *range(8000, 8192)), (0, 2**24)),
        42: (0, 2),
        68: (0, 16),
    },
    motor_ranges={**PMAC.motor_ranges, 6: (0, 4), 90: (0, 2)},
    motor_fractions=PMAC.motor_fractions,
    system_ranges={**PMAC.system_ranges, **dict.fromkeys(_TIMERS, (-(2**23), 2**24)), 13: (0, 256)},
    motor_bits=_MOTOR_BITS,
    system_bits={
        **SYSTEM_BITS_SHARED,
        **bit_table(
            {
                (2, 23): "lookahead_active",
                (2, 21): "move_in_stack",
                (3, 3): "circle_radius_error resume_error stopped_on_desired_limit position_matching",
            }
        ),
    },
    system_words=3,
    segment_time_switch=42,
    segment_step_ms=1 / 4096,
    longest_segment_ms=4096.0,
    other_axes_speed=86,
    variable_addresses={"P": 0x6000, "Q": 0x8000},
    definitions_address=0x4000,
    user_buffer=UserBuffer(_BUFFERS, _BUFFERS_ENDS, setting=_OPEN_MEMORY_END),
    phase_clock=PhaseClock(divider=7002, counts_per_ms=120_000.0),  # half the cycles of a CPU of 240 MHz
    watchdog=Watchdog(count=4095, number=40),
    system_activation=68,
    velocity_average=(60, 61),
    kinematics=50,
    timer_numbers=_TIMERS,
    global_bits=bit_table(
        {
            (1, 22): "interrupt_overrun",
            (1, 20): "servo_error gathering",
            (1, 17): "gather_on_trigger",
            (1, 15): "watchdog compensation_on checksum_error",
            (1, 11): "dpram_error flash_error interrupt_warning",
            (1, 7): "configuration_error",
            (1, 3): "phase_clock_missing",
            (1, 1): "all_cards_addressed this_card_addressed",
            (2, 19): "motion_buffer_open rotary_open plc_buffer_open",
            (2, 11): "fixed_buffer_full",
            (2, 0): "abort_input",
        }
    ),
    axis_codes={"A": 1, "B": 2, "C": 3, **dict.fromkeys("UVW", 4), **dict.fromkeys("XYZ", 7)},
    position_step=1 / 32,
    highest_address=0xFFFFFF,
    conversion_table=_CONVERSION_TABLE,
    gathering=GatherSettings(period=5049, masks=(5050, 5051), first_source=5001),
    offset_following=(6, 1),
    global_addresses=(
        *range(20, 25),
        37,
        67,
        *range(69, 78),
        *range(90, 100),
        *range(4900, 4905),
        _OPEN_MEMORY_END,
        *range(5001, 5049),
        5050,
        5051,
        *range(5061, 5077),
        *range(5081, 5097),
        *(6805, 6806, 6840, 6841),
        *range(8000, 8192),
    ),
    motor_addresses=(2, 3, 4, 5, 10, 24, 25, 42, 43, 55, 81, 82, 83, 84, 91, 95),
    system_addresses=(93,),
    registers={
        "commanded": Register("D", 0x88, 0x80),
        "actual": Register("D", 0x8B, 0x80),
        "velocity": Register("X", 0x9D, 0x80),
        "output": Register("X", 0xBF, 0x80),
        "master": Register("D", 0x8D, 0x80),
        "compensation": Register("D", 0x90, 0x80),
        "following_error": Register("D", 0x91, 0x80),
        "target": Register("D", 0xC7, 0x80),
        "bias": Register("D", 0xCC, 0x80),
        "variable_jog": Register("L", 0xD7, 0x80),
        "home_capture": Register("Y", 0xCE, 0x80),
        "filtered_velocity": Register("D", 0xEF, 0x80),
        "motor_status_1": Register("X", 0xB0, 0x80),
        "motor_status_2": Register("Y", 0xC0, 0x80),
        "system_status_1": Register("X", 0x2040, 0x100, SettingScope.SYSTEM),
        "system_status_2": Register("Y", 0x203F, 0x100, SettingScope.SYSTEM),
        "system_status_3": Register("Y", 0x2040, 0x100, SettingScope.SYSTEM),
        "global_status_1": Register("X", 0x6, scope=SettingScope.GLOBAL),
        "global_status_2": Register("Y", 0x6, scope=SettingScope.GLOBAL),
        "phase_period": Register("X", 0xFFFF8C, scope=SettingScope.GLOBAL),
    },
)
