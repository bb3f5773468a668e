"""The servo loop of the tool, its filter, and the order of its gains."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.identification.tool_gains import in_writing_order
from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.motor_settings import MotorSettings
from drivers.pmac.variables import VariableStore
from drivers.simulator.card.servo import ServoAxis
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.axis import IdealAxis
from drivers.simulator.plant.driven_mass import SimulatedMode, linear_motor
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.servo_gains import ServoGains, notch_of
from profiles.axis.notch import Notch
from profiles.axis.sampled_loop import loop_of
from profiles.axis.servo_gains import notch_settings
from profiles.machine import MachineProfile
from profiles.store import load_machine

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
def test_the_sampled_loop_has_the_reference_response(frequency_hz: float, gain: float, phase: float) -> None:
    found = response(frequency_hz, amplitude=1000.0)
    assert abs(found) == pytest.approx(gain, rel=0.005)
    assert cmath.phase(found) == pytest.approx(phase, rel=0.005, abs=0.0012)


def test_the_published_gain_is_proportional_and_reaches_the_mass_one_cycle_late() -> None:
    """1 um is 5 counts; 147.6 V/m makes 147.6e-6 V of it. Output acts one cycle late on mass and damping."""
    axis = held(ix31=0.0, ix32=0.0, ix33=0.0)
    axis.follow([5.0])
    volts = axis.output_bits / axis.limit_bits * 10_531 / BITS_PER_V
    assert volts == pytest.approx(147.6e-6, rel=1e-3)
    # Calculated in cycle 0, it acts through cycle 1 and shows at its end as F/M T^2/2 (damping hardly counts).
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


def test_the_amplifier_limits_the_output_and_the_encoder_is_quantised() -> None:
    positions = np.array(held(ix69=32_767).follow([1e6] * 60))
    assert np.diff(positions, 2).max() / CYCLE_S**2 / 5e6 <= 36.8 * 54.5 / MASS * 1.001
    # Half a count of command is not answered by half a count: the loop hunts between two counts.
    positions = np.array(held(ix33=0.0).follow([0.4] * 3000))
    settled = positions[-1000:]
    assert np.abs(settled).max() <= 1.0
    assert np.abs(settled - 0.4).max() > 0.05


def test_the_integrator_stands_still_in_motion_and_at_a_limit_of_zero() -> None:
    """A slow ramp holds a constant drag error; only a working integrator takes it away."""
    ramp = (2.0 * np.arange(round(20 / CYCLE_S))).tolist()
    lag = {ix34: ramp[-1] - held(ix34=ix34).follow(ramp)[-1] for ix34 in (0.0, 1.0)}
    drag = DAMPING * 2.0 / 5e6 / CYCLE_S / FORCE_N_PER_V / 147.6 * 5e6
    assert lag[1.0] == pytest.approx(drag, abs=1.0)
    assert abs(lag[0.0]) < 0.5 * drag
    # Ix63 = 0 (Software Reference): the drag error of a slow ramp stays, as without Ix33.
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


def test_an_axis_holds_where_it_is_switched_on_and_a_new_zero_moves_nothing() -> None:
    axis = held()
    axis.follow((10.0 * np.arange(1000)).tolist())
    axis.coast(3000)
    here = axis.close_loop()
    assert np.abs(np.array(axis.follow([here] * 3000)) - here).max() <= 1.0
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
@pytest.mark.parametrize("lag_s", [0.0, 4e-4])
def test_a_flexible_axis_responds_as_another_program_says(hz: float, fraction: float, lag_s: float) -> None:
    """Rigid axis and mode of 300 Hz with 2 % of damping, sampled by scipy; the loop from textbook parts."""
    from scipy import signal

    omega, period_s = 2.0 * math.pi * 300.0, CYCLE_S
    z = cmath.exp(2j * math.pi * hz * period_s)
    plant = 0.0 + 0.0j
    for above, below in (([1.0], [1.0, DAMPING / MASS, 0.0]), ([fraction], [1.0, 2.0 * 0.02 * omega, omega**2])):
        lagging = np.polymul(below, [lag_s, 1.0] if lag_s else [1.0])
        (numerator,), denominator, _ = signal.cont2discrete((above, lagging), period_s, "zoh")
        plant += complex(np.polyval(numerator, z) / np.polyval(denominator, z))
    kp = 528 * 96 / 2**19
    slope = 1.0 - 1.0 / z
    kd, ki = kp * 4905 / 128, kp * 811 / 2**23
    control = kp + ki / slope + kd * slope
    opened = plant * FORCE_N_PER_V / BITS_PER_V / MASS * 5e6 * control / z
    mode = SimulatedMode(300.0, 0.02, fraction, CYCLE_S, lag_s)
    axis = ServoAxis(PLANT, gains(), CYCLE_S, lag_s=lag_s, mode=mode)
    axis.close_loop()
    assert response(hz, 300.0, axis) == pytest.approx(opened / (1.0 + opened), abs=2e-3)


# The notch filter Ix36 to Ix39 of the simulated controller: its response, its range, its signs, and none at 0.

NOTCH = {"ix36": -0.9375, "ix37": 0.8125, "ix38": -0.125, "ix39": 0.1875}
"""Zeros at some 330 Hz, poles that fade within two cycles."""


def with_notch(machine: MachineProfile, values: dict[str, float]) -> MachineProfile:
    n1, n2, d1, d2 = values.values()
    stated = notch_settings(machine, Notch(n1=n1, n2=n2, d1=d1, d2=d2))
    variables = {**machine.controller.variables, **stated}
    return replace(machine, controller=replace(machine.controller, variables=variables))


def test_the_filter_is_the_difference_equation_of_the_manual() -> None:
    from scipy import signal

    filtering = notch_of(gains(**NOTCH))
    assert filtering is not None
    puts = np.random.default_rng(1).normal(size=200)
    found = []
    for each in puts:
        output = filtering.filter_output(float(each))
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
    deepest = [
        abs(complex(notch.response_at(np.exp([2j * np.pi * hz * period_s]))[0])) for hz in (30.0, 90.0, 300.0)
    ]
    assert deepest[1] < deepest[0] and deepest[1] < 0.5 * deepest[2]


@pytest.mark.parametrize("hz", [40.0, 90.0])
def test_the_loop_with_a_filter_has_the_response_of_the_model(hz: float) -> None:
    lathe = load_machine("lee-2001-lathe").machine
    wanted = complex(loop_of(with_notch(lathe, NOTCH)).closed_loop(hz))
    found = response(hz, 2000.0, axis=held(**NOTCH))
    assert abs(found) == pytest.approx(abs(wanted), rel=0.002)
    assert math.degrees(cmath.phase(found / wanted)) == pytest.approx(0.0, abs=0.15)
    assert abs(wanted - complex(loop_of(lathe).closed_loop(hz))) > 0.05, "the filter makes a difference here"


def test_without_a_filter_nothing_is_otherwise_and_a_filter_keeps_the_limit() -> None:
    commands = [500.0 * math.sin(0.11 * cycle) for cycle in range(4000)]
    axis, again = held(), ServoAxis(PLANT, gains(ix36=0.0), CYCLE_S)
    again.close_loop()
    assert axis.follow(commands) == again.follow(commands) and notch_of(gains()) is None
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


# The order in which gains and filter are written: on the way the loop is never more than at both ends.

PLAIN = {"I130": 528.0, "I131": 4905.0, "I132": 4905.0, "I133": 811.0}
NONE = {"I136": 0.0, "I137": 0.0, "I138": 0.0, "I139": 0.0}
DEEP = {"I136": -1.2, "I137": 0.6, "I138": -1.5, "I139": 0.6}
OTHER = {"I136": -1.0, "I137": 0.5, "I138": 0.4, "I139": -0.3}
FIRST = {"I136": -1.09375, "I137": 0.908203125, "I138": -0.169921875, "I139": 0.134765625}
"""The first filter for the paper's tool where it bends at 300 Hz: n1 alone would turn its sign at rest."""


