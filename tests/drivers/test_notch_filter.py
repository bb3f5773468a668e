"""The notch filter Ix36 to Ix39 of the simulated controller: its response, its range, its signs, and none at 0."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.variables import VariableStore
from drivers.simulator.card.servo import ServoAxis
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.servo_gains import notch_of
from profiles.axis.notch import Notch
from profiles.axis.sampled_loop import loop_of
from profiles.axis.servo_gains import notch_settings
from profiles.machine import MachineProfile
from profiles.store import load_machine
from tests.drivers.test_tool_servo import CYCLE_S, PLANT, gains, held, response

NOTCH = {"ix36": -0.9375, "ix37": 0.8125, "ix38": -0.125, "ix39": 0.1875}
"""Zeros at some 330 Hz, poles that fade within two cycles."""


def with_notch(machine: MachineProfile, values: dict[str, float]) -> MachineProfile:
    n1, n2, d1, d2 = values.values()
    stated = notch_settings(machine, Notch(n1=n1, n2=n2, d1=d1, d2=d2))
    variables = {**machine.controller.variables, **stated}
    return replace(machine, controller=replace(machine.controller, variables=variables))


def test_the_filter_is_the_difference_equation_of_the_manual() -> None:
    filtering = notch_of(gains(**NOTCH))
    assert filtering is not None
    puts = np.random.default_rng(1).normal(size=200)
    found = []
    for each in puts:
        output = filtering.filtered(float(each))
        filtering.put_out(output)
        found.append(output)
    wanted = signal.lfilter([1.0, NOTCH["ix36"], NOTCH["ix37"]], [1.0, NOTCH["ix38"], NOTCH["ix39"]], puts)
    assert found == pytest.approx(wanted.tolist(), abs=1e-12)


def test_its_coefficients_are_those_of_the_manuals_formulas() -> None:
    """User Manual, Manual Notch Specification: zeros of 90 Hz and 0.1, poles of 110 Hz and 0.8."""
    period_s, zero, pole = 0.0004427, 2 * math.pi * 90.0, 2 * math.pi * 110.0
    above = 1 + 2 * 0.1 * zero * period_s + (zero * period_s) ** 2
    below = 1 + 2 * 0.8 * pole * period_s + (pole * period_s) ** 2
    notch = Notch(
        n1=-2 * (0.1 * zero * period_s + 1) / above,
        n2=1 / above,
        d1=-2 * (0.8 * pole * period_s + 1) / below,
        d2=1 / below,
    )
    assert notch.at_rest == pytest.approx((zero**2 * below) / (pole**2 * above)), "its factor for Ix30, inverted"
    deepest = [abs(complex(notch.at(np.exp([2j * np.pi * hz * period_s]))[0])) for hz in (30.0, 90.0, 300.0)]
    assert deepest[1] < deepest[0] and deepest[1] < 0.5 * deepest[2]


@pytest.mark.parametrize("hz", [40.0, 90.0])
def test_the_loop_with_a_filter_has_the_response_of_the_model(hz: float) -> None:
    lathe = load_machine("lee-2001-lathe").machine
    wanted = complex(loop_of(with_notch(lathe, NOTCH)).closed(hz))
    found = response(hz, 2000.0, axis=held(**NOTCH))
    assert abs(found) == pytest.approx(abs(wanted), rel=0.002)
    assert math.degrees(cmath.phase(found / wanted)) == pytest.approx(0.0, abs=0.15)
    assert abs(wanted - complex(loop_of(lathe).closed(hz))) > 0.05, "the filter makes a difference here"


def test_without_a_filter_nothing_is_computed_otherwise() -> None:
    commands = [500.0 * math.sin(0.11 * cycle) for cycle in range(4000)]
    axis, again = held(), ServoAxis(PLANT, gains(ix36=0.0), CYCLE_S)
    again.close_loop()
    assert axis.follow(commands) == again.follow(commands) and notch_of(gains()) is None


def test_the_output_keeps_its_limit_behind_a_filter_that_would_run_away() -> None:
    axis = held(ix38=1.5, ix39=-0.9)
    axis.follow([float(20 * cycle) for cycle in range(3000)])
    assert abs(axis.output_bits) <= 10_531.0


@pytest.mark.parametrize("dialect", [PMAC, TURBO])
@pytest.mark.parametrize(
    ("given", "kept"), [(-1.5, -1.5), (0.1, 419_430 / 2**22), (2.0, -2.0), (2.5, -1.5), (9.0, 1.0)]
)
def test_a_coefficient_is_a_fraction_of_24_bits_that_wraps(dialect: Dialect, given: float, kept: float) -> None:
    variables = VariableStore({}, dialect)
    variables.set(VariableKind.I, 136, given)
    assert variables.i(136) == kept


def test_a_plant_file_says_how_its_controller_reads_a_filter(tmp_path: Path) -> None:
    file = tmp_path / "other.toml"
    file.write_text('schema = 1\n[controller]\nnotch_reading = "denominator"\n', encoding="utf-8")
    machine = with_notch(load_machine("lee-2001-lathe").machine, {**NOTCH, "ix38": 0.25})
    there = SimulatedLathe(machine, plant_named(str(file), machine, seed=1)).tool
    stated = SimulatedLathe(with_notch(machine, {**NOTCH, "ix38": -0.25, "ix39": -0.1875})).tool
    asked = [40.0 * math.sin(0.2 * cycle) for cycle in range(300)]
    for each in (there, stated):
        each.close_loop()
    assert there.follow(asked) == stated.follow(asked)
