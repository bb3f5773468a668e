"""Margins of the sampled loop against python-control, and against what happens when they are used up."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from profiles.arrays import floats
from profiles.axis.margins import is_stable, loop_margins
from profiles.axis.sampled_loop import AxisPlant, FlexibleMode, SampledLoop, loop_of, profile_plant
from profiles.axis.servo import sampled_response
from profiles.axis.step_figures import error_figures, modelled, step_figures
from profiles.axis.stiffness import compliance_um_per_n, lobe_stiffness
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from profiles.store import load_machine

if TYPE_CHECKING:  # its import takes longer than these tests, in each process that collects them
    import control

MACHINE = load_machine("lee-2001-lathe").machine


def with_variables(machine: MachineProfile, **changes: float) -> MachineProfile:
    variables = {**machine.controller.variables, **changes}
    return replace(machine, controller=replace(machine.controller, variables=variables))


def flexible(hz: float, ratio: float, fraction: float, *more: FlexibleMode) -> AxisPlant:
    mode = FlexibleMode(hz=hz, damping_ratio=ratio, fraction=fraction)
    return replace(profile_plant(MACHINE), modes=(mode, *more))


SECOND = FlexibleMode(hz=700.0, damping_ratio=0.03, fraction=0.2)
LOOPS = {
    "the paper's": loop_of(MACHINE),
    "four times the gain": loop_of(with_variables(MACHINE, I130=2112)),
    "without integrator": loop_of(with_variables(MACHINE, I133=0)),
    "a strong integrator": loop_of(with_variables(MACHINE, I133=400_000)),
    "unstable": loop_of(with_variables(MACHINE, I130=40_000)),
    "without friction": loop_of(MACHINE, AxisPlant(acceleration_per_v=131.6, damping_per_s=0.0)),
    "a small mode": loop_of(MACHINE, flexible(300.0, 0.02, 0.05)),
    "two modes": loop_of(MACHINE, flexible(300.0, 0.05, -0.1, SECOND)),
    "a mode that swings up": loop_of(MACHINE, flexible(300.0, 0.02, 1.0)),
}


UNSTABLE = ("unstable", "a mode that swings up")


def opened_by_control(loop: SampledLoop) -> control.TransferFunction:
    """The opened loop from textbook parts, by another program: hold, one period of delay, backward differences."""
    import control

    a, b, period_s = loop.plant.acceleration_per_v, loop.plant.damping_per_s, loop.period_s
    moved = control.ss(control.TransferFunction([a], [1.0, b, 0.0]))
    for mode in loop.plant.modes:
        omega = 2.0 * math.pi * mode.hz
        bends = control.TransferFunction([mode.fraction * a], [1.0, 2.0 * mode.damping_ratio * omega, omega**2])
        moved = moved + control.ss(bends)
    plant = control.c2d(moved, period_s, method="zoh")
    gains = loop.gains
    delay = control.TransferFunction([1.0], [1.0, 0.0], period_s)
    slope = control.TransferFunction([1.0, -1.0], [period_s, 0.0], period_s)
    back = gains.kp_v_per_m + gains.kd_v_s_per_m * slope
    if gains.ki_v_per_m_s:
        back = back + gains.ki_v_per_m_s * control.TransferFunction([period_s, 0.0], [1.0, -1.0], period_s)
    return control.ss2tf(plant) * delay * back


@pytest.mark.parametrize("name", LOOPS)
def test_the_opened_loop_and_its_stability_are_those_of_another_program(name: str) -> None:
    import control

    loop = LOOPS[name]
    other = opened_by_control(loop)
    hz = np.array([0.5, 5.0, 50.0, 400.0, 1000.0])
    expected = np.array([other(np.exp(2j * np.pi * f * loop.period_s)) for f in hz])
    assert loop.opened(hz) == pytest.approx(expected, rel=1e-6)
    poles = control.feedback(other, 1).poles()
    assert is_stable(loop) is bool((np.abs(poles) < 1.0 - 1e-9).all()) is (name not in UNSTABLE)


@pytest.mark.first(2)
@pytest.mark.parametrize("name", [name for name in LOOPS if name not in UNSTABLE])
def test_the_margins_are_those_of_another_program(name: str) -> None:
    import control

    loop = LOOPS[name]
    found = loop_margins(loop)
    # Not by the roots of its polynomials: there it finds a crossing at 12 Hz, where |L| is 3.2.
    hz = np.geomspace(0.001, 0.9999 * loop.nyquist_hz, 4_000)
    other = opened_by_control(loop)
    response = other(np.exp(2j * np.pi * hz * loop.period_s))
    sampled = control.FRD(response, 2 * np.pi * hz, smooth=True)
    gains, phases_deg, _, gains_at, phases_at, _ = control.stability_margins(sampled, returnall=True)
    above = min((g, f) for g, f in zip(gains, gains_at, strict=True) if g > 1.0 and f > 0.0)
    assert (found.gain_margin, found.gain_margin_hz) == pytest.approx(
        (above[0], above[1] / (2 * math.pi)), rel=1e-4
    )
    margin, at = min(zip(np.abs(phases_deg), phases_at, strict=True))
    assert (found.phase_margin_deg, found.crossover_hz) == pytest.approx((margin, at / (2 * math.pi)), rel=1e-4)
    assert found.delay_margin_ms == pytest.approx(1000.0 * math.radians(margin) / at, rel=1e-4)


@pytest.mark.parametrize("name", ["the paper's", "four times the gain", "a strong integrator"])
def test_a_loop_becomes_unstable_just_when_a_margin_is_used_up(name: str) -> None:
    loop, found = LOOPS[name], loop_margins(LOOPS[name])
    assert found.gain_margin is not None and found.delay_margin_ms is not None
    assert is_stable(loop.scaled(0.999 * found.gain_margin)) and not is_stable(
        loop.scaled(1.001 * found.gain_margin)
    )
    if found.gain_reduction is not None:
        assert not is_stable(loop.scaled(0.999 * found.gain_reduction))
        assert is_stable(loop.scaled(1.001 * found.gain_reduction))
    for factor, stable in ((0.999, True), (1.001, False)):
        plant = replace(loop.plant, delay_s=factor * found.delay_margin_ms / 1000.0)
        assert is_stable(replace(loop, plant=plant)) is stable


def test_the_delay_margin_is_that_of_the_loop_in_steps_of_time() -> None:
    """The difference equation with so many periods of delay settles, with one more it grows."""
    loop = LOOPS["the paper's"]
    delay_ms = loop_margins(loop).delay_margin_ms
    assert delay_ms is not None
    whole = math.floor(delay_ms / 1000.0 / loop.period_s)
    assert whole >= 1
    assert swings(loop, whole) < 1.0 < swings(loop, whole + 1)


def swings(loop: SampledLoop, delay: int) -> float:
    """How much a disturbance has grown from the first to the second half of a long time."""
    import control

    plant = control.c2d(
        control.ss(
            control.TransferFunction([loop.plant.acceleration_per_v], [1.0, loop.plant.damping_per_s, 0.0])
        ),
        loop.period_s,
        method="zoh",
    )
    a, b, c = np.asarray(plant.A), np.asarray(plant.B)[:, 0], np.asarray(plant.C)[0]
    state, late, before, total, seen = np.zeros(2), [0.0] * (1 + delay), 0.0, 0.0, []
    state = state + b
    for _ in range(4000):
        error = -float(c @ state)
        total += error * loop.period_s
        slope = (float(c @ state) - before) / loop.period_s
        before = float(c @ state)
        gains = loop.gains
        output = gains.kp_v_per_m * error + gains.ki_v_per_m_s * total - gains.kd_v_s_per_m * slope
        late.append(output)
        state = a @ state + b * late.pop(0)
        seen.append(abs(error))
    return max(seen[3000:]) / max(seen[1000:2000])


def test_the_closed_loop_is_the_one_that_a_cut_inverts() -> None:
    hz = np.array([1.0, 10.0, 50.0, 70.0, 300.0])
    feedforward = with_variables(MACHINE, I135=20_000)
    assert loop_of(feedforward).closed(hz) == pytest.approx(sampled_response(feedforward, hz), rel=1e-9)


def test_in_time_it_makes_of_a_sine_what_it_does_in_frequency() -> None:
    for name in ("the paper's", "without integrator", "four times the gain"):
        loop = replace(LOOPS[name], gains=replace(LOOPS[name].gains, acceleration_feedforward_v_s2_per_m=0.004))
        time_s = np.arange(40_000) * loop.period_s
        angle = 2 * np.pi * 30.0 * time_s
        late = modelled(loop, 25.0 * np.sin(angle))[20_000:]
        columns = np.stack([np.sin(angle), np.cos(angle), np.ones_like(angle)], axis=1)[20_000:]
        found = np.linalg.lstsq(columns, late, rcond=None)[0]
        expected = 25.0 * loop.closed(np.array([30.0]))[0]
        assert found[:2] == pytest.approx([expected.real, expected.imag], rel=1e-4, abs=1e-4), name


def test_sensitivity_bandwidth_and_peak_are_those_of_a_fine_grid() -> None:
    loop, found = LOOPS["four times the gain"], loop_margins(LOOPS["four times the gain"])
    hz = np.linspace(0.5, loop.nyquist_hz, 200_001)
    sensitivity, closed = 1.0 / np.abs(1.0 + loop.opened(hz)), np.abs(loop.closed(hz))
    assert found.sensitivity_peak == pytest.approx(sensitivity.max(), rel=1e-6)
    assert found.sensitivity_peak_hz == pytest.approx(hz[sensitivity.argmax()], abs=0.5)
    assert found.peak == pytest.approx(closed.max(), rel=1e-6)
    assert found.bandwidth_hz == pytest.approx(hz[np.argmax(closed < math.sqrt(0.5))], abs=0.01)
    assert found.sensitivity_peak >= 1.0 / (2.0 * math.sin(math.radians(found.phase_margin_deg or 0.0) / 2.0))


def test_the_figures_of_a_step_are_those_of_the_textbook() -> None:
    """Second order, damping 0.5: 16.3 % of overshoot (K. Ogata). First order: it rises in 2.197 tau."""
    time_s = floats(np.arange(4000) * 1e-4)
    reference = floats(np.where(time_s >= 0.01, 25.0, 0.0))
    t = np.maximum(time_s - 0.01, 0.0)
    tau = 0.02
    first = step_figures(time_s, reference, floats(25.0 * (1 - np.exp(-t / tau))), least_um=0.4)
    assert first.rise_ms == pytest.approx(1000 * tau * math.log(9.0), rel=1e-3)
    assert first.settling_ms == pytest.approx(1000 * tau * math.log(20.0), abs=0.2)
    assert (first.size_um, first.overshoot_percent) == (25.0, 0.0)
    w, damped = 200.0, 200.0 * math.sqrt(0.75)
    swing = 1 - np.exp(-0.5 * w * t) * (np.cos(damped * t) + 0.5 * w / damped * np.sin(damped * t))
    second = step_figures(time_s, reference, floats(25.0 * swing), least_um=0.4)
    assert second.overshoot_percent == pytest.approx(16.30, abs=0.05)
    stuck = step_figures(time_s, reference, floats(0.7 * reference), least_um=0.4)
    assert stuck.rise_ms is None and stuck.settling_ms is None and stuck.end_um == pytest.approx(7.5)
    with pytest.raises(ProfileError, match="health"):
        step_figures(time_s, floats(0.0 * reference), reference, least_um=0.4)
    error = error_figures(np.array([3.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 4.0]))
    assert (error.peak_um, error.rms_um) == (4.0, 2.5)


@pytest.mark.parametrize("hz", [10.0, 50.0, 150.0])
def test_the_compliance_is_what_a_sine_of_force_does_to_the_loop_in_time(hz: float) -> None:
    """1 N at the tool, integrated at a hundredth of the period beside the controller's difference equation."""
    loop, thrust = LOOPS["the paper's"], MACHINE.tool.loop_gain_n_per_v
    gains, plant, period_s, fine = loop.gains, loop.plant, loop.period_s, 100
    step_s, mass = period_s / fine, thrust / plant.acceleration_per_v
    x = v = volts = waiting = integral = last = 0.0
    seen = []
    cycles = int(1.5 / period_s)
    for cycle in range(cycles):
        integral -= x * period_s
        output = -gains.kp_v_per_m * x + gains.ki_v_per_m_s * integral - gains.kd_v_s_per_m * (x - last) / period_s
        last, volts, waiting = x, waiting, output
        for part in range(fine):
            time_s = cycle * period_s + part * step_s
            force = math.cos(2.0 * math.pi * hz * (time_s + 0.5 * step_s))
            v += step_s * (plant.acceleration_per_v * volts - plant.damping_per_s * v + force / mass)
            x += step_s * v
        if cycle * period_s > 1.5 - 5.0 / hz:
            seen.append(((cycle + 1) * period_s, x))
    time, moved = np.array(seen).T
    wave = np.stack([np.cos(2 * np.pi * hz * time), np.sin(2 * np.pi * hz * time), np.ones_like(time)], axis=1)
    amplitude = np.hypot(*np.linalg.lstsq(wave, moved, rcond=None)[0][:2])
    assert compliance_um_per_n(loop, thrust, [hz])[0] == pytest.approx(1e6 * amplitude, rel=0.01)


def test_the_published_gains_are_soft_at_the_lobe_and_stiffer_ones_are_not() -> None:
    """Steadily 1 / (624 x 147.5) m/N, and 1.75 um/N at 50 Hz; with Kp 1100, Ki 22000, Kd 4.75 at most 1.5."""
    thrust, loop = MACHINE.tool.loop_gain_n_per_v, LOOPS["the paper's"]
    soft = lobe_stiffness(loop, thrust, 50.0)
    assert soft.hz == (50.0, 100.0, 150.0)
    assert soft.most_um_per_n == pytest.approx(10.86, abs=0.03)
    assert soft.um_per_n[0] == pytest.approx(1.75, abs=0.01)
    stiff = replace(
        loop.gains,
        kp_v_per_m=1100.0,
        ki_v_per_m_s=22_000.0,
        kd_v_s_per_m=4.75,
        velocity_feedforward_v_s_per_m=4.75,
    )
    hard = lobe_stiffness(replace(loop, gains=stiff), thrust, 50.0)
    assert hard.most_um_per_n == pytest.approx(1.5, abs=0.02)
    assert loop_margins(replace(loop, gains=stiff)).sensitivity_peak == pytest.approx(1.9, abs=0.02)
