"""The keys of a machine profile with their limits, section by section, and the controller's settings.

A spindle on an inverter has its own keys and may not have the others: the controller reads it and never moves it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any

from profiles.fields import Field, FieldType, fault, spell_toml
from profiles.problem import Problem

FAMILIES = ("pmac", "turbo")
SPINDLE_DRIVES = ("servo", "inverter")
LOSS_POLICIES = ("retract", "finish", "stop")
FITTED = ("wired", "not fitted", "unknown")
SIGNED_FOR = ("machine", "simulator")
SAFETY_DEVICES = tuple(
    "emergency_stop safe_torque_off guard enabling_device chuck_closed key_removed spindle_permit".split()
)

# Suffixes (Ixx..) whose value 0 means "no limit" on this controller: following error, abort deceleration,
# program velocity, program acceleration, jog acceleration.
LIMIT_SUFFIXES = ("11", "15", "16", "17", "19")
_REQUIRED_SUFFIXES = ("00", "08", "09", "11", "12", "13", "14", "15", "16", "17", "19", "20", "21", "22", "23")
_REQUIRED_GLOBALS = ("I10", "I15")
_VARIABLE = re.compile(r"I(0|[1-9]\d{0,3})")
_VARIABLE_FIELD = Field(key="", at_least=-(2.0**47), at_most=2.0**47)

# Minimum ratio of a value above 0 to its maximum: smaller ones are a wrong unit, and break quotients.
LEAST_FRACTION = 1e-8
_MOTOR = Field(key="motor", kind=FieldType.WHOLE, at_least=1, at_most=8)

TOP_FIELDS: tuple[Field, ...] = (
    Field(key="schema", kind=FieldType.WHOLE, default=1, at_least=1, at_most=1),
    Field(key="name", kind=FieldType.TEXT),
    Field(key="source", kind=FieldType.TEXT, default=""),
    Field(key="assumed", kind=FieldType.TEXTS, default=()),
    Field(key="link", kind=FieldType.TEXT, default=""),
)

# Optional sections of a profile: every key of them has a default.
OPTIONAL_SECTIONS = frozenset({"heartbeat", "safety"})
_OF_INVERTER = ("ramp_rpm_per_s", "slip_rpm")
_DEFINED_MOTOR = re.compile(r"\s*#\s*(\d+)\s*->\s*(?!0\s*$)", re.ASCII)


def _positive(key: str, unit: str, at_most: float, *, optional: bool = False) -> Field:
    return Field(key=key, unit=unit, at_least=LEAST_FRACTION * at_most, at_most=at_most, optional=optional)


_known = partial(_positive, optional=True)
"""A number above 0 that a profile may leave out if unknown."""


def _travel(key: str) -> Field:
    return Field(key=key, unit="mm", at_least=-10_000, at_most=10_000)


NOTCH_KEYS = ("notch_n1", "notch_n2", "notch_d1", "notch_d2")
"""Coefficients of 24 bits, as `profiles.axis.notch` has them: a controller takes 2 for -2."""

SECTIONS: Mapping[str, tuple[Field, ...]] = MappingProxyType(
    {
        "controller": (
            Field(key="family", kind=FieldType.CHOICE, choices=FAMILIES),
            _positive("servo_period_ms", "ms", 10),
            _positive("background_ms", "ms", 1000),
            Field(key="axis_definitions", kind=FieldType.TEXTS),
        ),
        "tool": (
            _MOTOR,
            _positive("counts_per_mm", "1/mm", 10_000_000),
            _positive("moving_mass_kg", "kg", 1000),
            Field(key="damping_n_s_per_m", unit="N s/m", at_least=0, at_most=100_000),
            _positive("thrust_constant_n_per_a", "N/A", 10_000),
            _positive("amplifier_gain_a_per_v", "A/V", 1000),
            _positive("back_emf_v_s_per_m", "V s/m", 10_000),
            _positive("coil_resistance_ohm", "Ohm", 1000),
            _positive("coil_inductance_h", "H", 10),
            _positive("peak_current_a", "A", 1000),
            _positive("peak_force_n", "N", 100_000),
            _positive("continuous_force_n", "N", 100_000),
            _positive("encoder_max_velocity_m_per_min", "m/min", 100_000),
            _positive("encoder_max_acceleration_m_per_s2", "m/s2", 100_000),
            Field(key="gain_kp_v_per_m", unit="V/m", at_least=0.001, at_most=1e9),
            Field(key="gain_ki_v_per_m_s", unit="V/(m s)", at_least=0, at_most=1e9),
            Field(key="gain_kd_v_s_per_m", unit="V s/m", at_least=0, at_most=1e9),
            _positive("dac_full_scale_v", "V", 100),
            _positive("home_radius_mm", "mm", 1000),
            _travel("travel_min_mm"),
            _travel("travel_max_mm"),
            _positive("retract_mm", "mm", 100),
            _positive("wiper_land_mm", "mm", 10),
            _known("bus_voltage_v", "V", 1000),
            Field(key="name", kind=FieldType.TEXT, default=""),
            *(Field(key=each, at_least=-2, below=2, default=0.0) for each in NOTCH_KEYS),
            Field(key="passive_force_fraction", at_least=0, at_most=1, default=0.0),
        ),
        "spindle": (
            _MOTOR,
            Field(key="encoder_lines_per_rev", kind=FieldType.WHOLE, at_least=1, at_most=1_000_000),
            Field(key="counts_per_line", kind=FieldType.WHOLE, at_least=1, at_most=65_536),
            _positive("max_speed_rpm", "rpm", 100_000),
            _positive("inertia_kg_m2", "kg m2", 1000),
            _positive("peak_torque_n_m", "N m", 100_000),
            Field(key="drive", kind=FieldType.CHOICE, choices=SPINDLE_DRIVES, default="servo"),
            _known("ramp_rpm_per_s", "rpm/s", 1_000_000),
            Field(key="slip_rpm", unit="rpm", at_least=0, at_most=10_000, optional=True),
        ),
        "carriage": (
            _MOTOR,
            _positive("counts_per_mm", "1/mm", 10_000_000),
            _travel("jaw_face_mm"),
            Field(key="jaw_clearance_mm", unit="mm", at_least=0, at_most=1000),
            _travel("travel_min_mm"),
            _travel("travel_max_mm"),
        ),
        "chuck": (
            Field(key="jaws", kind=FieldType.WHOLE, at_least=2, at_most=12),
            _positive("jaw_mass_kg", "kg", 1000),
            _positive("jaw_radius_mm", "mm", 1000),
            _positive("max_force_n", "N", 1_000_000),
            Field(key="safety_factor", at_least=1, at_most=10),
            _known("jaw_length_mm", "mm", 1000),
            _known("jaw_stiffness_n_per_um", "N/um", 10_000),
            Field(key="jaw_contact_exponent", at_least=0, at_most=0.9, optional=True),
            Field(key="jaw_straight_fraction", at_least=0, at_most=1, optional=True),
            Field(key="jaw_bell_mouth_mm", unit="mm", at_least=0, at_most=100, optional=True),
            Field(key="lobe_along", kind=FieldType.CHOICE, default="shell", choices=("shell", "one")),
            _known("jaw_friction", "", 1),
            _known("force_per_torque_n_per_n_m", "N/(N m)", 100_000),
            Field(key="force_offset_n", unit="N", at_least=-100_000, at_most=100_000, optional=True),
            _known("force_sd_percent", "%", 50),
            _known("work_mode_hz", "Hz", 100_000),
            Field(key="name", kind=FieldType.TEXT, default=""),
        ),
        "heartbeat": (
            Field(key="policy", kind=FieldType.CHOICE, choices=LOSS_POLICIES, default="retract"),
            Field(key="grace_ms", unit="ms", at_least=1, at_most=60_000, default=1100.0),
        ),
        "safety": (
            *(Field(key=key, kind=FieldType.CHOICE, choices=FITTED, default="unknown") for key in SAFETY_DEVICES),
            Field(key="signed_by", kind=FieldType.TEXT, default=""),
            Field(key="signed_for", kind=FieldType.CHOICE, choices=SIGNED_FOR, default=""),
            Field(key="inputs", kind=FieldType.TEXTS, default=()),
        ),
    }
)


def read_variables(
    given: Mapping[str, object], motors: Sequence[int], *, where: str
) -> tuple[Mapping[str, float], list[Problem]]:
    """Return the controller's settings by name, read only, and every problem of them.

    Each of `motors` needs its set; a limit of 0 is refused because it would mean no limit at all.
    """
    values: dict[str, float] = {}
    problems: list[Problem] = []
    limits = {f"I{motor}{suffix}" for motor in range(1, 9) for suffix in LIMIT_SUFFIXES}
    for name, value in given.items():
        key = f"controller.variables.{name}"
        if not _VARIABLE.fullmatch(name):
            problems.append(
                Problem(code="key.unknown", where=where, key=spell_toml(key)[1:-1], limit="I0 … I9999")
            )
        elif code := fault(_VARIABLE_FIELD, value):
            limit = _VARIABLE_FIELD.limit
            problems.append(Problem(code=code, where=where, key=key, value=spell_toml(value), limit=limit))
        elif isinstance(value, int | float):
            if name in limits and value <= 0:
                problems.append(impossible(key, spell_toml(value), "> 0", where))
            values[name] = value
    needed = [*_REQUIRED_GLOBALS, *(f"I{motor}{suffix}" for motor in motors for suffix in _REQUIRED_SUFFIXES)]
    missing = (f"controller.variables.{name}" for name in needed if name not in given)
    problems += [Problem(code="key.missing", where=where, key=key) for key in missing]
    return MappingProxyType(values), problems


def read_assumed(assumed: Sequence[str], *, where: str) -> list[Problem]:
    """Return a refusal for each name in `assumed` that is not a key of a machine."""
    known = {f"{section}.{field.key}" for section, fields in SECTIONS.items() for field in fields}
    known.add("controller.variables")
    return [
        Problem(code="value.not_choice", where=where, key="assumed", value=spell_toml(name), limit="table.key")
        for name in assumed
        if name not in known and not _VARIABLE.fullmatch(name.removeprefix("controller.variables."))
    ]


def inverter_problems(sections: Mapping[str, Mapping[str, Any]], *, where: str) -> list[Problem]:
    """Return the contradictions between the spindle's drive and the rest of the machine.

    A program moves every axis of its coordinate system in closed loop: a spindle that the controller cannot move
    must be none of them; `->0` defines none.
    """
    spindle, controller = sections.get("spindle", {}), sections.get("controller", {})
    given = [key for key in _OF_INVERTER if spindle.get(key) is not None]
    if spindle.get("drive") == "servo":
        needed = 'spindle.drive = "inverter"'
        return [impossible(f"spindle.{key}", spell_toml(spindle[key]), needed, where) for key in given]
    if spindle.get("drive") != "inverter":
        return []
    motor, axes = spindle.get("motor"), "axis_definitions"
    missing = [f"spindle.{key}" for key in _OF_INVERTER if key not in given]
    return [
        *(Problem(code="key.missing", where=where, key=key) for key in missing),
        *(
            impossible(f"controller.{axes}", spell_toml(text), f"#{motor}->0", where)
            for text in controller.get(axes, ())
            if (found := _DEFINED_MOTOR.match(text)) and int(found[1]) == motor
        ),
    ]


def impossible(key: str, value: str, limit: str, where: str) -> Problem:
    """Return the refusal of a value that is out of range beside the others."""
    return Problem(code="value.out_of_range", where=where, key=key, value=value, limit=limit)
