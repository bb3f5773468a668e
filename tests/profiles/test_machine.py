"""The bundled lathe says what the paper says; a machine file is refused where it is wrong."""

import copy
import tomllib
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from profiles.machine import MachineProfile, machine_from_table
from profiles.problem import ProfileError
from profiles.store import BUNDLED_MACHINES, load_machine

TABLE = tomllib.loads((BUNDLED_MACHINES / "lee-2001-lathe.toml").read_text(encoding="utf-8"))
LATHE = load_machine("lee-2001-lathe").machine


def changed(change: Callable[[dict[str, Any]], object]) -> list[tuple[str, str]]:
    table = copy.deepcopy(TABLE)
    change(table)
    with pytest.raises(ProfileError) as caught:
        machine_from_table(table, where="m.toml")
    return [(problem.code, problem.key) for problem in caught.value.problems]


def test_tables_2_to_4_of_the_paper() -> None:
    tool = LATHE.tool
    assert (tool.moving_mass_kg, tool.damping_n_s_per_m) == (4.74, 201.6)
    assert tool.loop_gain_n_per_v == pytest.approx(624, abs=0.05)
    assert tool.count_um == pytest.approx(0.2)
    assert (tool.peak_force_n, tool.continuous_force_n, tool.peak_current_a) == (2000, 400, 36.8)
    assert (tool.gain_kp_v_per_m, tool.gain_ki_v_per_m_s, tool.gain_kd_v_s_per_m) == (147.6, 32.3, 2.5)
    assert tool.retract_mm * tool.counts_per_mm == 10_000
    assert LATHE.spindle.counts_per_rev == 10_000


def test_the_servo_period_is_that_of_i10() -> None:
    assert LATHE.controller.servo_period_ms == LATHE.controller.variables["I10"] / 8_388_608


def test_settings_follow_from_the_machine() -> None:
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


def test_settings_are_read_only() -> None:
    with pytest.raises(TypeError):
        LATHE.controller.variables["I111"] = 0  # type: ignore[index]


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
        (
            lambda t: t["controller"]["variables"].update(I5=True),
            ("value.not_number", "controller.variables.I5"),
        ),
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
