"""Driven masses with friction, guides, and the ends of their travel."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.settings import settings_with
from drivers.simulator.card.servo import ServoAxis
from drivers.simulator.hosts.control_socket import answer
from drivers.simulator.plant.driven_mass import DrivenMass, DrySlide, Presliding, linear_motor
from drivers.simulator.plant.drives import Drives, build_drives
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.servo_gains import ServoGains
from drivers.simulator.plant.true_parameters import TrueParameters, ideal
from profiles.machine import MachineProfile
from tests.drivers.conftest import TrueBenchMaker

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


def test_a_free_slide_stops_by_friction_and_damping() -> None:
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


def test_a_fast_force_by_a_late_current_swings_a_dry_slide_as_its_differential_equation_says() -> None:
    """30 N, a lag of 0.2 ms, a period of 2.5 cycles: it turns round in most. By a thousand Euler steps a cycle."""
    dry, x, v, at, speed, force_n = DrySlide(slide(201.6), CYCLE_S, 2e-4), 0.0, 0.0, 0.0, 0.0, 0.0
    places, step_s = [], CYCLE_S / 1000
    for cycle in range(400):
        asked_n = 30.0 * math.sin(0.8 * math.pi * cycle)
        x, v = dry.step(x, v, asked_n / NEWTON_PER_BIT)
        for _ in range(1000):
            force_n += (asked_n - force_n) * step_s / 2e-4
            speed += (force_n - 201.6 * speed - math.copysign(FRICTION_N, speed)) / MASS_KG * step_s
            at += speed * step_s
        places.append((x, at * COUNTS_PER_M))
    ours, true = np.exp(-0.8j * np.pi * np.arange(200)) @ np.diff(places[199:], axis=0)
    assert abs(ours / true - 1.0) < 0.02


@pytest.mark.parametrize("damping", [0.0, 1e-6, 1e-2, 1.0])
def test_hardly_any_damping_is_hardly_any_difference(damping: float) -> None:
    """The formulas with damping divide by it; without any, x = F t^2 / (2 M)."""
    held = slide(damping, 0.0).zero_order_hold(CYCLE_S)
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


# Dry friction that builds up over a distance: by its differential equation, and by what it does to a tool.

GUIDES_MASS_KG, DAMPING, GUIDES_FRICTION_N, DISTANCE_M = 4.74, 163.4, 3.0, 5e-6
N_PER_BIT, GUIDES_COUNTS_PER_M = 624.025 * 10 / 32_768, 5e6
GAINS = ServoGains(ix08=96, ix09=96, ix30=528, ix31=4905, ix32=0, ix33=811, ix34=0, ix35=0, ix69=32_767)


def moved_um(forces_n: list[float], cycles: int) -> np.ndarray:
    """Where a slide with this friction goes under each of these forces for so many servo cycles."""
    slide = linear_motor(
        mass_kg=GUIDES_MASS_KG,
        damping_n_s_per_m=DAMPING,
        force_n_per_bit=N_PER_BIT,
        peak_output_bits=32_767,
        counts_per_m=GUIDES_COUNTS_PER_M,
    )
    limit = GUIDES_FRICTION_N / GUIDES_MASS_KG * GUIDES_COUNTS_PER_M
    axis = ServoAxis(slide, GAINS, CYCLE_S, load=Presliding(limit, DISTANCE_M * GUIDES_COUNTS_PER_M, None))
    at: list[float] = []
    for force_n in forces_n:
        at += axis.push(force_n / N_PER_BIT / 32_767, cycles)
    return np.array(at) / GUIDES_COUNTS_PER_M * 1e6


def by_equation_um(forces_n: list[float], cycles: int) -> np.ndarray:
    """m x" = F - B x' - f with f' = (F_c x' - f |x'|) / s; a force acts one servo cycle later."""
    from scipy.integrate import solve_ivp

    def slope(time_s: float, state: np.ndarray) -> list[float]:
        _, speed, friction_n = state
        place = math.floor(time_s / CYCLE_S + 1e-9) - 1
        force_n = forces_n[min(place // cycles, len(forces_n) - 1)] if place >= 0 else 0.0
        grown = (GUIDES_FRICTION_N * speed - friction_n * abs(speed)) / DISTANCE_M
        return [speed, (force_n - DAMPING * speed - friction_n) / GUIDES_MASS_KG, grown]

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


# Where the iron of the tool and of the carriage ends, whatever the card commands.

FATAL_ERROR = 1 << 2

TOOL_MM, CARRIAGE_MM = (-5.0, 78.0), (-8.0, 202.0)
"""The travel of the profile, -2 to 75 and -5 to 199 mm, and 3 mm more."""


def mounted(machine: MachineProfile) -> TrueParameters:
    return plant_named("mounted", machine, 1)


def drives(machine: MachineProfile, true: TrueParameters | None = None) -> Drives:
    return build_drives(machine, true or mounted(machine), settings_with(machine.controller.variables))


@pytest.mark.parametrize("friction_n", [0.0, 0.1])
@pytest.mark.parametrize(("output", "end_mm"), [(1.0, TOOL_MM[1]), (-1.0, TOOL_MM[0])])
def test_a_tool_that_is_pushed_stands_at_its_end(
    machine: MachineProfile, friction_n: float, output: float, end_mm: float
) -> None:
    tool = drives(machine, replace(mounted(machine), coulomb_friction_n=friction_n)).tool
    place = np.array(tool.push(output, 4000)) + tool.origin
    assert place[-1] == pytest.approx(end_mm * 5000.0)
    assert (place.min() >= TOOL_MM[0] * 5000.0, place.max() <= TOOL_MM[1] * 5000.0) == (True, True)
    assert tool.at_end
    for _ in range(2):  # the output of the first cycle is the one before
        tool.push(-output, 20)
    assert not tool.at_end


@pytest.mark.parametrize("block", [11, 4000])
def test_a_loop_told_to_go_further_pushes_and_comes_back(machine: MachineProfile, block: int) -> None:
    """Blocks of the card or one long one: the end is where it is."""
    tool = drives(machine).tool
    start = tool.close_loop()
    speed = 100.0 * 5000.0 * 0.00044270837
    there = np.minimum(np.arange(1, 4001) * speed + start, 80.0 * 5000.0).tolist()
    track = [place for at in range(0, 4000, block) for place in tool.follow(there[at : at + block])]
    assert max(track) + tool.origin == pytest.approx(TOOL_MM[1] * 5000.0)
    assert track[-1] == max(track)
    assert tool.output_bits / tool.limit_bits > 0.1
    back = np.maximum(there[-1] - np.arange(1, 4001) * speed, 60.0 * 5000.0).tolist()
    track = [place for at in range(0, 4000, block) for place in tool.follow(back[at : at + block])]
    # What its integrator has taken up at the end, it lets go in seconds.
    assert track[-1] == pytest.approx(60.0 * 5000.0, abs=3000)


def test_far_from_its_ends_an_axis_is_what_it_is_without_any_and_at_them_it_stands(
    machine: MachineProfile,
) -> None:
    near, free = drives(machine).tool, drives(machine, ideal(machine)).tool
    commands = (20_000.0 + 200.0 * np.sin(np.arange(4000) * 0.1)).tolist()
    for tool in (near, free):
        tool.close_loop()
    # One long block takes the careful way, blocks of the card the quick one.
    quick = [x for at in range(0, 4000, 10) for x in free.follow(commands[at : at + 10])]
    assert near.follow(commands) == quick
    carriage = drives(machine).carriage
    track, at_its_end = carriage.follow([1000.0 * n for n in range(300)]), carriage.at_end
    assert max(track) + carriage.origin == CARRIAGE_MM[1] * 1000.0
    assert carriage.follow([100_000.0])[-1] == 100_000.0
    assert (at_its_end, carriage.at_end) == (True, False)
    assert carriage.push(-1.0, 20_000)[-1] + carriage.origin == CARRIAGE_MM[0] * 1000.0


@pytest.mark.parametrize(("motor", "end"), [(1, TOOL_MM[1] * 5000.0), (3, CARRIAGE_MM[1] * 1000.0)])
def test_without_its_limits_an_axis_runs_into_its_stop_trips_and_it_is_said_once(
    machine: MachineProfile, bench_with: TrueBenchMaker, motor: int, end: float
) -> None:
    bench = bench_with(mounted(machine))
    bench.lathe.enable()
    bench.lathe.home()
    bench.client.request(f"I{motor}13=0 I{motor}14=0")
    bench.client.request(f"#{motor}J+")
    for _ in range(120):
        bench.sim.wait(0.5)
        if not bench.sim.controller.motors[motor].enabled:
            break
    assert int(bench.ask(f"#{motor}?"), 16) & FATAL_ERROR
    assert bench.number(f"#{motor}P") == pytest.approx(end, abs=2)
    kinds = [collision.kind.value for collision in bench.sim.collisions]
    assert kinds.count("end_of_travel") == 1
    assert "end_of_travel: " in answer(bench.sim, "collisions")
