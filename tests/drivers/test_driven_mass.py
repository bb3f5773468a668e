"""A mass behind an amplifier against the closed forms of its motion: damping, dry friction, both and none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.simulator.card.servo import ServoAxis
from drivers.simulator.plant.driven_mass import DrivenMass, DrySlide, linear_motor, rotary_motor
from drivers.simulator.plant.servo_gains import ServoGains

CYCLE_S = 3_713_707 / 8_388_608_000
FRICTION_N, MASS_KG, COUNTS_PER_M = 3.0, 4.74, 5e6
NEWTON_PER_BIT = 0.01
SIXTEEN_BITS = 32_768.0


def slide(damping_n_s_per_m: float = 0.0, friction_n: float = FRICTION_N) -> DrivenMass:
    return linear_motor(
        mass_kg=MASS_KG,
        damping_n_s_per_m=damping_n_s_per_m,
        force_n_per_bit=NEWTON_PER_BIT,
        peak_output_bits=SIXTEEN_BITS,
        counts_per_m=COUNTS_PER_M,
        friction_n=friction_n,
    )


def went(mass: DrivenMass, speed: float, force_n: float, cycles: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions and speeds, counts and counts/s, at the end of each cycle under a constant force."""
    dry, x, v = DrySlide(mass, CYCLE_S), 0.0, speed
    passed = []
    for _ in range(cycles):
        x, v = dry.step(x, v, force_n / NEWTON_PER_BIT)
        passed.append((x, v))
    return np.array(passed)[:, 0], np.array(passed)[:, 1]


@pytest.mark.parametrize(("force_n", "sticks"), [(2.999, True), (-2.999, True), (3.001, False), (-3.001, False)])
def test_a_force_below_the_friction_does_not_move_what_stands(force_n: float, sticks: bool) -> None:
    x, _ = went(slide(201.6), 0.0, force_n, 1000)
    assert (x[-1] == 0.0) == sticks


@pytest.mark.parametrize("force_n", [5.0, -5.0])
def test_above_it_the_rest_of_the_force_accelerates(force_n: float) -> None:
    """(5 - 3) N over 4.74 kg for 0.5 s."""
    x, v = went(slide(), 0.0, force_n, 1000)
    time_s = 1000 * CYCLE_S
    acceleration = math.copysign(2.0, force_n) / MASS_KG * COUNTS_PER_M
    assert v[-1] == pytest.approx(acceleration * time_s)
    assert x[-1] == pytest.approx(0.5 * acceleration * time_s**2)


@pytest.mark.parametrize("speed_mm_per_s", [10.0, -37.0])
def test_a_free_slide_stops_after_m_v2_over_2_f(speed_mm_per_s: float) -> None:
    """All of its energy goes into the friction: at 10 mm/s that takes 79 um and 15.8 ms, in no whole cycle."""
    x, v = went(slide(), speed_mm_per_s * 5000.0, 0.0, 400)
    way_m = 0.5 * MASS_KG * (speed_mm_per_s / 1000.0) ** 2 / FRICTION_N
    assert abs(x[-1]) / COUNTS_PER_M == pytest.approx(way_m, rel=1e-9)
    stop_s = MASS_KG * abs(speed_mm_per_s) / 1000.0 / FRICTION_N
    assert np.count_nonzero(v) == math.floor(stop_s / CYCLE_S)


def test_with_damping_too_it_stops_after_the_logarithm() -> None:
    """M dv/dt = -B v - F ends after (M / B) ln(1 + B v / F)."""
    speed = 0.05
    _, v = went(slide(201.6), speed * COUNTS_PER_M, 0.0, 2000)
    stop_s = MASS_KG / 201.6 * math.log(1.0 + 201.6 * speed / FRICTION_N)
    assert np.count_nonzero(v) == math.floor(stop_s / CYCLE_S)


def test_a_force_against_the_motion_stops_it_and_turns_it_back_in_the_same_cycle() -> None:
    """Braked by 30 + 3 N, accelerated by 30 - 3 N, with the change at the time of rest."""
    speed, mass = 0.001, slide()
    x, v = went(mass, speed * COUNTS_PER_M, -30.0, 1)
    rest_s = speed * MASS_KG / 33.0
    assert 0.0 < rest_s < CYCLE_S
    left_s = CYCLE_S - rest_s
    assert v[0] / COUNTS_PER_M == pytest.approx(-27.0 / MASS_KG * left_s)
    back_m = speed * rest_s / 2 - 0.5 * 27.0 / MASS_KG * left_s**2
    assert x[0] / COUNTS_PER_M == pytest.approx(back_m)


