"""Status words of motors, coordinate systems and the whole card, as tables of named bits.

One table serves both sides: the simulator encodes with it and the client decodes with it. Words are 24 bits,
sent as hexadecimal digits, most significant first (PMAC Software Reference, `?`, `??`, `???`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

BITS_PER_WORD = 24

BitTable = Mapping[str, tuple[int, int]]
"""Name of a bit to (word counted from 1, bit)."""

MOTOR_BITS: BitTable = {
    "activated": (1, 23),
    "negative_limit": (1, 22),
    "positive_limit": (1, 21),
    "following_enabled": (1, 20),
    "open_loop": (1, 18),
    "move_timer_active": (1, 17),
    "integration_mode": (1, 16),
    "dwell": (1, 15),
    "desired_velocity_zero": (1, 13),
    "abort_deceleration": (1, 12),
    "home_search": (1, 10),
    "assigned": (2, 23),
    "amplifier_enabled": (2, 14),
    "stopped_on_limit": (2, 11),
    "home_complete": (2, 10),
    "amplifier_fault": (2, 3),
    "fatal_following_error": (2, 2),
    "warning_following_error": (2, 1),
    "in_position": (2, 0),
}

SYSTEM_BITS: BitTable = {
    "z_feedrate": (1, 23),
    "z_incremental": (1, 22),
    "y_feedrate": (1, 21),
    "y_incremental": (1, 20),
    "x_feedrate": (1, 19),
    "x_incremental": (1, 18),
    "by_move_time": (1, 3),
    "continuous_motion": (1, 2),
    "single_step": (1, 1),
    "running_program": (1, 0),
    "runtime_error": (2, 22),
    "amplifier_fault": (2, 20),
    "fatal_following_error": (2, 19),
    "warning_following_error": (2, 18),
    "in_position": (2, 17),
    "pvt_or_spline": (2, 4),
    "rapid": (2, 1),
}

GLOBAL_BITS: BitTable = {
    "this_card_addressed": (1, 0),
    "servo_active": (1, 21),
    "motion_buffer_open": (2, 19),
    "rotary_open": (2, 18),
    "plc_buffer_open": (2, 17),
}


def encode(names: Iterable[str], table: BitTable, extra: tuple[int, ...] = (0, 0)) -> str:
    """Return the hexadecimal digits of the words with the named bits set; `extra` are bits set otherwise."""
    words = list(extra)
    for name in names:
        word, bit = table[name]
        words[word - 1] |= 1 << bit
    return "".join(f"{word:06X}" for word in words)


def decode(digits: str, table: BitTable) -> frozenset[str]:
    """Return the names of the bits that are set.

    Raises:
        ValueError: not hexadecimal, or too short for the table.
    """
    per_word = BITS_PER_WORD // 4
    words = [int(digits[start : start + per_word], 16) for start in range(0, len(digits), per_word)]
    needed = max(word for word, _ in table.values())
    if len(words) < needed or len(digits) % per_word:
        raise ValueError(f"status of {len(digits)} digits, {needed * per_word} are needed")
    return frozenset(name for name, (word, bit) in table.items() if words[word - 1] >> bit & 1)
