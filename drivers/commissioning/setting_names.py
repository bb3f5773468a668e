"""Names of the I-variables in machine terms, with their quantities and who may write them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum, auto

from drivers.pmac.dialect import Dialect, FamilySetting, SettingScope


class SettingQuantity(StrEnum):
    """The quantity of a setting."""

    NUMBER = auto()
    ADDRESS = auto()
    COUNTS = auto()
    SIXTEENTHS = auto()  # of a count
    SPEED = auto()  # counts/ms
    ACCELERATION = auto()  # counts/ms2
    TIME_MS = auto()
    DAC_BITS = auto()


class Nature(StrEnum):
    """Who may write a setting: the console writes only gains, and only on request."""

    GAIN = auto()
    LIMIT = auto()
    COMMUTATION = auto()
    WIRING = auto()
    MOTION = auto()


@dataclass(frozen=True, slots=True)
class Name:
    """A setting: the key of its words, its quantity and its nature."""

    key: str
    quantity: SettingQuantity = SettingQuantity.NUMBER
    nature: Nature = Nature.MOTION


GAIN_NUMBERS = (30, 31, 32, 33, 34, 35, 36, 37, 38, 39)
"""Ix30 to Ix35 and the notch filter Ix36 to Ix39, which `apply` writes. Ix63 limits the integrator: a limit, so
not included."""

OTHER = "other"  # the key of a setting without a name of its own
_Q, _N = SettingQuantity, Nature

_MOTOR = {
    0: Name("activated", nature=_N.WIRING),
    1: Name("commutation_on", nature=_N.COMMUTATION),
    2: Name("output_address", _Q.ADDRESS, _N.WIRING),
    3: Name("position_address", _Q.ADDRESS, _N.WIRING),
    4: Name("velocity_address", _Q.ADDRESS, _N.WIRING),
    5: Name("master_address", _Q.ADDRESS, _N.WIRING),
    6: Name("following"),
    7: Name("master_gear"),
    8: Name("position_scale", nature=_N.WIRING),
    9: Name("velocity_scale", nature=_N.WIRING),
    10: Name("absolute_address", _Q.ADDRESS, _N.WIRING),
    11: Name("fatal_error", _Q.SIXTEENTHS, _N.LIMIT),
    12: Name("warning_error", _Q.SIXTEENTHS, _N.LIMIT),
    13: Name("positive_limit", _Q.COUNTS, _N.LIMIT),
    14: Name("negative_limit", _Q.COUNTS, _N.LIMIT),
    15: Name("abort_deceleration", _Q.ACCELERATION, _N.LIMIT),
    16: Name("program_speed", _Q.SPEED, _N.LIMIT),
    17: Name("program_acceleration", _Q.ACCELERATION, _N.LIMIT),
    19: Name("jog_acceleration", _Q.ACCELERATION, _N.LIMIT),
    20: Name("jog_ramp", _Q.TIME_MS),
    21: Name("jog_s_curve", _Q.TIME_MS),
    22: Name("jog_speed", _Q.SPEED),
    23: Name("home_speed", _Q.SPEED),
    24: Name("flags", _Q.ADDRESS, _N.LIMIT),
    25: Name("flags", _Q.ADDRESS, _N.LIMIT),
    26: Name("home_offset", _Q.SIXTEENTHS),
    27: Name("rollover", _Q.COUNTS),
    28: Name("in_position_band", _Q.SIXTEENTHS),
    29: Name("output_offset", _Q.DAC_BITS),
    30: Name("proportional_gain", nature=_N.GAIN),
    31: Name("derivative_gain", nature=_N.GAIN),
    32: Name("velocity_feedforward", nature=_N.GAIN),
    33: Name("integral_gain", nature=_N.GAIN),
    34: Name("integration_mode", nature=_N.GAIN),
    35: Name("acceleration_feedforward", nature=_N.GAIN),
    **{number: Name("notch_filter", nature=_N.GAIN) for number in range(36, 40)},
    63: Name("integration_limit", nature=_N.LIMIT),
    67: Name("error_limit", _Q.SIXTEENTHS, _N.LIMIT),
    68: Name("friction_feedforward", _Q.DAC_BITS),
    69: Name("output_limit", _Q.DAC_BITS, _N.LIMIT),
    **{number: Name("commutation", nature=_N.COMMUTATION) for number in (*range(70, 80), 82)},
    80: Name("power_up_mode", nature=_N.COMMUTATION),
    81: Name("phase_address", _Q.ADDRESS, _N.COMMUTATION),
    83: Name("phase_feedback_address", _Q.ADDRESS, _N.COMMUTATION),
}

_SYSTEM = {
    86: Name("other_axes_speed"),
    87: Name("acceleration_time", _Q.TIME_MS),
    88: Name("s_curve_time", _Q.TIME_MS),
    89: Name("feedrate"),
    90: Name("feedrate_time", _Q.TIME_MS),
    92: Name("blending_off"),
    93: Name("time_base_source", _Q.ADDRESS),
    94: Name("time_base_slew"),
    95: Name("hold_slew"),
}

_CARD = {
    5: Name("plc_permission"),
    8: Name("interrupt_period"),
    10: Name("servo_time", nature=_N.WIRING),
    15: Name("trigonometry"),
    51: Name("compensation"),
    52: Name("speed_or_slew", nature=_N.WIRING),
}

_MOVED = {
    FamilySetting.SEGMENT_MS: Name("segment_time", _Q.TIME_MS),
    FamilySetting.JOG_DELAY_MS: Name("jog_delay", _Q.TIME_MS),
    FamilySetting.IN_POSITION_LOOKS: Name("in_position_looks"),
    FamilySetting.RAPID_AT_PROGRAM_SPEED: Name("rapid_speed"),
    FamilySetting.FLAG_MODE: Name("flag_mode", _Q.ADDRESS, _N.LIMIT),
}
_FIRST_SYSTEM_NUMBER = 85


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedSetting:
    """A setting of a controller: its name, and its motor or coordinate system."""

    name: Name
    motor: int = 0
    system: int = 0


def name_setting(index: int, dialect: Dialect) -> NamedSetting:
    """Return the name of an I-variable of a family."""
    setting, owner = dialect.settings.get(index, (None, 0))
    if setting in _MOVED:
        of = dialect.places[setting].scope
        motor, system = (owner if of is scope else 0 for scope in (SettingScope.MOTOR, SettingScope.SYSTEM))
        return NamedSetting(name=_MOVED[setting], motor=motor, system=system)
    block, number = divmod(index, 100)
    if index < 100:
        numbered = {dialect.watchdog.number: "watchdog_time", dialect.system_activation: "timers"}
        return NamedSetting(name=Name(numbered[number]) if number in numbered else _CARD.get(number, Name(OTHER)))
    system = block - dialect.system_offset // 100
    of_system = dialect.system_offset > 0 or number >= _FIRST_SYSTEM_NUMBER
    if of_system and number in _SYSTEM and 1 <= system <= dialect.system_count:
        return NamedSetting(name=_SYSTEM[number], system=system)
    if 1 <= block <= dialect.motor_count:
        return NamedSetting(name=_MOTOR.get(number, Name(OTHER)), motor=block)
    return NamedSetting(name=Name(OTHER))


def keys() -> frozenset[str]:
    """Return the keys of all names, each of which needs a text."""
    tables = (_MOTOR, _SYSTEM, _CARD)
    every = {name.key for table in tables for name in table.values()} | {name.key for name in _MOVED.values()}
    return frozenset(every | {"watchdog_time", "timers", OTHER})
