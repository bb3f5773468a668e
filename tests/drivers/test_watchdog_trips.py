"""The watchdog: when a background cycle is too late, and what is left of a card then."""

from __future__ import annotations

from itertools import pairwise

import pytest

from drivers.errors import LinkTimeoutError
from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.language.syntax import VariableKind
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from tests.drivers.conftest import Bench
from tests.drivers.wire_card import CYCLE_S, Wire, wire


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    return wire(machine, request.param)


def silent(card: Wire, seconds: float = 0.1) -> bool:
    card.port.receive(b"P1\r")
    card.sim.wait(seconds)
    return card.port.take_output() == b""


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
        card = wire(machine, dialect)
        card.tell(setting)
        card.sim.faults.inject("slow-background", cycle_ms=1000 * cycle_s)
        card.sim.wait(allowed_s + 3 * CYCLE_S)
        assert card.card.watchdog_tripped is trips


def test_a_background_cycle_that_nothing_slows_down_is_never_late(machine: MachineProfile) -> None:
    """Or a host could bring the card down with I40 = 1."""
    card = wire(machine, TURBO)
    card.tell("I40=1")
    card.sim.wait(0.1)
    assert card.ask("I40") == ["1"]
    card.sim.faults.inject("slow-background", cycle_ms=10)
    card.sim.wait(0.02)
    assert card.card.watchdog_tripped


def test_a_slow_background_answers_late_and_once_a_cycle(card: Wire) -> None:
    card.sim.faults.inject("slow-background", cycle_ms=50)
    card.sim.wait(0.06)
    card.port.take_output()
    answered = []
    for number in range(60):
        card.port.receive(b"P1\r")
        card.sim.attend(card.port)
        card.sim.wait(CYCLE_S)
        if card.port.take_output():
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


def test_a_card_whose_watchdog_has_tripped_is_dead_until_it_is_switched_off_and_on(card: Wire) -> None:
    card.tell("P1=25", "#1J/", "OPEN PLC 1 CLEAR", "P1=P1+1", "CLOSE", "I5=3", "ENABLE PLC 1")
    card.sim.faults.inject("watchdog", after_s=0.05)
    card.sim.wait(0.06)
    settings = card.card.variables
    before = (card.card.motors[1].amplifier_enabled, silent(card), silent(card, 2.0))
    assert before == (False, True, True)
    card.sim.faults.clear()
    assert silent(card), "nothing but the mains switch helps"
    assert [fault.fault.name for fault in card.sim.faults.active()] == ["watchdog"]
    card.sim.power_cycle()
    assert card.sim.faults.active() == ()
    assert settings.i(5) != 3, "as at power-up"
    assert card.raw("I3=2 I6=1\rP2=1 P2\r").endswith(b"1\r\x06"), "what came before is forgotten"


def test_its_plcs_stand_still(card: Wire) -> None:
    card.tell("P1=0", "OPEN PLC 1 CLEAR", "P1=P1+1", "CLOSE", "I5=3", "ENABLE PLC 1")
    card.sim.wait(0.1)
    card.sim.faults.inject("watchdog")
    store = card.card.variables
    counted = store.get(VariableKind.P, 1)
    card.sim.wait(0.2)
    assert store.get(VariableKind.P, 1) == counted > 10


def test_a_turbo_tells_of_it_until_the_next_reset(machine: MachineProfile) -> None:
    """Turbo Software Reference ???: word 1, bit 15."""
    card = wire(machine, TURBO)
    assert int(card.ask("???")[0][:6], 16) >> 15 & 1 == 0
    card.sim.faults.inject("watchdog")
    card.sim.power_cycle()
    card.raw("I3=2 I6=1\r")
    assert int(card.ask("???")[0][:6], 16) >> 15 & 1 == 1
    card.raw("$$$\r")
    card.raw("I3=2 I6=1\r")
    assert int(card.ask("???")[0][:6], 16) >> 15 & 1 == 0


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


def test_what_a_host_sends_to_a_dead_card_is_lost(card: Wire) -> None:
    card.sim.faults.inject("watchdog")
    card.port.receive(b"P3=99\r")
    card.sim.power_cycle()
    card.raw("I3=2 I6=1\r")
    assert card.ask("P3") == ["0"]


def test_a_fault_of_the_line_outlives_a_power_cycle(machine: MachineProfile) -> None:
    sim = SimulatedLathe(machine)
    sim.faults.inject("nul")
    sim.power_cycle()
    assert [fault.fault.name for fault in sim.faults.active()] == ["nul"]
