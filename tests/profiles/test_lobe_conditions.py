"""A compensation holds for the cut in which its error was found: force, speed, lengths, chuck and tool."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from profiles.findings import Severity
from profiles.lobe.lobe_conditions import (
    FORCE_TOLERANCE,
    OTHER_CUT,
    changed_conditions,
    force_as_found,
    kept_condition,
    lobe_differences,
    lobe_source,
    unstated,
)
from profiles.lobe.prediction import predict
from profiles.rules import check
from profiles.store import load_job, load_machine

MEASURED = load_job("lee-2001-experiment-1").job
JOB = replace(MEASURED, lobe_chuck=None, lobe_tool=None)
"""Says all of its cut but the names."""
LATHE = load_machine("lee-2001-lathe").machine


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({}, None),
        ({"spindle_speed_rpm": 1020.0}, None),
        ({"spindle_speed_rpm": 979.0}, "spindle_speed_rpm"),
        ({"overhang_mm": 30.1}, None),
        ({"overhang_mm": 29.89}, "overhang_mm"),
        ({"wall_thickness_mm": 2.5375}, None),
        ({"wall_thickness_mm": 2.54}, "wall_thickness_mm"),
        ({"wall_thickness_mm": 2.46}, "wall_thickness_mm"),
        ({"diameter_mm": 53.0}, "diameter_mm"),
        ({"lobe_chuck": "collet"}, "chuck.name"),
        ({"lobe_chuck": "scroll 160", "lobe_tool": "CCMT"}, None),
        ({"lobe_tool": "DCMT"}, "tool.name"),
        ({"feed_mm_per_rev": 0.03}, None),
        ({"material": "S45C"}, "material"),
        ({"material": "aluminium"}, None),
        ({"material": "A6061"}, None),
        ({"material": "brass"}, "material"),
        ({"material": "Brass", "lobe_material": "brass"}, None),
        ({"jaws": 6}, "jaws"),
        ({"spindle_speed_rpm": 800.0, "lobe_spindle_speed_rpm": None}, None),
    ],
)
def test_what_differs_from_the_calibration_cut(change: dict[str, Any], key: str | None) -> None:
    differing = lobe_differences(replace(JOB, **change), chuck="scroll 160", tool="CCMT")
    assert [problem.key for problem in differing] == ([key] if key else [])


@pytest.mark.parametrize(("force_n", "same"), [(1379.0, True), (1380.0, False), (1249.0, True), (1248.0, False)])
def test_the_force_may_be_five_percent_off(force_n: float, same: bool) -> None:
    assert force_as_found(replace(JOB, chucking_force_n=force_n)) is same


def test_a_wall_within_its_limit_changes_the_lobe_by_no_more_than_the_force() -> None:
    """By the model of a clamped ring, 0.1 mm in front of the jaws; p-p ~ R^3 / t^3."""
    ring = replace(JOB, overhang_mm=0.1, cut_length_mm=0.1, spindle_speed_rpm=1.0)
    limits = [replace(ring, wall_thickness_mm=wall_mm) for wall_mm in (2.5375, 2.4625)]
    for job in (*limits, replace(ring, diameter_mm=52.1)):
        changed = predict(job, LATHE).model.spring_back_um_pp / predict(ring, LATHE).model.spring_back_um_pp
        assert abs(changed - 1.0) < FORCE_TOLERANCE


def test_a_difference_is_a_warning_of_the_job() -> None:
    named = replace(JOB, spindle_speed_rpm=800.0, overhang_mm=25.0, lobe_tool="CCMT")
    found = [each for each in check(named, LATHE) if each.problem.code == "rule.lobe_differs"]
    assert {each.severity for each in found} == {Severity.WARNING}
    assert [(each.problem.key, each.problem.limit) for each in found] == [
        ("spindle_speed_rpm", "1000 rpm"),
        ("overhang_mm", "30 mm"),
        ("tool.name", '"CCMT"'),
    ]
    (held,) = [each for each in check(MEASURED, LATHE) if each.problem.code == "rule.lobe_differs"]
    assert held.severity is Severity.OK


CONDITIONS = (
    "lobe_force_n",
    "lobe_spindle_speed_rpm",
    "lobe_overhang_mm",
    "lobe_wall_thickness_mm",
    "lobe_diameter_mm",
    "lobe_material",
    "lobe_jaws",
    "lobe_chuck",
    "lobe_tool",
)


@pytest.mark.parametrize("name", ["lee-2001-experiment-1", "lee-2001-experiment-2"])
def test_the_jobs_of_the_paper_say_all_of_the_cut_that_was_measured(name: str) -> None:
    """Table 6: the cut without compensation was that of the job; chucking force, chuck and tool are not given."""
    job = load_job(name).job
    assert unstated(job) == ()
    assert {key for key in CONDITIONS if key in job.assumed} == {"lobe_force_n", "lobe_chuck", "lobe_tool"}
    assert lobe_differences(job, chuck=LATHE.chuck.name, tool=LATHE.tool.name) == ()


@pytest.mark.parametrize("source", ["measured", "fitted"])
@pytest.mark.parametrize(
    ("key", "nothing_said"), [*((key, None) for key in CONDITIONS), ("lobe_chuck", ""), ("lobe_tool", "")]
)
def test_nothing_holds_that_was_compared_with_nothing(source: str, key: str, nothing_said: object) -> None:
    """One condition is not stated: no rule says that the cut is as calibrated, one says what is missing."""
    missing: dict[str, Any] = {key: nothing_said}
    job = replace(MEASURED, lobe_error_source=source, **missing)
    found = [each for each in check(job, LATHE) if each.problem.code.startswith("rule.lobe_")]
    assert [(each.severity, each.problem.code, each.problem.limit) for each in found] == [
        (Severity.WARNING, "rule.lobe_unstated", key)
    ]
    nothing: dict[str, Any] = dict.fromkeys(CONDITIONS)
    by_model = {f.problem.code for f in check(replace(job, lobe_error_source="model", **nothing), LATHE)}
    assert not {"rule.lobe_differs", "rule.lobe_unstated", "rule.force_differs"} & by_model


@pytest.mark.parametrize(
    ("key", "value", "found_at"),
    [
        ("material", "steel", "Al"),
        ("jaws", 6, 3),
        ("diameter_mm", 53.0, 52.0),
        ("wall_thickness_mm", 3.0, 2.5),
        ("overhang_mm", 31.0, 30.0),
        ("chucking_force_n", 1400.0, 1314.0),
        ("spindle_speed_rpm", 900.0, 1000.0),
    ],
)
@pytest.mark.parametrize("source", ["measured", "fitted"])
def test_an_error_is_not_called_measured_on_a_cut_with_another_condition(
    source: str, key: str, value: object, found_at: object
) -> None:
    found = replace(MEASURED, lobe_error_source=source)
    assert lobe_source(found) == source and changed_conditions(found) == {}
    changed = replace(found, **{key: value})  # type: ignore[arg-type]
    assert lobe_source(changed) == OTHER_CUT
    assert changed_conditions(changed) == {key: found_at}
    assert lobe_source(replace(changed, lobe_error_source="assumed")) == "assumed"


def test_nor_in_another_chuck_or_with_another_tool() -> None:
    own = {"chuck": LATHE.chuck.name, "tool": LATHE.tool.name}
    assert lobe_source(MEASURED, **own) == "measured"
    for name in own:
        assert lobe_source(MEASURED, **{**own, name: "another"}) == OTHER_CUT


def test_a_lobe_that_was_found_in_three_jaws_is_none_of_six() -> None:
    """The model speaks for six jaws; a factor of three would scale one lobe by another."""
    six = predict(replace(MEASURED, jaws=6), LATHE)
    assert predict(MEASURED, LATHE).scaled_to is not None and six.scaled_to is None
    assert six.cut.um_pp == six.model.um_pp < 1.0
    assert six.process.lobed_force_n < 0.05


def test_a_condition_that_no_file_states_is_what_the_file_has_as_long_as_another_value_is_tried() -> None:
    saved = replace(JOB, lobe_spindle_speed_rpm=None)
    tried = kept_condition(saved, "spindle_speed_rpm", 800.0)
    assert tried == {"lobe_spindle_speed_rpm": 1000.0}
    assert kept_condition(saved, "spindle_speed_rpm", 1000.0) == {"lobe_spindle_speed_rpm": None}
    assert kept_condition(JOB, "spindle_speed_rpm", 800.0) == {}
    assert kept_condition(saved, "feed_mm_per_rev", 0.1) == {}