def at_rest(now: dict[str, float]) -> float:
    """The gain of the loop at rest, in units of Ix30."""
    n1, n2, d1, d2 = (now[name] for name in NONE)
    return now["I130"] * Notch(n1=n1, n2=n2, d1=d1, d2=d2).at_rest


@pytest.mark.parametrize("before", [NONE, DEEP, OTHER, FIRST])
@pytest.mark.parametrize("after", [NONE, DEEP, OTHER, FIRST])
@pytest.mark.parametrize("scale", [300.0, 2000.0])
def test_each_state_has_a_steady_filter(before: dict[str, float], after: dict[str, float], scale: float) -> None:
    found, wanted = {**PLAIN, **before}, {**PLAIN, **after, "I130": scale, "I131": 4000.0}
    now, most = dict(found), max(at_rest(found), at_rest(wanted))
    for name, value in in_writing_order(found, wanted):
        now[name] = value
        assert abs(now["I139"]) < 1.0 and abs(now["I138"]) < 1.0 + now["I139"], "its poles are inside"
        assert 0.0 <= at_rest(now) <= most, "no positive feedback, and no more than at both ends"
        assert at_rest(now) * now["I131"] <= max(at_rest(found) * found["I131"], at_rest(wanted) * wanted["I131"])
    assert now == wanted


