"""An axis with a lag of its current and modes, behind responses that another program computes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import control
import numpy as np
import pytest

from profiles.axis.margins import is_stable, loop_margins
from profiles.axis.plant_fit import LoopPoint, PlantFit, fitted_plant
from profiles.axis.sampled_loop import AxisPlant, FlexibleMode, SampledLoop, loop_of
from profiles.store import load_machine

LOOP = loop_of(load_machine("lee-2001-lathe").machine)
BENDS = FlexibleMode(hz=300.0, damping_ratio=0.02, fraction=0.4)
LATER = AxisPlant(acceleration_per_v=103.0, damping_per_s=37.0, lag_s=4e-4, modes=(BENDS,))
SLOW = (
    25.0,
    30.0,
    40.0,
    50.0,
    60.0,
    70.0,
    80.0,
    95.0,
    105.0,
    120.0,
    135.0,
    150.0,
    165.0,
    180.0,
    195.0,
    210.0,
    225.0,
)
FAST = (240.0, 270.0, 290.0, 310.0, 340.0, 400.0, 440.0)
SEEDS = range(3)


def plant_by_control(true: AxisPlant) -> control.TransferFunction:
    """The axis behind its hold, by python-control: zero-order-hold sampling of a state space."""
    s = control.tf("s")
    total = 1.0 / (s * (s + true.damping_per_s))
    for mode in true.modes:
        omega = 2.0 * np.pi * mode.hz
        total += mode.fraction / (s**2 + 2.0 * mode.damping_ratio * omega * s + omega**2)
    held = control.ss(control.minreal(true.acceleration_per_v * total / (1.0 + true.lag_s * s), verbose=False))
    return control.sample_system(held, LOOP.period_s, "zoh")


def response(true: AxisPlant, hz: tuple[float, ...]) -> np.ndarray:
    """The response of the loop, one period late, with backward differences."""
    z = np.exp(2j * np.pi * np.array(hz) * LOOP.period_s)
    gains, slope = LOOP.gains, (1.0 - 1.0 / z) / LOOP.period_s
    plant = (
        np.array([plant_by_control(true)(each) for each in z])
        / z
        * np.exp(-2j * np.pi * np.array(hz) * true.delay_s)
    )
    opened = plant * (gains.kp_v_per_m + gains.ki_v_per_m_s / slope + gains.kd_v_s_per_m * slope)
    return opened / (1.0 + opened)  # the velocity feedforward is that of the derivative


@cache
def fit_of(true: AxisPlant, hz: tuple[float, ...], seed: int) -> PlantFit:
    """A fit to responses with 0.1 % of noise."""
    rng = np.random.default_rng(seed)
    found = response(true, hz) * (1.0 + 0.001 * (rng.normal(size=len(hz)) + 1j * rng.normal(size=len(hz))))
    fit = fitted_plant(
        LOOP,
        [
            LoopPoint(gains=LOOP.gains, hz=f, response=complex(t), gain_ci=0.002 * abs(t), amplitude_um=35.0)
            for f, t in zip(hz, found, strict=True)
        ],
    )
    assert fit is not None
    return fit


@pytest.mark.parametrize("lag_s", [1e-5, 4e-4, 2e-3])
@pytest.mark.parametrize("damping_per_s", [0.0, 37.0])
def test_a_lag_is_sampled_as_python_control_samples_it(lag_s: float, damping_per_s: float) -> None:
    true = replace(LATER, lag_s=lag_s, damping_per_s=damping_per_s)
    hz = (5.0, 100.0, 299.0, 300.0, 500.0, 1000.0)
    assert replace(LOOP, plant=true).closed_loop(hz) == pytest.approx(response(true, hz), rel=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_lag_is_told_from_a_delay_and_from_a_mode_above_the_measured_frequencies(seed: int) -> None:
    """Taken for a delay, a lag of 0.4 ms moves the mode to 360 Hz and 85 %, the loop unstable."""
    fit = fit_of(LATER, SLOW, seed)
    (mode,) = fit.plant.modes
    assert fit.holds and fit.plant.delay_s == 0.0
    assert fit.plant.lag_s == pytest.approx(4e-4, abs=3e-5)
    assert mode.hz == pytest.approx(300.0, abs=15.0)
    assert mode.fraction == pytest.approx(0.4, abs=0.06)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_delay_is_no_lag_and_both_are_told_apart(seed: int) -> None:
    late = fit_of(replace(LATER, lag_s=0.0, delay_s=3e-4), SLOW + FAST, seed).plant
    assert late.lag_s == 0.0 and late.delay_s == pytest.approx(3e-4, abs=2e-5)
    both = fit_of(replace(LATER, delay_s=2e-4), SLOW + FAST, seed).plant
    assert both.lag_s == pytest.approx(4e-4, abs=5e-5)
    assert both.delay_s == pytest.approx(2e-4, abs=5e-5)


@pytest.mark.parametrize("seed", SEEDS)
def test_two_modes_are_found_where_both_were_measured(seed: int) -> None:
    second = FlexibleMode(hz=410.0, damping_ratio=0.03, fraction=-0.15)
    fit = fit_of(replace(LATER, modes=(BENDS, second)), (*SLOW, *FAST, 380.0, 420.0, 460.0), seed)
    first, other = sorted(fit.plant.modes, key=lambda mode: mode.hz)
    assert [first.hz, other.hz] == pytest.approx([300.0, 410.0], rel=0.01)
    assert [first.fraction, other.fraction] == pytest.approx([0.4, -0.15], rel=0.2)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_measured_loop_is_stable_by_its_fit_with_the_gain_margin_of_python_control(seed: int) -> None:
    """Its gain margin is 1.14: half the damping of the mode would be unstable."""
    below, through = fit_of(LATER, SLOW, seed), fit_of(LATER, SLOW + FAST, seed)
    for fit in (below, through):
        assert not fit.denied and is_stable(replace(LOOP, plant=fit.plant))
    found = loop_margins(replace(LOOP, plant=through.plant)).gain_margin
    assert found == pytest.approx(control_gain_margin(replace(LOOP, plant=LATER)), abs=0.03)


def control_gain_margin(loop: SampledLoop) -> float:
    """The least factor of gain above 1 at which the loop is unstable, by the poles of python-control."""
    z, gains, period_s = control.tf([1, 0], [1], LOOP.period_s), loop.gains, loop.period_s
    slope = (1 - 1 / z) / period_s
    regulator = control.ss(gains.kp_v_per_m + gains.ki_v_per_m_s / slope + gains.kd_v_s_per_m * slope)
    opened = plant_by_control(loop.plant) * regulator * control.ss(1 / z)
    low, high = 1.0, 10.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        poles = np.linalg.eigvals(opened.A - opened.B @ opened.C * middle / (1.0 + middle * opened.D))
        low, high = (middle, high) if (np.abs(poles) < 1.0).all() else (low, middle)
    return low
