"""The axis behind measured responses, and gains for it: what goes in comes out, and the true loop has margins."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from profiles.axis.loop_design import designed_gains, softer, unseen_hz
from profiles.axis.margins import loop_margins
from profiles.axis.plant_fit import LoopPoint, PlantFit, fitted_plant
from profiles.axis.sampled_loop import AxisPlant, FlexibleMode, SampledLoop, loop_of, profile_plant
from profiles.axis.servo_gains import PidGains, gains_from_variables
from profiles.axis.stiffness import lobe_stiffness, tripping_friction_n
from profiles.store import load_machine
from tests.profiles.test_margins import opened_by_control

MACHINE = load_machine("lee-2001-lathe").machine
LOOP, NOMINAL = loop_of(MACHINE), profile_plant(MACHINE)
THRUST = MACHINE.tool.loop_gain_n_per_v
SLOW = (25.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 95.0)
FAST = (60.0, 75.0, 90.0, 105.0, 120.0, 135.0, 150.0, 165.0, 180.0, 195.0, 210.0, 225.0)
BENDS = FlexibleMode(hz=300.0, damping_ratio=0.02, fraction=0.4)


def opened(true: AxisPlant, gains: PidGains, hz: float, more_damping_per_s: float = 0.0) -> complex:
    """The opened loop at one frequency, one period late, with backward differences.

    Hold and sampling by their definition: the sum of P(s) / s over all aliases of s, times (1 - 1/z) / T.
    """
    period_s, a = LOOP.period_s, true.acceleration_per_v
    s = 2j * np.pi * (hz + np.arange(-400, 401) / period_s)
    plant = a / (s * (s + true.damping_per_s + more_damping_per_s))
    for mode in true.modes:
        omega = 2.0 * math.pi * mode.hz
        plant = plant + mode.fraction * a / (s**2 + 2.0 * mode.damping_ratio * omega * s + omega**2)
    z = np.exp(2j * np.pi * hz * period_s)
    slope = (1.0 - 1.0 / z) / period_s
    sampled = slope * np.sum(plant / s)
    back = gains.kp_v_per_m + gains.ki_v_per_m_s / slope + gains.kd_v_s_per_m * slope
    return complex(sampled * back / z * np.exp(-2j * np.pi * hz * true.delay_s))


def points(
    true: AxisPlant,
    hz: tuple[float, ...],
    amplitude_um: float,
    *,
    friction_n: float = 0.0,
    gains: PidGains = LOOP.gains,
) -> list[LoopPoint]:
    """Responses of the loop with 0.5 % of noise; friction as 4 F / (pi X w) of damping, iterated."""
    found, rng = [], np.random.default_rng(3)
    for f in hz:
        response = 1.0 + 0.0j
        for _ in range(40 if friction_n else 1):
            moved_m_s = amplitude_um * 1e-6 * abs(response) * 2.0 * math.pi * f
            more = 4.0 * friction_n / (math.pi * moved_m_s) * true.acceleration_per_v / THRUST
            loop = opened(true, gains, f, more)
            response = 0.5 * response + 0.5 * loop / (1.0 + loop) if friction_n else loop / (1.0 + loop)
        noise = 1.0 + 0.005 * complex(rng.normal(), rng.normal())
        point = LoopPoint(
            gains=gains, hz=f, response=response * noise, gain_ci=0.01 * abs(response), amplitude_um=amplitude_um
        )
        found.append(point)
    return found


@cache
def fit_of(true: AxisPlant, *, friction_n: float = 0.0, fast: tuple[float, ...] = FAST) -> PlantFit:
    slow = points(true, SLOW, 50.0, friction_n=friction_n)
    found = fitted_plant(LOOP, slow + points(true, fast, 35.0, friction_n=friction_n))
    assert found is not None
    return found


def by_control(loop: SampledLoop) -> tuple[bool, float]:
    """Return stability and sensitivity peak of a loop without an extra delay, by python-control."""
    import control

    other = opened_by_control(loop)
    system = control.ss(other)  # whose `feedback` is no state space with every version of what it rests on
    poles = np.linalg.eigvals(system.A - system.B @ system.C / (1.0 + system.D))
    at = np.exp(2j * np.pi * np.geomspace(0.5, 0.999 * loop.nyquist_hz, 4000) * loop.period_s)
    return bool((np.abs(poles) < 1.0).all()), float((1.0 / np.abs(1.0 + other(at))).max())


def test_mass_friction_and_delay_come_out_of_two_amplitudes() -> None:
    true = AxisPlant(acceleration_per_v=NOMINAL.acceleration_per_v / 1.1, damping_per_s=34.0, delay_s=2e-4)
    found = fit_of(true, friction_n=3.0)
    assert found.holds and found.plant.modes == ()
    assert found.plant.acceleration_per_v == pytest.approx(true.acceleration_per_v, rel=0.03)
    assert found.plant.delay_s == pytest.approx(2e-4, abs=4e-5)
    assert THRUST * found.friction_v == pytest.approx(3.0, abs=1.0)
    assert fitted_plant(LOOP, points(true, SLOW[:4], 50.0)) is None, "too few frequencies"


def test_responses_of_other_gains_are_of_the_same_axis() -> None:
    half = replace(LOOP.gains, kp_v_per_m=0.5 * LOOP.gains.kp_v_per_m)
    found = fitted_plant(LOOP, points(NOMINAL, SLOW, 50.0) + points(NOMINAL, FAST, 35.0, gains=half))
    assert found is not None and found.holds
    assert found.plant.acceleration_per_v == pytest.approx(NOMINAL.acceleration_per_v, rel=0.02)


@pytest.mark.parametrize("fraction", [0.4, 0.05, -0.1])
def test_a_mode_above_the_measured_frequencies_is_found(fraction: float) -> None:
    """Nothing above 225 Hz was measured; it bends at 300 Hz, and what it does below shows it."""
    found = fit_of(replace(NOMINAL, modes=(replace(BENDS, fraction=fraction),)))
    (mode,) = found.plant.modes
    assert mode.hz == pytest.approx(300.0, rel=0.08)
    assert mode.fraction == pytest.approx(fraction, rel=0.4)


def test_gains_for_a_rigid_axis_are_five_times_as_stiff_within_the_margins() -> None:
    """10.9 um/N of the published gains; 8 N of friction trip those (150 um of following error), and not these."""
    found = designed_gains(MACHINE, LOOP, fit_of(NOMINAL), 50.0)
    assert found is not None
    tuned = replace(LOOP, gains=found.gains)
    stable, peak = by_control(tuned)
    assert stable and peak <= 1.85
    margins = loop_margins(tuned)
    assert (margins.phase_margin_deg or 0.0) >= 44.0 and (margins.gain_margin or 0.0) >= 2.4
    before, after = lobe_stiffness(LOOP, THRUST, 50.0), lobe_stiffness(tuned, THRUST, 50.0)
    assert after.most_um_per_n < before.most_um_per_n / 4.5
    assert tripping_friction_n(before, 150.0) < 8.0 < 25.0 < tripping_friction_n(after, 150.0)
    variables = {**MACHINE.controller.variables, **found.settings}
    machine = replace(MACHINE, controller=replace(MACHINE.controller, variables=variables))
    assert gains_from_variables(machine) == found.gains, "in the whole numbers of the controller"


@pytest.mark.parametrize(("heavier", "delay_s"), [(1.06, 0.0), (0.94, 3e-5)])
def test_the_margins_hold_on_an_axis_that_is_not_quite_the_fitted_one(heavier: float, delay_s: float) -> None:
    found = designed_gains(MACHINE, LOOP, fit_of(NOMINAL), 50.0)
    assert found is not None
    plant = replace(NOMINAL, acceleration_per_v=NOMINAL.acceleration_per_v / heavier, delay_s=delay_s)
    margins = loop_margins(replace(LOOP, gains=found.gains, plant=plant))
    assert margins.stable and margins.sensitivity_peak <= 2.0


def test_the_design_for_a_rigid_axis_would_make_one_that_bends_oscillate_and_is_not_proposed() -> None:
    """By python-control: unstable with the gains for the rigid axis, stable with those for the axis that bends."""
    bent = replace(NOMINAL, modes=(BENDS,))
    rigid = designed_gains(MACHINE, LOOP, fit_of(NOMINAL), 50.0)
    assert rigid is not None and by_control(replace(LOOP, plant=bent, gains=rigid.gains))[0] is False
    fit = fit_of(bent)
    found = designed_gains(MACHINE, replace(LOOP, plant=fit.plant), fit, 50.0)
    assert found is not None
    stable, peak = by_control(replace(LOOP, plant=bent, gains=found.gains))
    assert stable and peak <= 2.0
    assert by_control(replace(LOOP, plant=bent))[1] > 3.0, "which the published gains do not even have"


def test_responses_that_would_not_show_a_mode_refuse_faster_gains() -> None:
    known, slow = fit_of(NOMINAL), fitted_plant(LOOP, points(NOMINAL, SLOW, 50.0))
    assert slow is not None
    faster = replace(LOOP.gains, kp_v_per_m=600.0, ki_v_per_m_s=6000.0, kd_v_s_per_m=3.4)
    hidden = unseen_hz(LOOP, faster, slow)
    assert hidden is not None and hidden > 95.0
    assert unseen_hz(LOOP, faster, known) is None
    # What would be hidden there really makes it oscillate: the smallest mode that 95 Hz does not show by 5 %.
    fraction = 0.05 * ((300.0 / 95.0) ** 2 - 1.0)
    bent = replace(NOMINAL, modes=(FlexibleMode(hz=300.0, damping_ratio=0.02, fraction=fraction),))
    assert by_control(replace(LOOP, plant=bent, gains=faster))[0] is False


def test_softer_gains_are_those_with_less_gain_above_the_crossover() -> None:
    half = replace(LOOP.gains, kp_v_per_m=0.5 * LOOP.gains.kp_v_per_m, kd_v_s_per_m=0.5 * LOOP.gains.kd_v_s_per_m)
    assert softer(LOOP, half) and softer(LOOP, LOOP.gains)
    assert not softer(LOOP, replace(LOOP.gains, kd_v_s_per_m=1.1 * LOOP.gains.kd_v_s_per_m))
