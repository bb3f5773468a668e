"""Eq 9 with Table 4, the sampled loop, the controller's gains, and what a sine costs."""

import cmath
import math
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from profiles.axis.servo import drive_need, eq9_response, eq9_summary, following_error_um, sampled_response
from profiles.axis.servo_gains import PidGains, eq9_gains, gains_from_variables, variables_from_gains
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from profiles.store import load_machine

LATHE = load_machine("lee-2001-lathe").machine
AT_442_US = replace(LATHE, controller=replace(LATHE.controller, servo_period_ms=0.442))


def with_variables(machine: MachineProfile, changes: dict[str, float]) -> MachineProfile:
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


def test_eq_9_keeps_the_shape_and_holds_still() -> None:
    assert eq9_response(LATHE, [[0.0, 50.0]]).shape == (1, 2)
    assert complex(eq9_response(LATHE, 0.0)) == pytest.approx(1)


def test_eq_9_in_figures() -> None:
    summary = eq9_summary(LATHE)
    assert summary.bandwidth_hz == pytest.approx(55.2467, abs=0.001)
    assert summary.overshoot_percent == pytest.approx(2.309, abs=0.002)
    assert (summary.peak, summary.peak_hz) == pytest.approx((1.01352, 8.85), abs=0.01)
    assert summary.crossover_hz == pytest.approx(52.77, abs=0.01)
    assert summary.phase_margin_deg == pytest.approx(87.2, abs=0.05)
    assert math.isinf(summary.gain_margin)


def test_the_coil_alone_gives_the_bandwidth_that_the_paper_claims() -> None:
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
    machine = with_variables(LATHE, {"I135": ix35})
    met = np.array(run_in_time(machine, frequency_hz, 4000)[-2000:])
    cycles = np.arange(4000)[-2000:]
    angle = 2 * math.pi * frequency_hz * cycles * machine.controller.servo_period_ms / 1000
    # The integrator is still settling: a slow part beside the sine.
    basis = np.column_stack((np.cos(angle), np.sin(angle), cycles**0, cycles, cycles**2))
    cosine, sine = np.linalg.lstsq(basis, met, rcond=None)[0][:2]
    expected = complex(sampled_response(machine, frequency_hz))
    assert complex(cosine, -sine) / 100 == pytest.approx(expected, abs=1e-4)


def test_derivative_on_the_measurement_alone_is_slow() -> None:
    gains = replace(eq9_gains(AT_442_US), velocity_feedforward_v_s_per_m=0.0)
    assert abs(complex(sampled_response(AT_442_US, 9.7, gains))) == pytest.approx(math.sqrt(0.5), abs=0.01)


def test_a_plant_without_damping() -> None:
    tool = replace(LATHE.tool, damping_n_s_per_m=0.0)
    nearly = replace(LATHE.tool, damping_n_s_per_m=0.02)
    met, limit = (complex(sampled_response(replace(LATHE, tool=t), 50.0)) for t in (tool, nearly))
    assert met == pytest.approx(limit, abs=1e-4)
    assert complex(sampled_response(LATHE, 0.0)) == pytest.approx(1, abs=1e-3)


def test_following_error_at_50_hz() -> None:
    assert 22 < following_error_um(LATHE, 27.5, 50.0) < 30
    assert LATHE.controller.variables["I111"] / 16 * LATHE.tool.count_um > 3 * following_error_um(
        LATHE, 27.5, 50.0
    )


def test_published_gains_as_whole_numbers() -> None:
    found = variables_from_gains(AT_442_US, eq9_gains(AT_442_US))
    assert found["I130"] == 528
    assert found["I131"] == found["I132"] == pytest.approx(4905, abs=5)
    assert found["I133"] == pytest.approx(811, abs=1)
    assert (found["I134"], found["I135"]) == (0, 0)


def test_full_feedforward_as_whole_numbers() -> None:
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


def test_bundled_gains_are_the_published_ones() -> None:
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
    met = gains_from_variables(with_variables(LATHE, dict(variables_from_gains(LATHE, gains))))
    assert met.kp_v_per_m == pytest.approx(kp, rel=3e-3)
    assert met.ki_v_per_m_s == pytest.approx(ki, rel=0.01, abs=0.2 * kp / 1000)
    assert met.kd_v_s_per_m == pytest.approx(kd, rel=1e-3, abs=kp * 2e-6)
    assert met.velocity_feedforward_v_s_per_m == pytest.approx(kv, rel=1e-3, abs=kp * 2e-6)


def test_an_integrator_that_rests_in_moves_does_not_count() -> None:
    assert gains_from_variables(with_variables(LATHE, {"I134": 1})).ki_v_per_m_s == 0


def test_gains_that_the_profile_lacks_are_named() -> None:
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
