"""Every number of a job or a machine is bounded, and no number within its bounds breaks what is calculated."""

from __future__ import annotations

import copy
import tomllib
from dataclasses import replace
from typing import Any

import pytest

from profiles.fields import LEAST_MAGNITUDE, Field, Kind
from profiles.job import JOB_FIELDS, job_from_table
from profiles.lobe.prediction import predict
from profiles.machine import machine_from_table
from profiles.machine_fields import SECTIONS
from profiles.problem import Problem, ProfileError
from profiles.rules import check
from profiles.store import BUNDLED_JOBS, BUNDLED_MACHINES, load_job, load_machine

JOB = load_job("lee-2001-experiment-1").job
LATHE = load_machine("lee-2001-lathe").machine
JOB_TABLE = tomllib.loads((BUNDLED_JOBS / "lee-2001-experiment-1.toml").read_text(encoding="utf-8"))
MACHINE_TABLE = tomllib.loads((BUNDLED_MACHINES / "lee-2001-lathe.toml").read_text(encoding="utf-8"))

OF_JOB = [field for field in JOB_FIELDS if field.kind is Kind.NUMBER]
OF_MACHINE = [(name, field) for name, fields in SECTIONS.items() for field in fields if field.kind is Kind.NUMBER]

SUBNORMAL = 1e-320


def least(field: Field) -> float:
    """Return the least size that a number of a field may have."""
    assert field.at_least is not None and not (field.at_most is None and field.below is None), field.key
    return field.at_least if field.at_least > 0 else LEAST_MAGNITUDE


def refusal_of_job(key: str, value: float) -> Problem:
    table = copy.deepcopy(JOB_TABLE)
    for inner in table.values():
        if isinstance(inner, dict):
            inner.pop(key, None)
    with pytest.raises(ProfileError) as caught:
        job_from_table({**table, key: value})
    (problem,) = caught.value.problems
    return problem


def refusal_of_machine(section: str, key: str, value: float) -> Problem:
    table = copy.deepcopy(MACHINE_TABLE)
    table[section][key] = value
    with pytest.raises(ProfileError) as caught:
        machine_from_table(table)
    return next(problem for problem in caught.value.problems if problem.key == f"{section}.{key}")


@pytest.mark.parametrize("key", [field.key for field in OF_JOB])
def test_a_number_too_small_for_arithmetic_is_refused_in_a_job(key: str) -> None:
    refused = refusal_of_job(key, SUBNORMAL)
    assert refused.code in ("value.too_small", "value.out_of_range")
    assert (refused.key, refused.value) == (key, str(SUBNORMAL)) and refused.limit


@pytest.mark.parametrize(("section", "key"), [(name, field.key) for name, field in OF_MACHINE])
def test_a_number_too_small_for_arithmetic_is_refused_in_a_machine(section: str, key: str) -> None:
    refused = refusal_of_machine(section, key, SUBNORMAL)
    assert refused.code in ("value.too_small", "value.out_of_range")
    assert refused.value == str(SUBNORMAL) and refused.limit


def test_so_is_one_of_the_controllers_settings() -> None:
    assert refusal_of_machine_setting("I130") == "value.too_small"


def refusal_of_machine_setting(name: str) -> str:
    table = copy.deepcopy(MACHINE_TABLE)
    table["controller"]["variables"][name] = SUBNORMAL
    with pytest.raises(ProfileError) as caught:
        machine_from_table(table)
    (problem,) = caught.value.problems
    return problem.code


def changed_machine(section: str, field: Field) -> Any:
    return replace(LATHE, **{section: replace(getattr(LATHE, section), **{field.key: least(field)})})


def calculated(job: Any, machine: Any) -> None:
    """Judge and predict; a refusal is an answer, anything else is not."""
    check(job, machine)
    try:
        predict(job, machine)
    except ProfileError as error:
        assert error.problems


def test_the_least_number_of_a_job_is_one_that_can_be_calculated_with() -> None:
    for field in OF_JOB:
        calculated(replace(JOB, **{field.key: least(field)}), LATHE)  # type: ignore[arg-type]


def test_the_least_number_of_a_machine_is_one_that_can_be_calculated_with() -> None:
    for section, field in OF_MACHINE:
        calculated(JOB, changed_machine(section, field))


def test_a_tool_without_force_to_spare_has_limits_of_0_rpm() -> None:
    """100 N are kept free for the cut: an axis that pushes with 90 N has nothing left for the lobe."""
    weak = replace(LATHE, tool=replace(LATHE.tool, peak_force_n=90.0))
    at_speed = predict(JOB, weak).envelope
    assert (at_speed.at_job.rpm["peak_thrust"], at_speed.percent["peak_thrust"]) == (0.0, None)
