"""Dry friction that builds up over a distance: by its differential equation, and by what it does to a tool."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drivers.pmac.settings import settings_with
from drivers.simulator.card.servo import ServoAxis
from drivers.simulator.plant.driven_mass import Presliding, linear_motor
from drivers.simulator.plant.drives import build_drives
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.servo_gains import ServoGains
from drivers.simulator.plant.true_parameters import ideal
from profiles.machine import MachineProfile

CYCLE_S = 3_713_707 / 8_388_608_000
MASS_KG, DAMPING, FRICTION_N, DISTANCE_M = 4.74, 163.4, 3.0, 5e-6
N_PER_BIT, COUNTS_PER_M = 624.025 * 10 / 32_768, 5e6
GAINS = ServoGains(ix08=96, ix09=96, ix30=528, ix31=4905, ix32=0, ix33=811, ix34=0, ix35=0, ix69=32_767)


def moved_um(forces_n: list[float], cycles: int) -> np.ndarray:
    """Where a slide with this friction goes under each of these forces for so many servo cycles."""
    slide = linear_motor(
        mass_kg=MASS_KG,
        damping_n_s_per_m=DAMPING,
        force_n_per_bit=N_PER_BIT,
        peak_output_bits=32_767,
        counts_per_m=COUNTS_PER_M,
    )
    limit = FRICTION_N / MASS_KG * COUNTS_PER_M
    axis = ServoAxis(slide, GAINS, CYCLE_S, load=Presliding(limit, DISTANCE_M * COUNTS_PER_M, None))
    at: list[float] = []
    for force_n in forces_n:
        at += axis.push(force_n / N_PER_BIT / 32_767, cycles)
    return np.array(at) / COUNTS_PER_M * 1e6


def by_equation_um(forces_n: list[float], cycles: int) -> np.ndarray:
    """m x" = F - B x' - f with f' = (F_c x' - f |x'|) / s; a force acts one servo cycle later."""
    from scipy.integrate import solve_ivp

    def slope(time_s: float, state: np.ndarray) -> list[float]:
        _, speed, friction_n = state
        place = math.floor(time_s / CYCLE_S + 1e-9) - 1
        force_n = forces_n[min(place // cycles, len(forces_n) - 1)] if place >= 0 else 0.0
        grown = (FRICTION_N * speed - friction_n * abs(speed)) / DISTANCE_M
        return [speed, (force_n - DAMPING * speed - friction_n) / MASS_KG, grown]

    times_s = np.arange(cycles * len(forces_n)) * CYCLE_S
    found = solve_ivp(
        slope, (0.0, times_s[-1]), [0.0, 0.0, 0.0], t_eval=times_s, max_step=CYCLE_S / 5, rtol=1e-8, atol=1e-12
    )
    return np.asarray(found.y[0]) * 1e6


@pytest.mark.parametrize("forces_n", [[2.0, 0.0, -2.0, 0.0], [4.0, -4.0, 2.5, 0.0]], ids=["before", "sliding"])
def test_it_moves_as_its_differential_equation_says(forces_n: list[float]) -> None:
    cycles = 120
    at, expected = moved_um(forces_n, cycles), by_equation_um(forces_n, cycles)
    assert abs(at - expected).max() < 0.02 * np.ptp(expected)


def test_below_the_limit_the_slide_is_on_a_spring_that_keeps_a_part() -> None:
    """2 N of 3 N: x = -s ln(1 - 2/3) = 5.49 um; unloaded, F = 0 is reached s ln(1 + 2/3) = 2.55 um back."""
    slowly = np.linspace(0.0, 2.0, 4001)
    at = moved_um([*slowly, *slowly[::-1]], 1)
    assert at[4001] == pytest.approx(5.49, abs=0.1)
    assert at[-1] == pytest.approx(5.49 - 2.55, abs=0.1)


def test_a_tool_on_its_guides_answers_a_small_push_at_once(machine: MachineProfile) -> None:
    """With friction that is there at once 2 N move nothing; the plant has what its file says."""
    true = plant_named("steady", machine, 1)
    for presliding_um, least_um, most_um in ((0.0, 0.0, 0.0), (4.0, 3.0, 6.0)):
        still: Any = replace(true, presliding_um=presliding_um, encoder_noise_um=0.0, current_lag_s=0.0)
        tool = build_drives(machine, still, settings_with(machine.controller.variables)).tool
        bits = 2.0 / (true.force_n_per_v * 10 / 32_768)
        places = [place for part in range(4001) for place in tool.push(part / 4000 * bits / 10_531, 1)]
        moved = (places[-1] - places[0]) / machine.tool.counts_per_mm * 1000.0
        assert least_um <= abs(moved) <= most_um
    assert ideal(machine).presliding_um == 0.0
