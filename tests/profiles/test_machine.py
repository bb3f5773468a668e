"""Machine files: what follows from them, and what they may say."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from profiles.axis.notch import Notch, SignConvention, is_coefficient
from profiles.fields import LEAST_MAGNITUDE, Field, FieldType, fault
from profiles.job import JOB_FIELDS, job_from_table
from profiles.lobe.prediction import predict
from profiles.machine import MachineProfile, machine_from_table, real_machine_problems
from profiles.machine_fields import NOTCH_KEYS, SECTIONS
from profiles.problem import Problem, ProfileError
from profiles.rules import check
from profiles.store import BUNDLED_JOBS, BUNDLED_MACHINES, list_machines, load_job, load_machine

TABLE = tomllib.loads((BUNDLED_MACHINES / "lee-2001-lathe.toml").read_text(encoding="utf-8"))
LATHE = load_machine("lee-2001-lathe").machine


def changed(change: Callable[[dict[str, Any]], object]) -> list[tuple[str, str]]:
    table = copy.deepcopy(TABLE)
    change(table)
    with pytest.raises(ProfileError) as caught:
        machine_from_table(table, where="m.toml")
    return [(problem.code, problem.key) for problem in caught.value.problems]


def test_tables_2_to_4_of_the_paper_and_what_follows_from_them() -> None:
    tool = LATHE.tool
    assert (tool.moving_mass_kg, tool.damping_n_s_per_m) == (4.74, 201.6)
    assert tool.loop_gain_n_per_v == pytest.approx(624, abs=0.05)
    assert tool.count_um == pytest.approx(0.2)
    assert (tool.peak_force_n, tool.continuous_force_n, tool.peak_current_a) == (2000, 400, 36.8)
    assert (tool.gain_kp_v_per_m, tool.gain_ki_v_per_m_s, tool.gain_kd_v_s_per_m) == (147.6, 32.3, 2.5)
    assert tool.retract_mm * tool.counts_per_mm == 10_000
    assert LATHE.spindle.counts_per_rev == 10_000
    assert LATHE.controller.servo_period_ms == LATHE.controller.variables["I10"] / 8_388_608


def test_settings_follow_from_the_machine_and_are_read_only() -> None:
    variables, tool, spindle = LATHE.controller.variables, LATHE.tool, LATHE.spindle
    for motor, axis in ((tool.motor, tool), (LATHE.carriage.motor, LATHE.carriage)):
        assert variables[f"I{motor}13"] == axis.travel_max_mm * axis.counts_per_mm
        assert variables[f"I{motor}14"] == axis.travel_min_mm * axis.counts_per_mm
    thrust_counts_per_ms2 = tool.continuous_force_n / tool.moving_mass_kg * 1000 * tool.counts_per_mm / 1e6
    assert variables["I117"] == pytest.approx(thrust_counts_per_ms2, abs=0.5)
    torque_rad_per_s2 = spindle.peak_torque_n_m / spindle.inertia_kg_m2
    counts_per_rad = spindle.counts_per_rev / 6.283185307
    assert variables["I217"] == pytest.approx(torque_rad_per_s2 * counts_per_rad / 1e6, abs=0.01)
    assert variables["I216"] == spindle.max_speed_rpm / 60 * spindle.counts_per_rev / 1000
    assert variables["I169"] <= 36.8 / 11.45 / 10 * 32768
    assert variables["I111"] / 16 * tool.count_um == 150
    with pytest.raises(TypeError):
        LATHE.controller.variables["I111"] = 0  # type: ignore[index]


def test_a_force_without_torque_needs_what_a_torque_adds() -> None:
    def preloaded(table: dict[str, Any]) -> None:
        table["chuck"]["force_offset_n"] = 120.0
        del table["chuck"]["force_per_torque_n_per_n_m"]

    assert changed(preloaded) == [("key.missing", "chuck.force_per_torque_n_per_n_m")]


@pytest.mark.parametrize("name", ["lee-2001-lathe", "turbo-ethernet-lathe"])
def test_a_bundled_machine_says_which_chuck_and_tool_it_has_and_that_nobody_told(name: str) -> None:
    machine = load_machine(name).machine
    assert machine.chuck.name and machine.tool.name
    assert {"chuck.name", "tool.name"} <= set(machine.assumed)


@pytest.mark.parametrize("suffix", ["11", "15", "16", "17", "19"])
@pytest.mark.parametrize("value", [0, 0.0, -1])
def test_a_limit_of_zero_means_none_and_is_refused(suffix: str, value: float) -> None:
    for motor in (1, 2, 3):
        name = f"I{motor}{suffix}"
        found = changed(lambda t, name=name: t["controller"]["variables"].update({name: value}))  # type: ignore[misc]
        assert found == [("value.out_of_range", f"controller.variables.{name}")]


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda t: t.pop("tool"), ("key.missing", "tool")),
        (lambda t: t.update(tool=3), ("value.not_table", "tool")),
        (lambda t: t.update(turret={}), ("key.unknown", "turret")),
        (lambda t: t["tool"].update(mass=1), ("key.unknown", "tool.mass")),
        (lambda t: t["tool"].update(moving_mass_kg=0), ("value.out_of_range", "tool.moving_mass_kg")),
        (lambda t: t["chuck"].update(jaws=3.0), ("value.not_whole", "chuck.jaws")),
        (lambda t: t["tool"].update(travel_max_mm=-3), ("value.out_of_range", "tool.travel_max_mm")),
        (lambda t: t["spindle"].update(motor=1), ("value.out_of_range", "spindle.motor")),
        (lambda t: t["controller"].pop("variables"), ("key.missing", "controller.variables")),
        (lambda t: t["controller"]["variables"].pop("I311"), ("key.missing", "controller.variables.I311")),
        (lambda t: t["controller"]["variables"].update(P1=1), ("key.unknown", "controller.variables.P1")),
        (lambda t: t["controller"]["variables"].update(I5=True), ("value.not_number", "controller.variables.I5")),
        (lambda t: t["controller"].update(family="power"), ("value.not_choice", "controller.family")),
        (lambda t: t["assumed"].append("tool.colour"), ("value.not_choice", "assumed")),
        (lambda t: t.update(schema=2), ("schema.unsupported", "schema")),
    ],
)
def test_refusals(change: Callable[[dict[str, Any]], object], expected: tuple[str, str]) -> None:
    assert expected in changed(change)


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=9), inner, max_size=3),
    max_leaves=6,
)


@given(st.sampled_from([*TABLE, "x"]), VALUES, st.data())
def test_any_table_is_a_machine_or_a_refusal(section: str, value: object, data: st.DataObject) -> None:
    table = copy.deepcopy(TABLE)
    if isinstance(table.get(section), dict) and data.draw(st.booleans()):
        table[section][data.draw(st.sampled_from([*table[section], "x\n"]))] = value
    else:
        table[section] = value
    try:
        machine = machine_from_table(table)
    except ProfileError as error:
        assert all(str(problem).isprintable() for problem in error.problems)
    else:
        assert isinstance(machine, MachineProfile)


# The signature under the safety devices of a machine profile says what was signed for.

BUNDLED = [entry.name for entry in list_machines()]


def table(**safety: str | None) -> dict[str, Any]:
    """The first bundled machine with other keys in [safety]; None takes a key away."""
    read = tomllib.loads(load_machine(BUNDLED[0]).path.read_text(encoding="utf-8"))
    section = read["safety"] | safety
    return read | {"safety": {key: value for key, value in section.items() if value is not None}}


@pytest.mark.parametrize("name", BUNDLED)
def test_a_bundled_machine_is_signed_for_the_simulator_alone(name: str) -> None:
    (problem,) = real_machine_problems(load_machine(name).machine)
    assert (problem.code, problem.where, problem.value) == ("safety.signed_for_simulator", name, "simulator")


def test_a_machine_that_somebody_has_signed_for_may_be_met() -> None:
    signed = machine_from_table(table(signed_by="Kim, 2026-03-01", signed_for="machine"))
    assert real_machine_problems(signed) == ()
    assert real_machine_problems(machine_from_table(table(signed_by=None, signed_for=None))) == ()


@pytest.mark.parametrize(
    ("signed_for", "code"), [(None, "key.missing"), ("", "value.not_choice"), ("iron", "value.not_choice")]
)
def test_a_signature_says_what_was_signed_for(signed_for: str | None, code: str) -> None:
    with pytest.raises(ProfileError) as refusal:
        machine_from_table(table(signed_by="Kim, 2026-03-01", signed_for=signed_for), where="lathe.toml")
    (problem,) = refusal.value.problems
    assert (problem.code, problem.where, problem.key) == (code, "lathe.toml", "safety.signed_for")
    assert problem.limit == "machine | simulator"


@pytest.mark.parametrize(
    ("signed_by", "code"),
    [
        ("   ", "value.blank"),
        ("\u3000", "value.not_text"),  # an ideographic space
        ("\u3164", "value.blank"),  # a Hangul filler is a letter without ink
        ("\x07", "value.not_text"),
        ("Kim\r2026", "value.not_text"),
        ("-", "safety.nobody_named"),
        ("2026-03-01", "safety.nobody_named"),
    ],
)
def test_blanks_marks_and_dates_are_nobodys_signature(signed_by: str, code: str) -> None:
    with pytest.raises(ProfileError) as refusal:
        machine_from_table(table(signed_by=signed_by, signed_for="machine"), where="lathe.toml")
    (problem,) = refusal.value.problems
    assert (problem.code, problem.where, problem.key) == (code, "lathe.toml", "safety.signed_by")


@pytest.mark.parametrize(
    ("section", "key"),
    [("", "source"), ("", "link"), ("tool", "name"), ("chuck", "name"), ("safety", "signed_by")],
)
def test_a_text_of_blanks_is_refused_wherever_it_counts_as_somebodys_word(section: str, key: str) -> None:
    read = table(signed_by="Kim, 2026-03-01", signed_for="machine")
    read |= {section: read[section] | {key: "  "}} if section else {key: "  "}
    with pytest.raises(ProfileError) as refusal:
        machine_from_table(read)
    assert [problem.code for problem in refusal.value.problems] == ["value.blank"]


# A spindle on an inverter in a machine file: what it needs, and that older files mean a servo.

INVERTER: dict[str, Any] = {"drive": "inverter", "ramp_rpm_per_s": 500.0, "slip_rpm": 60.0}


def spindle_table(definitions: tuple[str, ...] = ("#1->X", "#3->Z"), **spindle: Any) -> dict[str, Any]:
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
    spindle = machine_from_table(spindle_table(definitions, **INVERTER)).spindle
    assert (spindle.drive, spindle.ramp_rpm_per_s, spindle.slip_rpm) == ("inverter", 500.0, 60.0)


@pytest.mark.parametrize("definition", ["#2->Y", "# 2 -> Y", "#2->360Y+5", "#2->0.5Y"])
def test_an_inverter_spindle_that_is_an_axis_is_refused(definition: str) -> None:
    assert refused(spindle_table(("#1->X", definition, "#3->Z"), **INVERTER)) == [
        ("value.out_of_range", "controller.axis_definitions")
    ]


@pytest.mark.parametrize("key", ["ramp_rpm_per_s", "slip_rpm"])
def test_an_inverter_needs_its_ramp_and_its_slip(key: str) -> None:
    values = {name: value for name, value in INVERTER.items() if name != key}
    assert refused(spindle_table(**values)) == [("key.missing", f"spindle.{key}")]


@pytest.mark.parametrize("key", ["ramp_rpm_per_s", "slip_rpm"])
@pytest.mark.parametrize("drive", [{}, {"drive": "servo"}])
def test_a_servo_has_neither(key: str, drive: dict[str, Any]) -> None:
    assert refused(spindle_table(**{**drive, key: 10.0})) == [("value.out_of_range", f"spindle.{key}")]


@pytest.mark.parametrize(
    ("changed", "code"),
    [
        ({"drive": "belt"}, "value.not_choice"),
        ({**INVERTER, "ramp_rpm_per_s": 0.0}, "value.out_of_range"),
        ({**INVERTER, "slip_rpm": -1.0}, "value.out_of_range"),
    ],
)
def test_what_no_drive_is_is_refused(changed: dict[str, Any], code: str) -> None:
    assert code in [found for found, _ in refused(spindle_table(**changed))]


# Every number of a job or a machine is bounded, and no number within its bounds breaks what is calculated.

JOB = load_job("lee-2001-experiment-1").job
JOB_TABLE = tomllib.loads((BUNDLED_JOBS / "lee-2001-experiment-1.toml").read_text(encoding="utf-8"))
MACHINE_TABLE = tomllib.loads((BUNDLED_MACHINES / "lee-2001-lathe.toml").read_text(encoding="utf-8"))

OF_JOB = [field for field in JOB_FIELDS if field.kind is FieldType.NUMBER]
OF_MACHINE = [
    (name, field) for name, fields in SECTIONS.items() for field in fields if field.kind is FieldType.NUMBER
]

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


def test_controllers_settings_have_bounds_and_a_weak_tool_has_limits_of_0_rpm() -> None:
    assert refusal_of_machine_setting("I130") == "value.too_small"
    # 100 N are kept free for the cut: an axis that pushes with 90 N has nothing left for the lobe.
    weak = replace(LATHE, tool=replace(LATHE.tool, peak_force_n=90.0))
    at_speed = predict(JOB, weak).envelope
    assert (at_speed.at_job.rpm["peak_thrust"], at_speed.percent["peak_thrust"]) == (0.0, None)


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


def test_the_least_numbers_can_be_calculated_with() -> None:
    for field in OF_JOB:
        calculated(replace(JOB, **{field.key: least(field)}), LATHE)  # type: ignore[arg-type]
    for section, field in OF_MACHINE:
        calculated(JOB, changed_machine(section, field))


# The coefficients of a notch filter: which a controller takes, and what it makes of them by each reading.

FIELDS = [field for field in SECTIONS["tool"] if field.key in NOTCH_KEYS]


@pytest.mark.parametrize(("value", "taken"), [(-2.0, True), (1.999, True), (2.0, False), (-2.001, False)])
def test_a_profile_may_state_what_a_controller_takes_as_it_is(value: float, taken: bool) -> None:
    """24 bits, 22 behind the point: 2 would be taken for -2 (tests/drivers/test_tool_servo.py)."""
    assert is_coefficient(value) is taken
    assert len(FIELDS) == 4
    for field in FIELDS:
        assert fault(field, value) == ("" if taken else "value.out_of_range") and field.limit == ">= -2, < 2"


@pytest.mark.parametrize(
    ("reading", "signs"),
    [
        (SignConvention.STATED, (1, 1, 1, 1)),
        (SignConvention.NUMERATOR, (-1, -1, 1, 1)),
        (SignConvention.DENOMINATOR, (1, 1, -1, -1)),
        (SignConvention.BOTH, (-1, -1, -1, -1)),
    ],
)
def test_another_reading_turns_signs_of_zeros_or_poles(reading: SignConvention, signs: tuple[int, ...]) -> None:
    notch = Notch(n1=-0.5, n2=0.25, d1=-0.125, d2=0.0625)
    turned = tuple(sign * each for sign, each in zip(signs, notch.coefficients, strict=True))
    assert notch.read_as(reading).coefficients == turned
