"""Faults of the card and its motors: strangers, watchdogs, amplifiers, encoders."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest

from drivers.errors import LinkTimeoutError
from drivers.lathe.snapshot import AxisName
from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.language.text import format_number
from drivers.simulator.hosts.control_socket import answer
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.true_parameters import ideal
from profiles.machine import MachineProfile
from tests.drivers.conftest import Bench, TrueBenchMaker
from tests.drivers.wire_card import CYCLE_S, Wire, wire

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


# A host that nobody knows of: what it meets on the card is what every host meets.

WRITE = "inject stranger-writes 'line=P5=7 P5'"


@pytest.fixture
def card(machine: MachineProfile) -> Wire:
    return wire(machine)


def p5(sim: SimulatedLathe) -> float:
    return sim.controller.variables.get(VariableKind.P, 5)


def told(card: Wire, line: str) -> str:
    """The line of an answer that tells what has become of the line of the stranger."""
    _, *outcome, verdict = answer(card.sim, line).splitlines()
    assert verdict == "ok"
    return "".join(outcome)


def test_what_it_is_told_is_the_answer(card: Wire) -> None:
    assert told(card, WRITE) == "the stranger was told: 7<CR><ACK>"
    assert told(card, "inject stranger-writes line=P6=1") == "the stranger was told: <ACK>"
    assert card.port.take_output() == b""
    injected = card.sim.faults.inject("stranger-writes", line="P5")
    assert injected.effect.outcome() == "the stranger was told: 7<CR><ACK>"


@pytest.mark.parametrize("line", ["UUU", "P1=" + "1" * 260], ids=["garbage", "too long"])
def test_what_the_card_refuses_is_told_with_its_number(card: Wire, line: str) -> None:
    """003 is a data error (Software Reference, I6)."""
    assert told(card, f"inject stranger-writes line={line}") == "the stranger was refused: ERR003"
    assert card.ask("P1") == ["0"]
    card.raw("I6=0\r")
    assert told(card, f"inject stranger-writes line={line}") == "the stranger was refused: <BEL>"


def test_a_dead_card_does_not_obey_and_forgets(card: Wire) -> None:
    card.sim.faults.inject("watchdog")
    assert told(card, WRITE) == "the stranger was told: nothing"
    card.sim.wait(0.1)
    card.sim.power_cycle()
    card.sim.wait(0.1)
    assert p5(card.sim) == 0


def test_a_hanging_card_obeys_when_it_reads_again(card: Wire) -> None:
    card.sim.faults.inject("hang", for_s=0.2)
    injected = card.sim.faults.inject("stranger-writes", line="P5=7 P5")
    card.sim.wait(0.19)
    assert (p5(card.sim), injected.effect.outcome()) == (0, "")
    assert [fault.fault.name for fault in card.sim.faults.active()] == ["hang", "stranger-writes"]
    card.sim.wait(5 * CYCLE_S)
    assert (p5(card.sim), injected.effect.outcome()) == (7, "the stranger was told: 7<CR><ACK>")
    assert card.sim.faults.active() == ()


def test_what_a_hanging_card_has_not_read_is_lost_with_its_power(card: Wire) -> None:
    card.sim.faults.inject("hang", for_s=0.2)
    card.sim.faults.inject("stranger-writes", line="P5=7")
    card.sim.power_cycle()
    card.sim.wait(0.5)
    assert p5(card.sim) == 0
    assert card.sim.faults.active() == ()


def test_a_cut_cable_is_cut_for_strangers_too(card: Wire) -> None:
    card.sim.faults.inject("cut-cable", after_s=0.05, for_s=0.1)
    card.sim.faults.inject("hang", for_s=0.1)
    waiting = card.sim.faults.inject("stranger-writes", line="P5=7")
    card.sim.wait(0.07)
    assert waiting.effect.outcome() == "the stranger is cut off"
    assert told(card, WRITE) == "the stranger cannot be connected: the cable is cut"
    card.sim.wait(0.2)
    assert p5(card.sim) == 0


def test_a_slow_background_reads_it_in_its_cycle(card: Wire) -> None:
    card.sim.faults.inject("slow-background", cycle_ms=100)
    card.sim.faults.inject("stranger-writes", line="P5=7")
    card.sim.wait(0.05)
    assert p5(card.sim) == 0
    card.sim.wait(0.06)
    assert p5(card.sim) == 7


def test_a_buffer_and_a_caret_of_a_stranger_are_what_they_are(card: Wire) -> None:
    card.sim.faults.inject("stranger-writes", line="OPEN PROG 5")
    assert card.refusal("OPEN PROG 6") == 7
    # 5 and 3 have 6 between them, bit by bit.
    assert told(card, "inject stranger-writes 'line=P5=5^3 P5'") == "the stranger was told: 6<CR><ACK>"


@pytest.mark.parametrize(("character", "closed"), [("^A", True), ("^K", False), ("^P", None)])
def test_it_sends_control_characters_as_other_hosts_do(card: Wire, character: str, closed: bool | None) -> None:
    """Control-A closes every loop, control-K opens all of them, and control-P is answered."""
    motor = card.sim.controller.motors[1]
    if closed is not True:
        card.tell("#1J/")
    before = motor.enabled
    heard = told(card, f"inject stranger-writes line={character}")
    assert motor.enabled is (before if closed is None else closed)
    assert (heard != "the stranger was told: nothing") is (closed is None)


# The watchdog: when a background cycle is too late, and what is left of a card then.


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def watchdog_card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    return wire(machine, request.param)


def silent(watchdog_card: Wire, seconds: float = 0.1) -> bool:
    watchdog_card.port.receive(b"P1\r")
    watchdog_card.sim.wait(seconds)
    return watchdog_card.port.take_output() == b""


@pytest.mark.parametrize(
    ("dialect", "setting", "allowed_s"),
    [
        # 512 real-time interrupts, each of I8 + 1 = 3 servo cycles; with I8 = 0 of one.
        (PMAC, "I8=2", 1536 * 0.4427083730697632e-3),
        (PMAC, "I8=0", 512 * 0.4427083730697632e-3),
        # 4096 servo cycles; 227 of them with I40 = 226.
        (TURBO, "I40=0", 4096 * 0.4427083730697632e-3),
        (TURBO, "I40=226", 227 * 0.4427083730697632e-3),
    ],
)
def test_a_background_cycle_may_be_as_late_as_the_watchdog_lets_it(
    machine: MachineProfile, dialect: Dialect, setting: str, allowed_s: float
) -> None:
    for cycle_s, trips in ((allowed_s - 2 * CYCLE_S, False), (allowed_s + 2 * CYCLE_S, True)):
        watchdog_card = wire(machine, dialect)
        watchdog_card.tell(setting)
        watchdog_card.sim.faults.inject("slow-background", cycle_ms=1000 * cycle_s)
        watchdog_card.sim.wait(allowed_s + 3 * CYCLE_S)
        assert watchdog_card.card.watchdog_tripped is trips


def test_a_background_cycle_that_nothing_slows_down_is_never_late(machine: MachineProfile) -> None:
    """Or a host could bring the card down with I40 = 1."""
    watchdog_card = wire(machine, TURBO)
    watchdog_card.tell("I40=1")
    watchdog_card.sim.wait(0.1)
    assert watchdog_card.ask("I40") == ["1"]
    watchdog_card.sim.faults.inject("slow-background", cycle_ms=10)
    watchdog_card.sim.wait(0.02)
    assert watchdog_card.card.watchdog_tripped


def test_a_slow_background_answers_late_and_once_a_cycle(watchdog_card: Wire) -> None:
    watchdog_card.sim.faults.inject("slow-background", cycle_ms=50)
    watchdog_card.sim.wait(0.06)
    watchdog_card.port.take_output()
    answered = []
    for number in range(60):
        watchdog_card.port.receive(b"P1\r")
        watchdog_card.sim.attend(watchdog_card.port)
        watchdog_card.sim.wait(CYCLE_S)
        if watchdog_card.port.take_output():
            answered.append(number)
    # 50 ms are reached with the 11th background cycle of 11 servo cycles.
    assert [b - a for a, b in pairwise(answered)] == pytest.approx([11] * 4, abs=1)


def test_a_stop_and_a_limit_come_late_in_a_slow_background(closed: Bench) -> None:
    closed.sim.faults.inject("slow-background", cycle_ms=200)
    closed.sim.wait(0.25)
    motor = closed.sim.controller.motors[1]
    closed.port.receive(b"\x0b")
    motor.fault_input = True
    closed.sim.wait(0.1)
    assert motor.enabled
    closed.sim.wait(0.11)
    assert not motor.enabled


def test_a_program_goes_on_in_a_slow_background(bench: Bench) -> None:
    """It is computed in the foreground."""
    bench.lathe.enable()
    bench.program("X1000 F100000", "P9=1")
    bench.client.request("R")
    bench.sim.faults.inject("slow-background", cycle_ms=400)
    bench.sim.wait(0.3)
    assert bench.sim.controller.motors[1].desired != 0


def test_a_card_whose_watchdog_has_tripped_is_dead_until_it_is_switched_off_and_on(watchdog_card: Wire) -> None:
    watchdog_card.tell("P1=25", "#1J/", "OPEN PLC 1 CLEAR", "P1=P1+1", "CLOSE", "I5=3", "ENABLE PLC 1")
    watchdog_card.sim.faults.inject("watchdog", after_s=0.05)
    watchdog_card.sim.wait(0.06)
    settings = watchdog_card.card.variables
    before = (watchdog_card.card.motors[1].amplifier_enabled, silent(watchdog_card), silent(watchdog_card, 2.0))
    assert before == (False, True, True)
    watchdog_card.sim.faults.clear()
    assert silent(watchdog_card), "nothing but the mains switch helps"
    assert [fault.fault.name for fault in watchdog_card.sim.faults.active()] == ["watchdog"]
    watchdog_card.sim.power_cycle()
    assert watchdog_card.sim.faults.active() == ()
    assert settings.i(5) != 3, "as at power-up"
    assert watchdog_card.raw("I3=2 I6=1\rP2=1 P2\r").endswith(b"1\r\x06"), "what came before is forgotten"


def test_its_plcs_stand_still(watchdog_card: Wire) -> None:
    watchdog_card.tell("P1=0", "OPEN PLC 1 CLEAR", "P1=P1+1", "CLOSE", "I5=3", "ENABLE PLC 1")
    watchdog_card.sim.wait(0.1)
    watchdog_card.sim.faults.inject("watchdog")
    store = watchdog_card.card.variables
    counted = store.get(VariableKind.P, 1)
    watchdog_card.sim.wait(0.2)
    assert store.get(VariableKind.P, 1) == counted > 10


def test_a_turbo_tells_of_it_until_the_next_reset(machine: MachineProfile) -> None:
    """Turbo Software Reference ???: word 1, bit 15."""
    watchdog_card = wire(machine, TURBO)
    assert int(watchdog_card.ask("???")[0][:6], 16) >> 15 & 1 == 0
    watchdog_card.sim.faults.inject("watchdog")
    watchdog_card.sim.power_cycle()
    watchdog_card.raw("I3=2 I6=1\r")
    assert int(watchdog_card.ask("???")[0][:6], 16) >> 15 & 1 == 1
    watchdog_card.raw("$$$\r")
    watchdog_card.raw("I3=2 I6=1\r")
    assert int(watchdog_card.ask("???")[0][:6], 16) >> 15 & 1 == 0


def test_a_killed_axis_runs_out(closed: Bench) -> None:
    closed.client.request("#2J+")
    closed.sim.wait(0.5)
    motor = closed.sim.controller.motors[2]
    before = motor.actual
    closed.sim.faults.inject("watchdog")
    closed.sim.wait(0.5)
    assert motor.actual > before + 100
    assert not motor.amplifier_enabled


def test_the_client_gives_up_on_a_dead_card_and_is_served_again_after_a_power_cycle(bench: Bench) -> None:
    bench.sim.faults.inject("watchdog")
    with pytest.raises(LinkTimeoutError):
        bench.client.numbers("P1")
    with pytest.raises(LinkTimeoutError):
        bench.lathe.connect()
    bench.sim.power_cycle()
    bench.lathe.connect()
    assert bench.lathe.verify() == ()


def test_what_a_host_sends_to_a_dead_card_is_lost(watchdog_card: Wire) -> None:
    watchdog_card.sim.faults.inject("watchdog")
    watchdog_card.port.receive(b"P3=99\r")
    watchdog_card.sim.power_cycle()
    watchdog_card.raw("I3=2 I6=1\r")
    assert watchdog_card.ask("P3") == ["0"]


def test_a_fault_of_the_line_outlives_a_power_cycle(machine: MachineProfile) -> None:
    sim = SimulatedLathe(machine)
    sim.faults.inject("nul")
    sim.power_cycle()
    assert [fault.fault.name for fault in sim.faults.active()] == ["nul"]
