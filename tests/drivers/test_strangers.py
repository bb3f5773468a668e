"""A host that nobody knows of: what it meets on the card is what every host meets."""

from __future__ import annotations

import pytest

from drivers.pmac.language.syntax import VariableKind
from drivers.simulator.hosts.control_socket import answer
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from tests.drivers.wire_card import CYCLE_S, Wire, wire

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


def test_a_buffer_that_it_has_opened_is_in_the_way_of_the_others(card: Wire) -> None:
    card.sim.faults.inject("stranger-writes", line="OPEN PROG 5")
    assert card.refusal("OPEN PROG 6") == 7


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


def test_a_caret_within_a_line_is_an_operator(card: Wire) -> None:
    """5 and 3 have 6 between them, bit by bit."""
    assert told(card, "inject stranger-writes 'line=P5=5^3 P5'") == "the stranger was told: 6<CR><ACK>"