def test_gains_change_with_a_loop_all_the_time_or_without_force() -> None:
    for scale in (300.0, 2000.0):
        wanted = {**PLAIN, **FIRST, "I130": scale}
        order = in_writing_order({**PLAIN, **FIRST}, wanted)
        assert [name for name, _ in order].count("I130") == 1
        assert order[0 if scale < PLAIN["I130"] else -1] == ("I130", scale)
    order = in_writing_order({**PLAIN, **NONE}, {**PLAIN, **FIRST})
    assert (order[0], order[-1]) == (("I130", 0.0), ("I130", 528.0))


# The settings of a motor in millimetres, degrees and seconds.

MACHINE = load_machine("lee-2001-lathe").machine
TOOL, SPINDLE, CARRIAGE = (MotorSettings(MACHINE, number) for number in (1, 2, 3))


def with_variable(name: str, value: float) -> MachineProfile:
    variables = {**MACHINE.controller.variables, name: value}
    return replace(MACHINE, controller=replace(MACHINE.controller, variables=variables))


def test_counts_become_millimetres_and_a_stop_brakes_once_it_is_obeyed() -> None:
    # 50 counts/ms of 0.2 um; 40 counts/ms2; 16.667 counts/ms of 10,000 counts a turn.
    assert TOOL.jog_speed == pytest.approx(10.0)
    assert TOOL.abort_rate == pytest.approx(8000.0)
    assert SPINDLE.jog_speed == pytest.approx(600.0, rel=1e-4)
    assert SPINDLE.counts_per_unit == pytest.approx(27.7778, rel=1e-5)
    assert (SPINDLE.highest_counts, SPINDLE.lowest_counts) == (None, None)
    assert CARRIAGE.highest_counts is not None
    assert MotorSettings(with_variable("I111", 16_000.0), 1).error_limit_counts == 1000.0
    # 10 mm/s for 55 ms, then 10^2 / (2 * 8000) mm.
    assert TOOL.stopping_distance(10.0, 0.055) == pytest.approx(0.55 + 0.00625)
    assert TOOL.stop_s(10.0) == pytest.approx(0.00125)
    assert MotorSettings(with_variable("I115", 0.0), 1).stopping_distance(10.0, 0.055) == math.inf
