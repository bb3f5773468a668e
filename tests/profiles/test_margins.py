"""The servo loop: its response, its margins, its gains."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from profiles.arrays import floats
from profiles.axis.margins import is_stable, loop_margins
from profiles.axis.sampled_loop import AxisPlant, FlexibleMode, SampledLoop, loop_of, profile_plant
from profiles.axis.servo import drive_need, eq9_response, eq9_summary, following_error_um, sampled_response
from profiles.axis.servo_gains import PidGains, eq9_gains, gains_from_variables, variables_from_gains
from profiles.axis.step_figures import error_figures, model_step, step_figures
from profiles.axis.stiffness import compliance_um_per_n, lobe_stiffness
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from profiles.store import load_machine

if TYPE_CHECKING:
    import control

MACHINE = load_machine("lee-2001-lathe").machine


def scale_gain(loop: SampledLoop, factor: float) -> SampledLoop:
    plant = replace(loop.plant, acceleration_per_v=factor * loop.plant.acceleration_per_v)
    return replace(loop, plant=plant)


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
    assert loop.open_loop(hz) == pytest.approx(expected, rel=1e-6)
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
    assert is_stable(scale_gain(loop, 0.999 * found.gain_margin)) and not is_stable(
        scale_gain(loop, 1.001 * found.gain_margin)
    )
    if found.gain_reduction is not None:
        assert not is_stable(scale_gain(loop, 0.999 * found.gain_reduction))
        assert is_stable(scale_gain(loop, 1.001 * found.gain_reduction))
    for factor, stable in ((0.999, True), (1.001, False)):
        plant = replace(loop.plant, delay_s=factor * found.delay_margin_ms / 1000.0)
        assert is_stable(replace(loop, plant=plant)) is stable


def test_a_loop_settles_with_a_delay_within_its_margin() -> None:
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


def test_a_sine_in_time_and_the_peaks_of_a_fine_grid_are_those_in_frequency() -> None:
    for name in ("the paper's", "without integrator", "four times the gain"):
        loop = replace(LOOPS[name], gains=replace(LOOPS[name].gains, acceleration_feedforward_v_s2_per_m=0.004))
        time_s = np.arange(40_000) * loop.period_s
        angle = 2 * np.pi * 30.0 * time_s
        late = model_step(loop, 25.0 * np.sin(angle))[20_000:]
        columns = np.stack([np.sin(angle), np.cos(angle), np.ones_like(angle)], axis=1)[20_000:]
        found = np.linalg.lstsq(columns, late, rcond=None)[0]
        expected = 25.0 * loop.closed_loop(np.array([30.0]))[0]
        assert found[:2] == pytest.approx([expected.real, expected.imag], rel=1e-4, abs=1e-4), name
    loop, found = LOOPS["four times the gain"], loop_margins(LOOPS["four times the gain"])
    hz = np.linspace(0.5, loop.nyquist_hz, 200_001)
    sensitivity, closed = 1.0 / np.abs(1.0 + loop.open_loop(hz)), np.abs(loop.closed_loop(hz))
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
    assert abs(compliance_um_per_n(loop, thrust, [hz])[0]) == pytest.approx(1e6 * amplitude, rel=0.01)


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


# Eq 9 with Table 4, the sampled loop, the controller's gains, and what a sine costs.

LATHE = load_machine("lee-2001-lathe").machine
AT_442_US = replace(LATHE, controller=replace(LATHE.controller, servo_period_ms=0.442))


def servo_with_variables(machine: MachineProfile, changes: dict[str, float]) -> MachineProfile:
    variables = MappingProxyType({**machine.controller.variables, **changes})
    return replace(machine, controller=replace(machine.controller, variables=variables))


@pytest.mark.parametrize(
    ("frequency_hz", "gain", "phase_rad"),
    [
        (10, 1.01305, -0.16910),
        (30, 0.90438, -0.52961),
        (50, 0.74546, -0.78226),
        (70, 0.61172, -0.95014),
        (80, 0.55740, -1.01242),
    ],
)
def test_eq_9(frequency_hz: float, gain: float, phase_rad: float) -> None:
    met = complex(eq9_response(LATHE, frequency_hz))
    assert cmath.polar(met) == pytest.approx((gain, phase_rad), abs=5e-5)


def test_eq_9_in_figures_keeps_the_shape_and_claims_its_bandwidth() -> None:
    assert eq9_response(LATHE, [[0.0, 50.0]]).shape == (1, 2)
    assert complex(eq9_response(LATHE, 0.0)) == pytest.approx(1)
    summary = eq9_summary(LATHE)
    assert summary.bandwidth_hz == pytest.approx(55.2467, abs=0.001)
    assert summary.overshoot_percent == pytest.approx(2.309, abs=0.002)
    assert (summary.peak, summary.peak_hz) == pytest.approx((1.01352, 8.85), abs=0.01)
    assert summary.crossover_hz == pytest.approx(52.77, abs=0.01)
    assert summary.phase_margin_deg == pytest.approx(87.2, abs=0.05)
    assert math.isinf(summary.gain_margin)
    light = replace(LATHE, tool=replace(LATHE.tool, moving_mass_kg=2.95))
    assert eq9_summary(light).bandwidth_hz == pytest.approx(82.51, abs=0.01)


@pytest.mark.parametrize(
    ("frequency_hz", "gain", "phase_rad"),
    [(10, 1.0215, -0.168), (30, 0.9811, -0.556), (50, 0.8850, -0.903), (70, 0.7777, -1.207)],
)
def test_the_sampled_loop(frequency_hz: float, gain: float, phase_rad: float) -> None:
    met = complex(sampled_response(AT_442_US, frequency_hz, eq9_gains(AT_442_US)))
    assert cmath.polar(met) == pytest.approx((gain, phase_rad), abs=5e-4)
    # The controller's rounded gains at its own period make nearly the same loop.
    rounded = complex(sampled_response(LATHE, frequency_hz))
    assert cmath.polar(rounded) == pytest.approx((gain, phase_rad), abs=2e-3)


def run_in_time(machine: MachineProfile, frequency_hz: float, cycles: int) -> list[float]:
    """Positions in counts for a cosine of 100 counts: the controller's difference equation, exact motion."""
    tool, period = machine.tool, machine.controller.servo_period_ms / 1000
    ix = {name[2:]: value for name, value in machine.controller.variables.items() if name.startswith("I1")}
    time_constant = tool.moving_mass_kg / tool.damping_n_s_per_m
    decay = math.exp(-period / time_constant)
    position = speed = volts = integral = 0.0
    commands, positions = [100.0, 100.0], [100.0, 100.0]
    for cycle in range(cycles):
        commands.append(100 * math.cos(2 * math.pi * frequency_hz * cycle * period))
        positions.append(position * tool.counts_per_mm * 1000)
        error = commands[-1] - positions[-1]
        integral += error
        velocity = commands[-1] - commands[-2]
        acceleration = commands[-1] - 2 * commands[-2] + commands[-3]
        ahead = (ix["32"] * velocity + ix["35"] * acceleration) / 128
        damped = ix["31"] * ix["09"] * (positions[-1] - positions[-2]) / 128
        bits = ix["30"] / 2**19 * (ix["08"] * (error + ahead + ix["33"] * integral / 2**23) - damped)
        # What was computed in the cycle before acts during this one.
        final = volts * tool.loop_gain_n_per_v / tool.damping_n_s_per_m
        position += final * period + (speed - final) * time_constant * (1 - decay)
        speed = final + (speed - final) * decay
        volts = bits * 10 / 32768
    return positions[2:]