@given(
    speed=st.floats(-0.1, 0.1),
    force_n=st.floats(-50.0, 50.0),
    damping=st.sampled_from([0.0, 1e-4, 201.6]),
    parts=st.integers(2, 7),
)
def test_a_cycle_is_the_sum_of_its_parts(speed: float, force_n: float, damping: float, parts: int) -> None:
    mass, v = slide(damping), speed * COUNTS_PER_M
    whole = DrySlide(mass, CYCLE_S).step(0.0, v, force_n / NEWTON_PER_BIT)
    fine, x = DrySlide(mass, CYCLE_S / parts), 0.0
    for _ in range(parts):
        x, v = fine.step(x, v, force_n / NEWTON_PER_BIT)
    assert whole == pytest.approx((x, v), rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("damping", [0.0, 1e-6, 1e-2, 1.0])
def test_hardly_any_damping_is_hardly_any_difference(damping: float) -> None:
    """The formulas with damping divide by it; without any, x = F t^2 / (2 M)."""
    held = slide(damping, 0.0).held(CYCLE_S)
    acceleration = NEWTON_PER_BIT / MASS_KG * COUNTS_PER_M
    assert held.push_x == pytest.approx(0.5 * acceleration * CYCLE_S**2, rel=1e-4)
    assert held.push_v == pytest.approx(acceleration * CYCLE_S, rel=1e-4)
    assert held.glide == pytest.approx(CYCLE_S, rel=1e-4)


def gains(**changed: float) -> ServoGains:
    paper = {"ix08": 96, "ix09": 96, "ix30": 528, "ix31": 4905, "ix32": 4905, "ix33": 811, "ix34": 0, "ix35": 0}
    return ServoGains(**{**paper, "ix69": 10_531, **changed})


PAPER = linear_motor(
    mass_kg=MASS_KG,
    damping_n_s_per_m=201.6,
    force_n_per_bit=624.025 / 3276.8,
    peak_output_bits=10_531,
    counts_per_m=COUNTS_PER_M,
)


@given(st.lists(st.floats(-40.0, 40.0), min_size=3, max_size=40), st.integers(1, 20))
def test_a_friction_of_next_to_nothing_changes_nothing(steps: list[float], cycles: int) -> None:
    """What is stepped a cycle at a time, because of the friction, is the same loop as the fast one."""
    commands = np.repeat(np.cumsum(steps), cycles).tolist()
    tracks = []
    for friction in (0.0, 1e-9):
        mass = DrivenMass(
            damping_per_s=PAPER.damping_per_s,
            acceleration_per_bit=PAPER.acceleration_per_bit,
            peak_output_bits=PAPER.peak_output_bits,
            friction=friction,
        )
        axis = ServoAxis(mass, gains(ix35=300, ix69=2000), CYCLE_S)
        axis.close_loop()
        tracks.append([*axis.follow(commands), *axis.push(0.1, 5), *axis.coast(5)])
    assert tracks[1] == pytest.approx(tracks[0], abs=1e-6)


def test_a_held_tool_gives_way_only_when_the_friction_is_overcome() -> None:
    """Without integrator, a count of 0.2 um off is 0.0184 N: 3 N of friction hold against 162.8 of them."""
    mass = DrivenMass(
        damping_per_s=PAPER.damping_per_s,
        acceleration_per_bit=PAPER.acceleration_per_bit,
        peak_output_bits=PAPER.peak_output_bits,
        friction=FRICTION_N / MASS_KG * COUNTS_PER_M,
    )
    for error, moves in ((162.0, False), (164.0, True)):
        axis = ServoAxis(mass, gains(ix31=0, ix32=0, ix33=0), CYCLE_S)
        axis.close_loop()
        assert (axis.follow([error] * 100)[-1] != 0.0) == moves


def test_a_rotor_is_a_slide_in_counts_of_its_turn() -> None:
    """1 N m on 0.002 kg m2 is 500 rad/s2, 79.6 turns/s2."""
    rotor = rotary_motor(
        inertia_kg_m2=0.002,
        drag_n_m_s_per_rad=0.004,
        torque_n_m_per_bit=1.0,
        peak_output_bits=1.0,
        counts_per_turn=10_000.0,
        friction_n_m=0.5,
    )
    assert rotor.acceleration_per_bit == pytest.approx(500 / (2 * math.pi) * 10_000)
    assert rotor.friction == pytest.approx(250 / (2 * math.pi) * 10_000)
    assert rotor.damping_per_s == pytest.approx(2.0)
