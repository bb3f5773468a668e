"""V: of the last servo cycle on a PMAC, averaged over I60 and I61 on a Turbo."""

from __future__ import annotations

import pytest

from drivers.pmac.dialect import PMAC, TURBO
from drivers.pmac.reported_velocity import AveragedVelocity
from drivers.pmac.variables import VariableStore
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire

JOG = "I400=1 I10=3713707 I419=0 I420=10 I421=0 I422=49.5 #4J+"
"""49.5 counts/ms, which the manual says are 21.9 counts in a servo cycle (Software Reference, V)."""


def turbo(machine: MachineProfile) -> Wire:
    return wire(machine, TURBO)


def cycles_ms(card: Wire, cycles: int) -> float:
    return cycles * card.card.servo_period_ms


def velocity(card: Wire) -> float:
    return float(card.ask("#4V")[0])


def test_a_turbo_says_the_average_of_256_servo_cycles(machine: MachineProfile) -> None:
    """The spread of single cycles, 21 and 22 counts, is not seen."""
    card = turbo(machine)
    card.tell(JOG)
    card.sim.wait(1.0)
    told = set()
    for _ in range(100):
        card.sim.wait(0.005)
        told.add(velocity(card))
    assert told == {21.9}
    assert {float(v) for v in card.raw("\x16").split()[3:4]} == {21.9}


def test_a_pmac_says_that_of_one_cycle(machine: MachineProfile) -> None:
    card = wire(machine, PMAC)
    card.tell(JOG)
    card.sim.wait(1.0)
    told = set()
    for _ in range(100):
        card.sim.wait(0.005)
        told.add(velocity(card))
    assert told == {21.0, 22.0}


def test_the_average_lags_by_its_length_and_ends_with_it(machine: MachineProfile) -> None:
    """From rest at full speed it rises as the part of the 256 cycles in which the motor has moved."""
    card = turbo(machine)
    card.tell(JOG)
    card.sim.wait(cycles_ms(card, 128) / 1000.0)
    assert 0.3 * 21.9 < velocity(card) < 0.6 * 21.9
    card.sim.wait(cycles_ms(card, 300) / 1000.0)
    assert velocity(card) == 21.9
    card.tell("#4K")
    card.sim.wait(2.0)
    assert velocity(card) == 0.0


@pytest.mark.parametrize(("period", "shift", "shown"), [(0, 4, 21.9), (3, 6, 21.9), (15, 9, 10.9), (7, 8, 10.9)])
def test_period_and_shift(machine: MachineProfile, period: int, shift: int, shown: float) -> None:
    """The change over 16 (I60 + 1) cycles, divided by 2 to the I61."""
    card = turbo(machine)
    card.tell(f"I60={period} I61={shift}", JOG)
    card.sim.wait(1.0)
    assert velocity(card) == pytest.approx(shown, abs=0.11)


def test_a_new_zero_is_no_velocity(machine: MachineProfile) -> None:
    card = turbo(machine)
    card.tell("I400=1 #4J=5000")
    card.settle()
    card.sim.wait(0.3)
    assert velocity(card) == 0.0
    card.tell("#4HMZ")
    assert velocity(card) == 0.0
    card.sim.wait(0.3)
    assert velocity(card) == 0.0


def test_blocks_of_any_length_keep_the_same_positions() -> None:
    variables = VariableStore({60: 3, 61: 6}, TURBO)
    one, many = AveragedVelocity(variables, (60, 61)), AveragedVelocity(variables, (60, 61))
    places = [float(n * n) for n in range(500)]
    done = 0
    for size in (1, 2, 3, 5, 7, 11, 200, 13, 258):
        for at in many.kept(size, done):
            many.keep(places[done + at])
        done += size
    assert done == len(places)
    for n, place in enumerate(places):
        if one.kept(1, n):
            one.keep(place)
    assert many.counts_per_cycle == one.counts_per_cycle == (499.0**2 - 435.0**2) / 64