@pytest.mark.parametrize("ix35", [0, 30_000])
@pytest.mark.parametrize("frequency_hz", [25.0, 50.0, 150.0])
def test_the_sampled_loop_is_its_difference_equation(frequency_hz: float, ix35: float) -> None:
    machine = servo_with_variables(LATHE, {"I135": ix35})
    met = np.array(run_in_time(machine, frequency_hz, 4000)[-2000:])
    cycles = np.arange(4000)[-2000:]
    angle = 2 * math.pi * frequency_hz * cycles * machine.controller.servo_period_ms / 1000
    # The integrator is still settling: a slow part beside the sine.
    basis = np.column_stack((np.cos(angle), np.sin(angle), cycles**0, cycles, cycles**2))
    cosine, sine = np.linalg.lstsq(basis, met, rcond=None)[0][:2]
    expected = complex(sampled_response(machine, frequency_hz))
    assert complex(cosine, -sine) / 100 == pytest.approx(expected, abs=1e-4)


def test_loops_that_are_slow_undamped_or_follow_behind() -> None:
    gains = replace(eq9_gains(AT_442_US), velocity_feedforward_v_s_per_m=0.0)
    assert abs(complex(sampled_response(AT_442_US, 9.7, gains))) == pytest.approx(math.sqrt(0.5), abs=0.01)
    tool = replace(LATHE.tool, damping_n_s_per_m=0.0)
    nearly = replace(LATHE.tool, damping_n_s_per_m=0.02)
    met, limit = (complex(sampled_response(replace(LATHE, tool=t), 50.0)) for t in (tool, nearly))
    assert met == pytest.approx(limit, abs=1e-4)
    assert complex(sampled_response(LATHE, 0.0)) == pytest.approx(1, abs=1e-3)
    assert 22 < following_error_um(LATHE, 27.5, 50.0) < 30
    assert LATHE.controller.variables["I111"] / 16 * LATHE.tool.count_um > 3 * following_error_um(
        LATHE, 27.5, 50.0
    )


