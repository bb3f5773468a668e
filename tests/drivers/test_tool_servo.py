"""The simulated tool servo against the difference equation worked out by hand, and its limits."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from scipy import signal

from drivers.simulator.card.servo import ServoAxis
from drivers.simulator.plant.axis import IdealAxis
from drivers.simulator.plant.driven_mass import FlexibleMode, linear_motor
from drivers.simulator.plant.servo_gains import ServoGains

CYCLE_S = 3_713_707 / 8_388_608_000
MASS, DAMPING, FORCE_N_PER_V = 4.74, 201.6, 11.45 * 54.5
BITS_PER_V = 32_768 / 10
PLANT = linear_motor(
    mass_kg=MASS,
    damping_n_s_per_m=DAMPING,
    force_n_per_bit=FORCE_N_PER_V / BITS_PER_V,
    peak_output_bits=10_531,
    counts_per_m=5e6,
)


def gains(**changed: float) -> ServoGains:
    paper = {"ix08": 96, "ix09": 96, "ix30": 528, "ix31": 4905, "ix32": 4905, "ix33": 811, "ix34": 0, "ix35": 0}
    return ServoGains(**{**paper, "ix69": 10_531, **changed})


def held(**changed: float) -> ServoAxis:
    axis = ServoAxis(PLANT, gains(**changed), CYCLE_S)
    axis.close_loop()
    return axis


def response(
    frequency_hz: float, amplitude: float = 20_000.0, axis: ServoAxis | None = None, **changed: float
) -> complex:
    """Return position over command of the running loop, from whole periods after it has settled."""
    cycles = round(4.0 / CYCLE_S)
    time_s = np.arange(cycles) * CYCLE_S
    # Smoothly grown over half a second, so that no limit is met.
    command = amplitude * np.minimum(time_s / 0.5, 1.0) * np.sin(2 * np.pi * frequency_hz * time_s)
    position = np.array((axis or held(**changed)).follow([float(place) for place in command]))
    tail = slice(round(1.5 / CYCLE_S), cycles)
    harmonics = np.column_stack(
        [np.sin(2 * np.pi * frequency_hz * time_s), np.cos(2 * np.pi * frequency_hz * time_s), np.ones(cycles)]
    )[tail]
    sine, cosine, _ = np.linalg.lstsq(harmonics, position[tail], rcond=None)[0]
    return complex(sine, cosine) / amplitude


@pytest.mark.parametrize(
    ("frequency_hz", "gain", "phase"),
    [(10, 1.0215, -0.168), (30, 0.9811, -0.556), (50, 0.8850, -0.903), (70, 0.7777, -1.207)],
)
def test_the_sampled_loop_has_the_gain_and_phase_of_the_reference(
    frequency_hz: float, gain: float, phase: float
) -> None:
    found = response(frequency_hz, amplitude=1000.0)
    assert abs(found) == pytest.approx(gain, rel=0.005)
    assert cmath.phase(found) == pytest.approx(phase, rel=0.005, abs=0.0012)


def test_proportional_gain_is_the_one_of_the_published_loop() -> None:
    """1 um is 5 counts; 147.6 V/m makes 147.6e-6 V of it. Output acts one cycle late on mass and damping."""
    axis = held(ix31=0.0, ix32=0.0, ix33=0.0)
    axis.follow([5.0])
    volts = axis.output_bits / axis.limit_bits * 10_531 / BITS_PER_V
    assert volts == pytest.approx(147.6e-6, rel=1e-3)


def test_the_output_reaches_the_mass_one_cycle_late() -> None:
    """Calculated in cycle 0, it acts through cycle 1 and shows at its end as F/M T^2/2 (damping hardly counts)."""
    axis = held(ix31=0.0, ix32=0.0, ix33=0.0)
    positions = axis.follow([1000.0] * 3)
    assert positions[:2] == [0.0, 0.0]
    force = 147.6 * 1000 / 5e6 * FORCE_N_PER_V
    assert positions[2] == pytest.approx(0.5 * force / MASS * CYCLE_S**2 * 5e6, rel=0.02)


def test_a_derivative_on_the_error_without_feedforward_brakes_the_actual_velocity() -> None:
    """On a ramp of v the error is v Ix31/128 counts without velocity feedforward, and the drag of the plant."""
    speed = 10.0  # counts a cycle
    ramp = (speed * np.arange(20_000)).tolist()
    axis = held(ix32=0.0, ix33=0.0)
    error = ramp[-1] - axis.follow(ramp)[-1]
    drag_volt = DAMPING * speed / 5e6 / CYCLE_S / FORCE_N_PER_V
    assert error == pytest.approx(speed * 4905 / 128 + drag_volt / 147.6 * 5e6, rel=0.01)


def test_a_step_settles_with_a_small_overshoot() -> None:
    """Continuous Eq 9 overshoots by 2.3 %; sampling and delay cost more, but below a quarter."""
    positions = np.array(held().follow([500.0] * round(2.0 / CYCLE_S)))
    assert 1.02 < positions.max() / 500 < 1.25
    assert np.abs(positions[round(0.1 / CYCLE_S) :] - 500).max() < 10
    assert abs(positions[-1] - 500) < 1.5


@pytest.mark.parametrize(("ix69", "limit_n"), [(10_531, 36.8 * 54.5), (2_000, 2_000 / BITS_PER_V * FORCE_N_PER_V)])
def test_the_output_limit_bounds_the_force(ix69: float, limit_n: float) -> None:
    axis = held(ix69=ix69)
    axis.follow([1e6])
    assert axis.output_bits / axis.limit_bits == 1.0
    positions = np.array(axis.follow([1e6] * 60))
    acceleration = np.diff(positions, 2).max() / CYCLE_S**2 / 5e6
    assert acceleration <= limit_n / MASS * 1.001
    assert acceleration >= 0.9 * limit_n / MASS


def test_the_amplifier_limits_the_output_when_ix69_does_not() -> None:
    positions = np.array(held(ix69=32_767).follow([1e6] * 60))
    assert np.diff(positions, 2).max() / CYCLE_S**2 / 5e6 <= 36.8 * 54.5 / MASS * 1.001


def test_the_encoder_is_quantised_to_counts() -> None:
    """Half a count of command is not answered by half a count: the loop hunts between two counts."""
    positions = np.array(held(ix33=0.0).follow([0.4] * 3000))
    settled = positions[-1000:]
    assert np.abs(settled).max() <= 1.0
    assert np.abs(settled - 0.4).max() > 0.05


def test_ix34_keeps_the_integrator_still_in_motion() -> None:
    """A slow ramp holds a constant drag error; only a working integrator takes it away."""
    ramp = (2.0 * np.arange(round(20 / CYCLE_S))).tolist()
    lag = {ix34: ramp[-1] - held(ix34=ix34).follow(ramp)[-1] for ix34 in (0.0, 1.0)}
    drag = DAMPING * 2.0 / 5e6 / CYCLE_S / FORCE_N_PER_V / 147.6 * 5e6
    assert lag[1.0] == pytest.approx(drag, abs=1.0)
    assert abs(lag[0.0]) < 0.5 * drag


def test_an_integrator_with_a_limit_of_zero_is_off() -> None:
    """Ix63 = 0 (Software Reference): the drag error of a slow ramp stays, as without Ix33."""
    ramp = (2.0 * np.arange(round(20 / CYCLE_S))).tolist()
    assert held(ix63=0.0).follow(ramp) == held(ix33=0.0).follow(ramp)
    assert held(ix63=1.0).follow(ramp) != held(ix33=0.0).follow(ramp)


@pytest.mark.parametrize(("output", "share"), [(0.1, 0.1), (-0.5, -0.5), (1.0, 10_531 / 20_000)])
def test_an_open_loop_output_accelerates_by_newtons_law(output: float, share: float) -> None:
    """A share of Ix69 = 20000 bits, as far as the amplifier goes; one cycle late, as in closed loop."""
    positions = np.array(held(ix69=20_000).push(output, 4))
    force = share * 20_000 / BITS_PER_V * FORCE_N_PER_V
    acceleration = np.diff(positions, 2) / CYCLE_S**2 / 5e6
    assert positions[:2].tolist() == [0.0, 0.0]
    assert acceleration[0] == pytest.approx(force / MASS / 2, rel=0.02)
    assert acceleration[1] == pytest.approx(force / MASS, rel=0.03)


def test_a_killed_slide_runs_out_against_its_damping() -> None:
    """v M/B of way: 4.74/201.6 s at 10 counts a cycle."""
    axis = held()
    ramp = (10.0 * np.arange(10_000)).tolist()
    positions = np.array(axis.follow(ramp))
    speed = (positions[-1] - positions[-2]) / CYCLE_S
    way = axis.coast(2000)[-1] - positions[-1]
    assert way == pytest.approx(speed * MASS / DAMPING, rel=0.03)
    assert axis.output_bits / axis.limit_bits == 0.0


def test_an_axis_that_is_switched_on_holds_where_it_stands() -> None:
    axis = held()
    axis.follow((10.0 * np.arange(1000)).tolist())
    axis.coast(3000)
    here = axis.close_loop()
    assert np.abs(np.array(axis.follow([here] * 3000)) - here).max() <= 1.0


def test_a_new_zero_does_not_move_the_iron() -> None:
    axis = held()
    before = axis.follow([1000.0] * 5000)[-1] + axis.origin
    axis.rebase(700.0)
    after = np.array(axis.follow([300.0] * 1000)) + axis.origin
    assert np.abs(after - before).max() <= 1.5


def test_an_ideal_axis_is_where_it_is_told_and_coasts_with_its_time_constant() -> None:
    axis = IdealAxis(CYCLE_S, 1.5)
    axis.close_loop()
    assert axis.follow([1.0, 3.0, 6.0]) == [1.0, 3.0, 6.0]
    track = np.array(axis.coast(round(20 / CYCLE_S)))
    assert track[-1] - 6.0 == pytest.approx(3.0 / CYCLE_S * 1.5, rel=1e-3)
    steps = np.diff(np.concatenate([[6.0], track]))
    assert steps[round(1.5 / CYCLE_S) - 1] == pytest.approx(3.0 * math.exp(-1), rel=1e-3)


def test_number_11_a_hundred_counts_of_error_are_36_6_bits() -> None:
    """Ix30 2000, Ix08 96, nothing else: 2000 x 96 x 100 / 2^19 bits, 11.2 mV of 10 V in 32768.

    One newton a bit on one kilogramme, which does not come as far as half a count meanwhile.
    """
    plant = linear_motor(
        mass_kg=1.0, damping_n_s_per_m=0.01, force_n_per_bit=1.0, peak_output_bits=20_480, counts_per_m=1.0
    )
    alone = dict.fromkeys(("ix31", "ix32", "ix33", "ix35"), 0)
    axis = ServoAxis(plant, gains(ix30=2000, ix08=96, ix69=20_480, **alone), CYCLE_S)
    axis.close_loop()
    track = axis.follow([100.0] * 102)
    # The output of the first cycle acts from the second on; the last position is behind a hundred such cycles.
    bits = 2 * track[101] / (100 * CYCLE_S) ** 2
    assert bits == pytest.approx(36.62, abs=0.01)
    assert bits / BITS_PER_V * 1000 == pytest.approx(11.2, abs=0.05)


@pytest.mark.parametrize("fraction", [0.3, -0.3])
@pytest.mark.parametrize("hz", [50.0, 250.0, 420.0])
def test_a_flexible_axis_responds_as_another_program_says(hz: float, fraction: float) -> None:
    """Rigid axis and mode of 300 Hz with 2 % of damping, sampled by scipy; the loop from textbook parts."""
    omega, period_s = 2.0 * math.pi * 300.0, CYCLE_S
    z = cmath.exp(2j * math.pi * hz * period_s)
    plant = 0.0 + 0.0j
    for above, below in (
        ([1.0], [1.0, DAMPING / MASS, 0.0]),
        ([fraction], [1.0, 2.0 * 0.02 * omega, omega**2]),
    ):
        (numerator,), denominator, _ = signal.cont2discrete((above, below), period_s, "zoh")
        plant += complex(np.polyval(numerator, z) / np.polyval(denominator, z))
    kp = 528 * 96 / 2**19
    slope = 1.0 - 1.0 / z
    kd, ki = kp * 4905 / 128, kp * 811 / 2**23
    control = kp + ki / slope + kd * slope
    opened = plant * FORCE_N_PER_V / BITS_PER_V / MASS * 5e6 * control / z
    axis = ServoAxis(PLANT, gains(), CYCLE_S, mode=FlexibleMode(300.0, 0.02, fraction, CYCLE_S))
    axis.close_loop()
    assert response(hz, 300.0, axis) == pytest.approx(opened / (1.0 + opened), abs=2e-3)
