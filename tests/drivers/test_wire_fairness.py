"""A host is answered as it asks, and none of them can keep the card for itself."""

from __future__ import annotations

import pytest

from drivers.simulator.hosts.port import LINES_PER_CYCLE, LINES_PER_TURN
from profiles.machine import MachineProfile
from tests.drivers.wire_card import CYCLE_S, Wire, wire


@pytest.fixture
def card(machine: MachineProfile) -> Wire:
    return wire(machine)


def test_who_waits_for_each_answer_is_never_kept_waiting(card: Wire) -> None:
    """Far more lines than a background cycle allows to a queue, and no time passes."""
    before = card.sim.now_s()
    for number in range(10 * LINES_PER_CYCLE):
        card.port.receive(b"P1=P1+1 P1\r")
        card.sim.attend(card.port)
        assert card.port.take_output() == b"%d\r\x06" % (number + 1)
    assert card.sim.now_s() == before


def test_one_turn_is_a_few_lines_of_a_queue(card: Wire) -> None:
    card.port.receive(b"P1\r" * 100)
    card.sim.attend(card.port)
    assert card.port.take_output() == b"0\r\x06" * LINES_PER_TURN
    assert card.port.ready
    assert not card.port.idle


def test_a_queue_has_so_many_lines_in_a_background_cycle_however_often_it_is_looked_at(card: Wire) -> None:
    card.sim.wait(CYCLE_S)
    card.port.receive(b"P1\r" * 1000)
    for _ in range(1000):
        card.sim.attend(card.port)
    assert card.port.take_output() == b"0\r\x06" * LINES_PER_CYCLE
    ready = [card.port.ready]
    card.sim.wait(CYCLE_S)
    assert [*ready, card.port.ready] == [False, True]
    assert len(card.port.take_output()) == 3 * LINES_PER_TURN


def test_half_a_line_makes_a_port_neither_ready_nor_busy(card: Wire) -> None:
    card.port.receive(b"P1")
    card.sim.attend(card.port)
    assert card.port.idle
    assert not card.port.ready


def test_a_stop_acts_before_the_lines_in_front_of_it_also_between_two_cycles(card: Wire) -> None:
    card.tell("#3J/")
    card.port.receive(b"#1J/\r" * 50 + b"\x0b")
    card.sim.attend(card.port)
    assert not card.card.motors[3].enabled


def test_a_queue_that_is_full_of_long_answers_ends_its_turn_early(card: Wire) -> None:
    """1001 values are 2003 bytes; after 4096 no further line is begun."""
    card.port.receive(b"P0..1000\r" * 4)
    card.sim.attend(card.port)
    assert len(card.port.take_output()) == 3 * 2003