def test_the_published_gains_as_whole_numbers() -> None:
    found = variables_from_gains(AT_442_US, eq9_gains(AT_442_US))
    assert found["I130"] == 528
    assert found["I131"] == found["I132"] == pytest.approx(4905, abs=5)
    assert found["I133"] == pytest.approx(811, abs=1)
    assert (found["I134"], found["I135"]) == (0, 0)
    tool = AT_442_US.tool
    base = eq9_gains(AT_442_US)
    full = replace(
        base,
        velocity_feedforward_v_s_per_m=base.kd_v_s_per_m + tool.damping_n_s_per_m / tool.loop_gain_n_per_v,
        acceleration_feedforward_v_s2_per_m=tool.moving_mass_kg / tool.loop_gain_n_per_v,
    )
    found = variables_from_gains(AT_442_US, full)
    assert found["I135"] == pytest.approx(33718, rel=1e-3)
    assert found["I132"] - found["I131"] == pytest.approx(634, abs=2)
    met, published = gains_from_variables(LATHE), eq9_gains(LATHE)
    assert met.kp_v_per_m == pytest.approx(published.kp_v_per_m, rel=1e-3)
    assert met.ki_v_per_m_s == pytest.approx(published.ki_v_per_m_s, rel=5e-3)
    assert met.kd_v_s_per_m == pytest.approx(published.kd_v_s_per_m, rel=2e-3)
    assert met.velocity_feedforward_v_s_per_m == pytest.approx(published.kd_v_s_per_m, rel=2e-3)


@given(st.floats(50, 5000), st.floats(1, 1000), st.floats(0.5, 20), st.floats(0, 20), st.floats(0, 0.02))
def test_gains_survive_the_conversion(kp: float, ki: float, kd: float, kv: float, ka: float) -> None:
    gains = PidGains(
        kp_v_per_m=kp,
        ki_v_per_m_s=ki,
        kd_v_s_per_m=kd,
        velocity_feedforward_v_s_per_m=kv,
        acceleration_feedforward_v_s2_per_m=ka,
    )
    met = gains_from_variables(servo_with_variables(LATHE, dict(variables_from_gains(LATHE, gains))))
    assert met.kp_v_per_m == pytest.approx(kp, rel=3e-3)
    assert met.ki_v_per_m_s == pytest.approx(ki, rel=0.01, abs=0.2 * kp / 1000)
    assert met.kd_v_s_per_m == pytest.approx(kd, rel=1e-3, abs=kp * 2e-6)
    assert met.velocity_feedforward_v_s_per_m == pytest.approx(kv, rel=1e-3, abs=kp * 2e-6)


def test_gains_that_do_not_count_or_are_missing() -> None:
    assert gains_from_variables(servo_with_variables(LATHE, {"I134": 1})).ki_v_per_m_s == 0
    left = {name: value for name, value in LATHE.controller.variables.items() if name not in {"I130", "I133"}}
    machine = replace(LATHE, controller=replace(LATHE.controller, variables=left))
    with pytest.raises(ProfileError) as caught:
        gains_from_variables(machine)
    assert [problem.key[-4:] for problem in caught.value.problems] == ["I130", "I133"]


@pytest.mark.parametrize(
    ("amplitude_um", "frequency_hz", "expected"),
    [
        (27.5, 50, (8.639, 2.714, 12.98, 0.238, 0.960, 0.108)),
        (16.5, 50, (5.184, 1.629, 7.79, 0.143, 0.576, 0.039)),
        (27.5, 150, (25.92, 24.43, 115.9, 2.127, 11.98, 8.59)),
        (100, 150, (94.25, 88.83, 421.5, 7.733, 43.6, 113.6)),
    ],
)
def test_what_a_sine_costs(amplitude_um: float, frequency_hz: float, expected: tuple[float, ...]) -> None:
    need = drive_need(LATHE, amplitude_um, frequency_hz)
    met = (
        need.velocity_mm_per_s,
        need.acceleration_m_per_s2,
        need.force_n,
        need.current_a,
        need.voltage_v,
        need.copper_loss_w,
    )
    assert met == pytest.approx(expected, rel=3e-3, abs=6e-4)
