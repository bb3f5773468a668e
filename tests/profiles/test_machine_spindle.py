"""A spindle on an inverter in a machine file: what it needs, and that older files mean a servo."""

from __future__ import annotations

import copy
import tomllib
from typing import Any

import pytest

from profiles.machine import machine_from_table
from profiles.problem import ProfileError
from profiles.store import BUNDLED_MACHINES

TABLE = tomllib.loads((BUNDLED_MACHINES / "lee-2001-lathe.toml").read_text(encoding="utf-8"))
INVERTER: dict[str, Any] = {"drive": "inverter", "ramp_rpm_per_s": 500.0, "slip_rpm": 60.0}


def table(definitions: tuple[str, ...] = ("#1->X", "#3->Z"), **spindle: Any) -> dict[str, Any]:
    changed = copy.deepcopy(TABLE)
    changed["spindle"].update(spindle)
    changed["controller"]["axis_definitions"] = list(definitions)
    return changed


def refused(changed: dict[str, Any]) -> list[tuple[str, str]]:
    with pytest.raises(ProfileError) as caught:
        machine_from_table(changed, where="m.toml")
    return [(problem.code, problem.key) for problem in caught.value.problems]


def test_a_file_that_says_nothing_means_a_servo_spindle() -> None:
    spindle = machine_from_table(TABLE).spindle
    assert (spindle.drive, spindle.ramp_rpm_per_s, spindle.slip_rpm) == ("servo", None, None)


@pytest.mark.parametrize("definitions", [("#1->X", "#3->Z"), ("#1->X", "#2->0", "#3->Z"), ("#1->X", "#22->Y")])
def test_an_inverter_spindle_is_none_of_the_axes(definitions: tuple[str, ...]) -> None:
    spindle = machine_from_table(table(definitions, **INVERTER)).spindle
    assert (spindle.drive, spindle.ramp_rpm_per_s, spindle.slip_rpm) == ("inverter", 500.0, 60.0)


@pytest.mark.parametrize("definition", ["#2->Y", "# 2 -> Y", "#2->360Y+5", "#2->0.5Y"])
def test_an_inverter_spindle_that_is_an_axis_is_refused(definition: str) -> None:
    assert refused(table(("#1->X", definition, "#3->Z"), **INVERTER)) == [
        ("value.out_of_range", "controller.axis_definitions")
    ]


@pytest.mark.parametrize("key", ["ramp_rpm_per_s", "slip_rpm"])
def test_an_inverter_needs_its_ramp_and_its_slip(key: str) -> None:
    values = {name: value for name, value in INVERTER.items() if name != key}
    assert refused(table(**values)) == [("key.missing", f"spindle.{key}")]


@pytest.mark.parametrize("key", ["ramp_rpm_per_s", "slip_rpm"])
@pytest.mark.parametrize("drive", [{}, {"drive": "servo"}])
def test_a_servo_has_neither(key: str, drive: dict[str, Any]) -> None:
    assert refused(table(**{**drive, key: 10.0})) == [("value.out_of_range", f"spindle.{key}")]


@pytest.mark.parametrize(
    ("changed", "code"),
    [
        ({"drive": "belt"}, "value.not_choice"),
        ({**INVERTER, "ramp_rpm_per_s": 0.0}, "value.out_of_range"),
        ({**INVERTER, "slip_rpm": -1.0}, "value.out_of_range"),
    ],
)
def test_what_no_drive_is_is_refused(changed: dict[str, Any], code: str) -> None:
    assert code in [found for found, _ in refused(table(**changed))]
