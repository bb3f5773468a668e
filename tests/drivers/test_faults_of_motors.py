"""Faults of motors and the other faults of the card, as a host sees them in positions and status words."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest

from drivers.lathe.snapshot import AxisName
from drivers.pmac.dialect import PMAC, TURBO
from drivers.pmac.language.text import format_number
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.true_parameters import ideal
from profiles.machine import MachineProfile
from tests.drivers.conftest import Bench, TrueBenchMaker
from tests.drivers.wire_card import wire

MOTORS = {"tool": 1, "spindle": 2, "carriage": 3}

# PMAC Software Reference, ?: word 1 bits 22 and 21 limits, 10 home search; word 2 bits 14, 10, 3 and 2.
NEGATIVE_LIMIT, POSITIVE_LIMIT, SEARCHING = 1 << 46, 1 << 45, 1 << 34
AMPLIFIER_ON, HOMED, AMPLIFIER_FAULT, FATAL_ERROR = 1 << 14, 1 << 10, 1 << 3, 1 << 2


def status(bench: Bench, motor: int) -> int:
    return int(bench.ask(f"#{motor}?"), 16)


@pytest.mark.parametrize("axis", MOTORS)
def test_an_amplifier_fault_switches_its_motor_off_until_it_is_over(closed: Bench, axis: str) -> None:
    number = MOTORS[axis]
    closed.sim.faults.inject("amplifier-fault", motor=axis, for_s=0.5)
    closed.sim.wait(0.02)
    assert status(closed, number) & (AMPLIFIER_ON | AMPLIFIER_FAULT) == AMPLIFIER_FAULT
    closed.client.request(f"#{number}J/")
    closed.sim.wait(0.02)
    assert status(closed, number) & (AMPLIFIER_ON | AMPLIFIER_FAULT) == AMPLIFIER_FAULT
    closed.sim.wait(0.5)
    closed.client.request(f"#{number}J/")
    closed.sim.wait(0.02)
    assert status(closed, number) & (AMPLIFIER_ON | AMPLIFIER_FAULT) == AMPLIFIER_ON


@pytest.mark.parametrize(
    ("direction", "jog", "bit"), [("positive", "+", POSITIVE_LIMIT), ("negative", "-", NEGATIVE_LIMIT)]
)
def test_a_limit_stops_travel_in_its_direction_alone(closed: Bench, direction: str, jog: str, bit: int) -> None:
    closed.client.request(f"#3J{jog}")
    closed.sim.wait(0.3)
    closed.sim.faults.inject("limit", motor="carriage", direction=direction)
    closed.sim.wait(1.0)
    assert status(closed, 3) & (POSITIVE_LIMIT | NEGATIVE_LIMIT) == bit
    stopped = closed.number("#3P")
    closed.sim.wait(0.5)
    assert closed.number("#3P") == stopped
    closed.client.request(f"#3J{jog}")
    closed.sim.wait(0.5)
    assert closed.number("#3P") == stopped
    closed.client.request(f"#3J{'-' if jog == '+' else '+'}")
    closed.sim.wait(0.5)
    assert abs(closed.number("#3P") - stopped) > 100
    closed.sim.faults.clear()
    closed.sim.wait(0.02)
    assert not status(closed, 3) & (POSITIVE_LIMIT | NEGATIVE_LIMIT)


def test_a_lost_index_is_searched_for_until_it_is_back(closed: Bench) -> None:
    closed.sim.faults.inject("index-lost", motor="spindle")
    closed.client.request("#2HM")
    closed.sim.wait(6.0)  # I223 = 5 counts/ms: three turns
    assert status(closed, 2) & (SEARCHING | HOMED) == SEARCHING
    closed.sim.faults.clear()
    closed.sim.wait(3.0)
    assert status(closed, 2) & (SEARCHING | HOMED) == HOMED


def test_a_lost_encoder_runs_away_unseen_and_trips(closed: Bench) -> None:
    motor = closed.sim.controller.motors[1]
    closed.client.request("#1J=100")
    closed.sim.wait(2.0)
    place = closed.number("#1P")
    true_position = motor.true_position
    closed.sim.faults.inject("encoder-loss", motor="tool")
    closed.client.request("#1J=20000")
    closed.sim.wait(2.0)
    assert closed.number("#1P") == place, "what is seen"
    assert abs(motor.true_position - true_position) > 500, "and what is: a hundred um and more"
    assert status(closed, 1) & (AMPLIFIER_ON | FATAL_ERROR) == FATAL_ERROR


@pytest.mark.parametrize("axis", ["tool", "carriage"])
def test_a_jam_lasts_until_the_following_error_trips(closed: Bench, axis: str) -> None:
    number = MOTORS[axis]
    motor = closed.sim.controller.motors[number]
    closed.sim.faults.inject("following-error-trip", motor=axis)
    true_position = motor.true_position
    closed.sim.wait(0.5)
    assert len(closed.sim.faults.active()) == 1, "at rest nothing trips"
    closed.client.request(f"#{number}J:30000")
    closed.sim.wait(1.99)
    assert status(closed, number) & (AMPLIFIER_ON | FATAL_ERROR) == FATAL_ERROR
    assert closed.sim.faults.active() == ()
    assert abs(motor.true_position - true_position) < 2
    closed.client.request(f"#{number}J/")
    closed.client.request(f"#{number}J:1000")
    closed.sim.wait(2.0)
    assert abs(motor.true_position - true_position - 1000) < 100
    assert not status(closed, number) & FATAL_ERROR


def test_the_ripple_of_the_spindle_is_of_the_asked_size_and_number(closed: Bench) -> None:
    """A speed of (1 + r sin(k a)) times its mean, a the angle, is r of it at its extremes, k times a turn."""
    closed.client.request("#2J+")
    closed.sim.wait(2.0)
    closed.sim.faults.inject("spindle-ripple", ripple_percent=8, per_turn=3)
    recorder = closed.record(2)
    closed.sim.wait(1.2)  # two turns at 16.667 counts/ms
    track = recorder.positions
    steps = [b - a for a, b in pairwise(track)]
    mean = 16.667 * closed.cycle_ms
    assert max(steps) == pytest.approx(1.08 * mean, rel=0.005)
    assert min(steps) == pytest.approx(0.92 * mean, rel=0.005)
    crossings = sum((a < mean) != (b < mean) for a, b in pairwise(steps))
    assert crossings == pytest.approx(2 * 3 * 2, abs=1)
    closed.sim.faults.clear()
    closed.sim.wait(1.2)  # it fades within a turn or two
    recorder.positions.clear()
    closed.sim.wait(0.3)
    steps = [b - a for a, b in pairwise(recorder.positions)]
    assert steps == pytest.approx([mean] * len(steps), rel=1e-3)


@pytest.mark.parametrize("ideal_spindle", [True, False])
def test_jogs_end_in_position_with_a_ripple_and_a_clear_at_rest_leaves_nothing(
    machine: MachineProfile, bench_with: TrueBenchMaker, ideal_spindle: bool
) -> None:
    bench = bench_with(replace(ideal(machine), ideal_spindle=ideal_spindle))
    bench.lathe.enable()
    bench.sim.faults.inject("spindle-ripple")
    for target in (1250.0, 8100.0, -3750.0):
        bench.lathe.jog_to(AxisName.SPINDLE, target)
        assert bench.number("#2P") == pytest.approx(target, abs=10)
    bench.sim.wait(0.5)
    there = bench.number("#2P")
    bench.sim.faults.clear()
    bench.sim.wait(0.5)
    assert bench.number("#2P") == pytest.approx(there, abs=1)


def test_a_stranger_changes_a_gain_of_the_tool_behind_the_back_of_everybody(bench: Bench) -> None:
    assert bench.lathe.verify() == ()
    bench.sim.faults.inject("stranger-writes", after_s=0.5)
    assert bench.lathe.verify() == ()
    bench.sim.wait(0.51)
    assert bench.number("I130") == pytest.approx(0.9 * 528)
    (found,) = bench.lathe.verify()
    assert (found.key, found.code) == ("I130", "controller.setting")
    assert bench.sim.faults.active() == ()
    assert bench.port.take_output() == b"", "nobody else hears of it"


def test_a_stranger_sends_any_line_and_what_the_card_refuses_has_no_effect(bench: Bench) -> None:
    bench.sim.faults.inject("stranger-writes", line="P5=7")
    bench.sim.faults.inject("stranger-writes", line="P5=8 UUU P5=9")
    assert bench.number("P5") == 7
    assert bench.ask("#") == "1"


@pytest.mark.parametrize("dialect", [PMAC, TURBO], ids=lambda dialect: dialect.name)
def test_each_family_has_the_faults(machine: MachineProfile, dialect: object) -> None:
    card = wire(machine, dialect)  # type: ignore[arg-type]
    card.sim.faults.inject("stranger-writes")
    assert card.ask("I130") == [format_number(0.9 * 528)]


def test_two_of_a_kind_end_with_the_later_one(machine: MachineProfile) -> None:
    sim = SimulatedLathe(machine)
    sim.faults.inject("amplifier-fault", for_s=0.2)
    sim.faults.inject("amplifier-fault", for_s=0.4)
    motor = sim.controller.motors[1]
    sim.wait(0.3)
    assert motor.fault_input
    sim.wait(0.2)
    assert not motor.fault_input


def test_the_same_faults_make_the_same_run(machine: MachineProfile) -> None:
    def run() -> tuple[float, ...]:
        sim = SimulatedLathe(machine)
        port = sim.connect()
        port.receive(b"#1J/#2J/#2J+\r")
        sim.faults.inject("spindle-ripple", after_s=0.3, for_s=0.4, seed=5)
        sim.faults.inject("following-error-trip", after_s=0.2)
        sim.faults.inject("late-reply", share=0.5, seed=5)
        port.receive(b"#1J=5000\r")
        sim.wait(1.5)
        return tuple(motor.actual for motor in sim.controller.motors.values())

    first = run()
    assert first == run()
    assert not math.isclose(first[1], 0.0)
