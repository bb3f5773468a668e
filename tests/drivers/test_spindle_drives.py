"""Spindles on servos and inverters, axes that jam, and encoders that are lost."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from drivers.pmac.settings import settings_with
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.drives import Drives, InverterSpindle, build_drives
from drivers.simulator.plant.spindle import SimulatedSpindle
from drivers.simulator.plant.true_parameters import TrueParameters, ideal
from profiles.machine import MachineProfile
from profiles.store import load_machine

CYCLE_S = 3_713_707 / 8_388_608_000
TURN = 10_000.0
COUNTS_PER_RAD = TURN / (2 * math.pi)
RAD_PER_S = 1000 * math.pi / 30
"""1000 rpm."""


def spindle_of(machine: MachineProfile, true: TrueParameters | None = None, **settings: float) -> SimulatedSpindle:
    true = true or replace(ideal(machine), ideal_spindle=False)
    return build_drives(machine, true, settings_with({**machine.controller.variables, **settings})).spindle


def ramp(rpm: float, seconds: float, rpm_per_s: float = 1000.0) -> list[float]:
    """Commands from rest to a speed and on, counts."""
    time_s = np.arange(1, round(seconds / CYCLE_S) + 1) * CYCLE_S
    speed = np.minimum(time_s * rpm_per_s, rpm) / 60 * TURN
    places: list[float] = (np.cumsum(speed) * CYCLE_S).tolist()
    return places


def inverter(**changed: float) -> InverterSpindle:
    values = {
        "spindle_inertia_kg_m2": 0.02,
        "spindle_drag_n_m_s_per_rad": 0.01,
        "spindle_friction_n_m": 0.0,
        "spindle_peak_torque_n_m": 50.0,
        "ramp_rpm_per_s": 500.0,
        "slip_rpm": 60.0,
    }
    true = ideal(load_machine("lee-2001-lathe").machine)
    return InverterSpindle(replace(true, **{**values, **changed}), TURN, CYCLE_S, 0.0)  # type: ignore[arg-type]


def with_inverter(machine: MachineProfile) -> MachineProfile:
    spindle = replace(machine.spindle, drive="inverter", ramp_rpm_per_s=500.0, slip_rpm=60.0)
    definitions = ("#1->X", "#3->Z")
    return replace(machine, spindle=spindle, controller=replace(machine.controller, axis_definitions=definitions))


def margins(machine: MachineProfile, inertia_kg_m2: float) -> tuple[float, float, float]:
    """Crossover in Hz, phase margin in deg and gain margin of the sampled loop, from its parts.

    The plant is a double integrator behind a hold, the output comes a cycle late, the derivative is a backward
    difference: T^2 / 2 (z + 1) / (z - 1)^2 z^-1 (Kp + Kd (1 - z^-1)).
    """
    i = machine.controller.variables
    hz = np.geomspace(1.0, 1100.0, 200_000)
    z = np.exp(2j * np.pi * hz * CYCLE_S)
    bits = i["I230"] / 2**19 * (i["I208"] + i["I209"] * i["I231"] / 128 * (1 - 1 / z))
    per_bit = machine.spindle.peak_torque_n_m / 32_768 / inertia_kg_m2 * COUNTS_PER_RAD
    loop = per_bit * CYCLE_S**2 / 2 * (z + 1) / (z - 1) ** 2 / z * bits
    phase = np.unwrap(np.angle(loop))
    phase += 2 * np.pi * round((-np.pi - phase[0]) / (2 * np.pi))
    crossing = int(np.argmax(np.abs(loop) < 1))
    turning = int(np.argmax(phase < -np.pi))
    if turning == 0:
        turning = int(np.argmax((phase < -np.pi) & (hz > hz[crossing])))
    return float(hz[crossing]), 180 + math.degrees(phase[crossing]), 1 / abs(loop[turning])


@pytest.mark.parametrize("share", [0.5, 1.0, 2.0])
def test_the_bundled_gains_have_margin_to_double_the_inertia(machine: MachineProfile, share: float) -> None:
    hz, phase_deg, gain = margins(machine, share * machine.spindle.inertia_kg_m2)
    assert hz == pytest.approx(30.5 / share, rel=0.1)
    assert phase_deg > 55
    assert gain > 4


@pytest.mark.parametrize("share", [0.5, 1.0, 2.0])
def test_a_step_rings_out_whatever_is_in_the_chuck(machine: MachineProfile, share: float) -> None:
    true = replace(
        ideal(machine),
        ideal_spindle=False,
        spindle_inertia_kg_m2=share * machine.spindle.inertia_kg_m2,
        spindle_friction_n_m=0.0,
    )
    spindle = spindle_of(machine, true)
    spindle.close_loop()
    track = np.array(spindle.follow([100.0] * round(3.0 / CYCLE_S)))
    # A derivative that acts on the error, too, makes a step overshoot by its velocity feedforward.
    assert track.max() < 100 * 1.6
    assert np.abs(track[round(1.5 / CYCLE_S) :] - 100).max() < 2.5


@pytest.mark.parametrize("rpm", [200.0, 1000.0, 3000.0])
def test_at_a_constant_speed_there_is_no_lag(machine: MachineProfile, rpm: float) -> None:
    """Drag and friction are fed forward or too small: less than a count, 0.036 deg, which is 0.1 um of 55."""
    spindle = spindle_of(machine)
    spindle.close_loop()
    seconds = rpm / 1000.0 + 1.5
    commands = ramp(rpm, seconds)
    track = np.array(spindle.follow(commands))
    tail = round(0.5 / CYCLE_S)
    assert abs((np.array(commands) - track)[-tail:].mean()) < 1.0


def test_the_torque_limits_how_fast_it_comes_up_to_speed(machine: MachineProfile) -> None:
    """J w / T: 0.1 kg m2 to 1000 rpm with 50 N m takes 0.209 s; drag and friction are 0.4 % of it."""
    true = replace(ideal(machine), ideal_spindle=False, spindle_inertia_kg_m2=0.1)
    spindle = spindle_of(machine, true)
    track = np.array(spindle.push(1.0, round(0.3 / CYCLE_S)))
    speed = np.diff(track) / CYCLE_S / COUNTS_PER_RAD
    reached_s = np.argmax(speed >= RAD_PER_S) * CYCLE_S
    assert reached_s == pytest.approx(0.1 * RAD_PER_S / 50.0, rel=0.01)
    # 10 % of the full scale is 5 N m.
    true = replace(ideal(machine), ideal_spindle=False, spindle_inertia_kg_m2=0.1)
    track = np.array(spindle_of(machine, true, I269=3276.8).push(1.0, 200))
    acceleration = np.diff(track, 2)[5:].mean() / CYCLE_S**2 / COUNTS_PER_RAD
    assert acceleration == pytest.approx(50.0, rel=0.01)


@pytest.mark.parametrize("inertia_kg_m2", [0.002, 0.004])
def test_switched_off_it_runs_out_with_j_over_b(machine: MachineProfile, inertia_kg_m2: float) -> None:
    """The drag makes 1.5 s of 0.002 kg m2; without friction the way is v J / B."""
    true = replace(
        ideal(machine), ideal_spindle=False, spindle_inertia_kg_m2=inertia_kg_m2, spindle_friction_n_m=0.0
    )
    spindle = spindle_of(machine, true)
    spindle.close_loop()
    track = spindle.follow(ramp(1000.0, 2.5))
    rest = np.array(spindle.coast(round(30.0 / CYCLE_S)))
    constant_s = 1.5 * inertia_kg_m2 / 0.002
    speed = np.diff(rest) / CYCLE_S
    assert speed[round(constant_s / CYCLE_S)] == pytest.approx(1000 / 60 * TURN * math.exp(-1), rel=0.01)
    assert rest[-1] - track[-1] == pytest.approx(1000 / 60 * TURN * constant_s, rel=0.01)


def test_the_friction_of_its_bearings_brings_it_to_rest(machine: MachineProfile) -> None:
    """tau ln(1 + B w / T): with 0.00133 N m s/rad against 0.005 N m, 5.04 s from 1000 rpm."""
    spindle = spindle_of(machine)
    spindle.close_loop()
    spindle.follow(ramp(1000.0, 2.5))
    rest = np.array(spindle.coast(round(7.0 / CYCLE_S)))
    stopped_s = np.argmax(np.diff(rest) == 0.0) * CYCLE_S
    assert stopped_s == pytest.approx(1.5 * math.log(1 + 0.002 / 1.5 * RAD_PER_S / 0.005), rel=0.01)


def test_new_gains_of_the_card_are_those_of_the_loop(machine: MachineProfile) -> None:
    """Without I230 there is no output, and the spindle stays behind."""
    true = replace(ideal(machine), ideal_spindle=False)
    lathe = SimulatedLathe(machine, true)
    port = lathe.connect()
    port.receive(b"I211=0\r#2J/\rI230=0\r#2J+\r")
    lathe.wait(1.0)
    motor = lathe.controller.motors[machine.spindle.motor]
    assert motor.desired > 5000
    assert motor.actual == pytest.approx(0, abs=2)


@pytest.mark.parametrize("kind", ["servo", "ideal", "inverter"])
@pytest.mark.parametrize(("ripple", "per_turn"), [(0.05, 2), (0.02, 3)])
def test_a_ripple_swings_the_true_speed(machine: MachineProfile, kind: str, ripple: float, per_turn: int) -> None:
    """The actual angle, fitted by waves of the mean one: the speed swings by 5 % where it is asked to."""
    if kind == "inverter":
        drive = inverter(slip_rpm=0.0)
        spindle = SimulatedSpindle(drive, TURN, CYCLE_S)
        drive.set_rpm(600.0)
        spindle.coast(round(2.0 / CYCLE_S))
        going = spindle.coast
    else:
        spindle = spindle_of(machine, replace(ideal(machine), ideal_spindle=kind == "ideal"))
        spindle.close_loop()
        commands = ramp(600.0, 4.0)
        spindle.follow(commands[: round(2.0 / CYCLE_S)])

        def going(cycles: int) -> list[float]:
            return spindle.follow(commands[-cycles:])

    spindle.speed_ripple, spindle.ripple_per_turn = ripple, per_turn
    track = np.array(going(len(ramp(600.0, 2.0))))[round(0.5 / CYCLE_S) :]
    time_s = np.arange(len(track)) * CYCLE_S
    slope, start = np.polyfit(time_s, track, 1)
    angle = 2 * np.pi * (start + slope * time_s + spindle.origin) / TURN
    swing = track - start - slope * time_s
    harmonics = np.column_stack([f(n * angle) for n in (1, 2, 3, 4) for f in (np.cos, np.sin)])
    fitted = np.linalg.lstsq(harmonics, swing, rcond=None)[0].reshape(4, 2)
    amplitudes = np.hypot(fitted[:, 0], fitted[:, 1])
    assert amplitudes[per_turn - 1] * 2 * np.pi * per_turn / TURN == pytest.approx(ripple, rel=0.1)
    assert np.delete(amplitudes, per_turn - 1).max() < 0.05 * amplitudes[per_turn - 1]


def test_a_ripple_comes_and_goes_without_a_jump_and_leaves_nothing(machine: MachineProfile) -> None:
    spindle = spindle_of(machine, ideal(machine))
    commands = ramp(600.0, 6.0)
    third = len(commands) // 3
    track = spindle.follow(commands[:third])
    spindle.speed_ripple = 0.05
    track += spindle.follow(commands[third : 2 * third])
    spindle.speed_ripple = 0.0
    track += spindle.follow(commands[2 * third :])
    step = 600 / 60 * TURN * CYCLE_S
    swing = np.diff(track)[third // 2 :] / step
    assert 0.85 < swing.min() < 0.96
    assert 1.04 < swing.max() < 1.15
    assert track[-100:] == commands[-100:]


def settled(spindle: SimulatedSpindle, there: float, seconds: float) -> np.ndarray:
    """The way of a spindle that is told to stay at a place."""
    return np.array(spindle.follow([there] * round(seconds / CYCLE_S)))


@pytest.mark.parametrize("kind", ["servo", "ideal"])
@pytest.mark.parametrize("ripple", [0.05, 0.5])
def test_a_spindle_with_a_ripple_comes_to_rest_as_told(machine: MachineProfile, kind: str, ripple: float) -> None:
    """At a quarter of a swing, where the angle is ahead by ripple / k: 40 counts for 5 % twice a turn.

    It goes back there no faster than the swing itself was, at 100 rpm 16 667 counts a second.
    """
    spindle = spindle_of(machine, replace(ideal(machine), ideal_spindle=kind == "ideal"))
    start = spindle.close_loop()
    spindle.speed_ripple = ripple
    speed = 100 / 60 * TURN
    quarter = 21 * TURN / 8 - spindle.origin
    up = [start + place for place in ramp(100.0, 1.0)]
    on = np.arange(up[-1], quarter, speed * CYCLE_S).tolist()
    swung = np.array(spindle.follow([*up, *on]))
    assert np.diff(swung)[-2000:].max() == pytest.approx((1 + ripple) * speed * CYCLE_S, rel=0.02)
    back = settled(spindle, on[-1], 1.5)
    assert abs(back[200] - on[-1]) > 5
    assert np.abs(back[-100:] - on[-1]).max() < 1.5
    assert np.abs(np.diff(back)[200:]).max() < 1.02 * ripple * speed * CYCLE_S
    spindle.speed_ripple = 0.0
    assert np.abs(settled(spindle, on[-1], 0.5) - on[-1]).max() < 1.5


def test_where_a_spindle_jams_stands_or_is_slow_there_is_no_ripple(machine: MachineProfile) -> None:
    spindle = spindle_of(machine, ideal(machine))
    spindle.close_loop()
    spindle.speed_ripple = 0.5
    commands = ramp(2.9, 10.0)
    assert spindle.follow(commands) == commands
    spindle = spindle_of(machine, ideal(machine))
    commands = ramp(600.0, 2.0)
    spindle.speed_ripple = 0.05
    spindle.follow(commands)
    spindle.jammed = True
    assert np.ptp(spindle.follow(commands)) == 0.0
    spindle = spindle_of(machine, ideal(machine))
    here = spindle.close_loop()
    spindle.speed_ripple = 0.05
    assert spindle.follow([here] * 1000) == [here] * 1000


def test_another_number_of_swings_a_turn_comes_without_a_jump(machine: MachineProfile) -> None:
    spindle = spindle_of(machine, ideal(machine))
    commands = ramp(600.0, 4.0)
    half = len(commands) // 2
    spindle.speed_ripple = 0.05
    track = spindle.follow(commands[:half])
    spindle.ripple_per_turn = 3
    for block in range(half, len(commands), 11):
        track += spindle.follow(commands[block : block + 11])
    swing = np.diff(track)[half // 2 :] / (600 / 60 * TURN * CYCLE_S)
    assert np.abs(swing - 1.0).max() < 0.08
    assert (swing[-2000:].min(), swing[-2000:].max()) == pytest.approx((0.95, 1.05), abs=0.002)


def test_an_inverter_ramps_at_its_rate_and_slips_under_load(machine: MachineProfile) -> None:
    """500 rpm/s to 1000 rpm is 2 s, and so is the way back; half of the speed on the average."""
    spindle = inverter(slip_rpm=0.0)
    spindle.set_rpm(1000.0)
    track = spindle.coast(round(2.0 / CYCLE_S))
    assert spindle.speed_rpm == pytest.approx(1000.0, rel=1e-3)
    assert track[-1] == pytest.approx(500.0 / 60 * 2.0 * TURN, rel=1e-3)
    spindle.set_rpm(-500.0)
    spindle.coast(round(3.0 / CYCLE_S))
    assert spindle.speed_rpm == pytest.approx(-500.0, rel=1e-3)
    # 60 rpm at 50 N m: 12 rpm for 10 N m more. Its own drag, 0.01 x 104.1 N m, takes 1.2 rpm.
    spindle = inverter()
    spindle.set_rpm(1000.0)
    spindle.coast(round(3.0 / CYCLE_S))
    free = spindle.speed_rpm
    assert free == pytest.approx(1000.0 - 60.0 / 50.0 * 0.01 * RAD_PER_S, abs=0.05)
    spindle.load_n_m = 10.0
    spindle.coast(1)
    assert free - spindle.speed_rpm == pytest.approx(12.0, abs=0.1)


def test_an_inverter_spindle_runs_out_by_its_friction_and_is_caught_at_its_speed() -> None:
    """J / B is 2 s."""
    spindle = inverter(slip_rpm=0.0)
    spindle.set_rpm(1000.0)
    spindle.coast(round(2.5 / CYCLE_S))
    spindle.switch_off()
    spindle.coast(round(2.0 / CYCLE_S))
    assert spindle.speed_rpm == pytest.approx(1000.0 * math.exp(-1), rel=1e-3)
    spindle.set_rpm(1000.0)
    spindle.coast(1)
    assert spindle.speed_rpm == pytest.approx(1000.0 * math.exp(-1), rel=2e-3)
    spindle = inverter(spindle_friction_n_m=0.5)
    spindle.set_rpm(1000.0)
    spindle.coast(round(2.5 / CYCLE_S))
    spindle.switch_off()
    stop_s = 2.0 * math.log(1 + 0.01 * RAD_PER_S / 0.5)
    spindle.coast(round(0.97 * stop_s / CYCLE_S))
    assert spindle.speed_rpm > 1.0
    spindle.coast(round(0.06 * stop_s / CYCLE_S))
    assert spindle.speed_rpm == 0.0


def test_a_jammed_inverter_spindle_stands_and_comes_up_again_by_its_ramp() -> None:
    spindle = inverter()
    spindle.set_rpm(1000.0)
    spindle.coast(round(2.5 / CYCLE_S))
    spindle.jammed = True
    # The speed changes evenly through a cycle, so the last of it is used up in the first one.
    assert np.ptp(spindle.coast(100)[1:]) == 0.0
    spindle.jammed = False
    spindle.coast(round(1.0 / CYCLE_S))
    assert spindle.speed_rpm == pytest.approx(500.0, rel=0.01)


def test_the_card_does_not_move_a_spindle_that_is_set_at_the_lathe(machine: MachineProfile) -> None:
    """Neither its output nor a kill does anything; it reads 600 rpm, less the slip, and the spindle at rest."""
    lathe = SimulatedLathe(with_inverter(machine))
    port = lathe.connect()
    motor = lathe.controller.motors[machine.spindle.motor]
    port.receive(b"#2O50\r")
    lathe.wait(1.0)
    assert motor.actual == 0.0
    lathe.set_spindle(600.0)
    lathe.wait(3.0)
    before = motor.actual
    lathe.wait(1.0)
    rpm = (motor.actual - before) / TURN * 60
    assert 595.0 < rpm < 600.0
    port.receive(b"\x0b")
    lathe.wait(1.0)
    assert motor.actual - before > 1.9 * 10.0 * TURN - 1000
    lathe.set_spindle(None)
    lathe.wait(30.0)
    before = motor.actual
    lathe.wait(1.0)
    assert motor.actual == before


def test_a_spindle_of_the_card_cannot_be_set_at_the_lathe(machine: MachineProfile) -> None:
    lathe = SimulatedLathe(machine)
    with pytest.raises(RuntimeError, match="no inverter"):
        lathe.set_spindle(100.0)
    with pytest.raises(RuntimeError, match="no inverter"):
        lathe.set_spindle(None)


@pytest.mark.parametrize("rpm", [3000.1, -3001.0, math.nan, math.inf])
def test_a_speed_that_the_spindle_is_not_made_for_is_refused(machine: MachineProfile, rpm: float) -> None:
    lathe = SimulatedLathe(with_inverter(machine))
    with pytest.raises(RuntimeError, match="at most 3000 rpm"):
        lathe.set_spindle(rpm)


def test_an_encoder_behind_a_belt_counts_its_own_turns(machine: MachineProfile) -> None:
    """Ten turns of the chuck are 100 000 counts of an encoder on the spindle, 102 000 behind a belt of 1.02."""
    true = replace(ideal(machine), belt_ratio=1.02, jaw_1_deg=0.0, spindle_start_turns=0.0)
    lathe = SimulatedLathe(machine, true)
    port = lathe.connect()
    port.receive(b"#2J/\r#2J=102000\r")
    lathe.wait(12.0)
    assert lathe.controller.motors[2].actual == pytest.approx(102_000.0)
    assert lathe.look().jaw_1_past_mark_deg == 0.0
    port.receive(b"#2J=100000\r")
    lathe.wait(12.0)
    assert lathe.look().jaw_1_past_mark_deg == pytest.approx(-360.0 * 2000 / 10_200, abs=0.01)


# An axis whose encoder has stopped counting, and one that is jammed.

AXES = ("tool", "spindle", "carriage")


def drives(machine: MachineProfile) -> Drives:
    true = replace(ideal(machine), ideal_spindle=False)
    return build_drives(machine, true, settings_with(machine.controller.variables))


@pytest.mark.parametrize("name", ["spindle", "carriage"])
def test_an_ideal_axis_closes_its_loop_on_the_last_reading_and_stands(machine: MachineProfile, name: str) -> None:
    """As a servo does: the iron has run out by so much that nobody has seen, and stays where it is."""
    axis = getattr(build_drives(machine, ideal(machine), settings_with(machine.controller.variables)), name)
    axis.close_loop()
    axis.follow([50.0] * 100)
    axis.encoder_lost = True
    there = axis.push(0.05, 200)[-1]
    assert there > 60.0
    assert axis.close_loop() == 50.0
    assert axis.follow([50.0, 60.0]) == pytest.approx([there, there + 10.0])
    axis.encoder_lost = False
    axis.rebase(there - 50.0)
    assert axis.follow([60.0]) == [60.0]
    assert axis.close_loop() == 60.0


def test_a_spindle_on_an_inverter_is_held_where_it_was_last_read() -> None:
    spindle = inverter()
    spindle.set_rpm(600.0)
    spindle.coast(2000)
    seen = spindle.close_loop()
    spindle.encoder_lost = True
    spindle.coast(2000)
    assert spindle.close_loop() == seen
    spindle.encoder_lost = False
    assert spindle.close_loop() > seen + 1000


@pytest.mark.parametrize("name", AXES)
def test_a_new_axis_has_nothing_the_matter(machine: MachineProfile, name: str) -> None:
    axis = getattr(drives(machine), name)
    assert (axis.encoder_lost, axis.jammed) == (False, False)


@pytest.mark.parametrize("name", AXES)
def test_what_is_jammed_stands_whatever_it_is_told(machine: MachineProfile, name: str) -> None:
    axis = getattr(drives(machine), name)
    here = axis.close_loop()
    there = axis.follow([here + 2.0 * n for n in range(200)])[-1]
    axis.jammed = True
    held = axis.follow([there + 2.0 * n for n in range(200)]) + axis.push(1.0, 50) + axis.coast(50)
    # A position is that at the beginning of the cycle, so the first may be one cycle on.
    assert np.ptp(held[1:]) == 0.0
    assert held[1] == pytest.approx(there, abs=3.0)


def test_a_jammed_tool_pushes_with_all_that_it_has_and_goes_on_when_it_is_free(machine: MachineProfile) -> None:
    tool = drives(machine).tool
    tool.close_loop()
    tool.jammed = True
    tool.follow([200_000.0] * 5)
    assert tool.output_bits / tool.limit_bits == 1.0
    tool.jammed = False
    assert tool.follow([200_000.0] * 50)[-1] > 100.0


def test_a_loop_that_sees_only_its_last_reading_runs_away(machine: MachineProfile) -> None:
    """The error of 20 counts stays: the force of 20 x 9.28 bits/5 counts accelerates the slide until it drags."""
    tool = drives(machine).tool
    tool.close_loop()
    tool.follow([0.0] * 10)
    tool.encoder_lost = True
    track = np.array(tool.follow([20.0] * round(0.5 / 0.000442)))
    force_n = 147.6 * 20 / 5e6 * 11.45 * 54.5
    # The end of v = F / B (1 - exp(-t B / M)), whose time constant is 23.5 ms; the integrator adds a little.
    speed = (track[-1] - track[-2]) / 0.00044270837 / 5e6
    assert speed == pytest.approx(force_n / 201.6, rel=0.15)
    assert track[-1] > 50 * 20


def test_a_reading_that_has_stopped_is_what_a_closed_loop_begins_with(machine: MachineProfile) -> None:
    tool = drives(machine).tool
    tool.close_loop()
    tool.follow([50.0] * 4000)
    tool.encoder_lost = True
    tool.push(0.05, 200)
    assert tool.close_loop() == pytest.approx(50.0, abs=1.0)


def test_an_encoder_that_counts_again_goes_on_from_where_it_stopped(machine: MachineProfile) -> None:
    """The zero has moved by what was lost; what is read has not, so nothing jumps."""
    tool = drives(machine).tool
    tool.close_loop()
    tool.follow([0.0] * 10)
    tool.encoder_lost = True
    drifted = tool.follow([20.0] * 200)[-1]
    tool.encoder_lost = False
    origin = tool.origin
    tool.rebase(drifted)
    assert tool.origin == origin + drifted
    track = np.array(tool.follow([20.0] * 6000))
    # It was on its way at some speed, and comes back to the error of 20 counts that it can see.
    assert np.abs(np.diff(track)).max() < 20.0
    assert track[-1] == pytest.approx(20.0, abs=1.5)
