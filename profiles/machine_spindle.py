"""What a spindle on an inverter needs, and what it may not have: the controller reads it and never moves it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from profiles.fields import spelled
from profiles.problem import Problem

_OF_INVERTER = ("ramp_rpm_per_s", "slip_rpm")
_DEFINED_MOTOR = re.compile(r"\s*#\s*(\d+)\s*->\s*(?!0\s*$)", re.ASCII)


def inverter_problems(sections: Mapping[str, Mapping[str, Any]], *, where: str) -> list[Problem]:
    """Return the contradictions between the spindle's drive and the rest of the machine.

    A program moves every axis of its coordinate system in closed loop: a spindle that the controller cannot move
    must be none of them.
    """
    spindle = sections.get("spindle", {})
    drive = spindle.get("drive")
    if drive == "inverter":
        return [*_missing(spindle, where), *_defined(spindle, sections.get("controller", {}), where)]
    needed = 'spindle.drive = "inverter"'
    return [
        Problem(
            code="value.out_of_range", where=where, key=f"spindle.{key}", value=spelled(spindle[key]), limit=needed
        )
        for key in _OF_INVERTER
        if drive == "servo" and spindle.get(key) is not None
    ]


def _missing(spindle: Mapping[str, Any], where: str) -> list[Problem]:
    return [
        Problem(code="key.missing", where=where, key=f"spindle.{key}")
        for key in _OF_INVERTER
        if spindle.get(key) is None
    ]


def _defined(spindle: Mapping[str, Any], controller: Mapping[str, Any], where: str) -> list[Problem]:
    """Return a refusal for each definition that makes the spindle an axis; `->0` makes it none."""
    motor, name = spindle.get("motor"), "axis_definitions"
    return [
        Problem(
            code="value.out_of_range",
            where=where,
            key=f"controller.{name}",
            value=spelled(text),
            limit=f"#{motor}->0",
        )
        for text in controller.get(name, ())
        if (found := _DEFINED_MOTOR.match(text)) and int(found[1]) == motor
    ]
