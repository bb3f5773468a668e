"""A jog without a host: ended by the card, within 0.3 s of the last lease, and never by closing a loop."""

from __future__ import annotations

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.heartbeat.plc import Policy
from profiles.machine import MachineProfile
from tests.drivers.heartbeat_card import CARRIAGE, SPINDLE, TOOL, host_of
from tests.drivers.plc_card import reset, run_for, values

FAMILIES = pytest.mark.parametrize("dialect", [PMAC, TURBO], ids=lambda dialect: dialect.name)

PROMISE_S = 0.3
CYCLE_S = 0.005
RAMP_S = {TOOL: 0.1, SPINDLE: 0.1 + 16.667 / 0.1 / 1000.0, CARRIAGE: 0.1}
"""Ix20 = 100 ms with Ix21 = 25 ms; the spindle's Ix19 makes it 16.667 / 0.1 ms and the S-curves longer."""

SLOW_S = 0.1
"""The background cycle of a card with too much to do."""


@FAMILIES
@pytest.mark.parametrize("motor", [TOOL, SPINDLE, CARRIAGE])
@pytest.mark.parametrize("jog", ["J+", "J=150000"])
def test_a_jog_ends_within_the_promise_and_rests_a_ramp_later(
    machine: MachineProfile, dialect: Dialect, motor: int, jog: str
) -> None:
    host = host_of(machine, dialect)
    host.beat(f"{host.keeper.jog_line()} #{motor}{jog}")
    host.keep(1.0)
    speed = host.card.card.motors[motor].velocity
    assert speed == pytest.approx(machine.controller.variables[f"I{motor}22"], rel=1e-6)
    slower_s = host.until(lambda: host.card.card.motors[motor].velocity < speed)
    assert slower_s <= PROMISE_S
    assert host.until(host.still) <= PROMISE_S + RAMP_S[motor] + CYCLE_S
    assert values(host.card, "P1003 P1004") == [0, 1]
    assert host.card.card.motors[motor].enabled


@FAMILIES
def test_a_home_search_ends_as_a_jog_does(machine: MachineProfile, dialect: Dialect) -> None:
    host = host_of(machine, dialect)
    host.card.tell("#1J=100000")
    host.card.settle()
    host.beat(f"{host.keeper.jog_line()} #1HM")
    assert host.until(lambda: host.value("P1004") == 1) <= PROMISE_S
    assert host.until(host.still) <= PROMISE_S + RAMP_S[TOOL] + CYCLE_S
    assert not host.card.card.motors[TOOL].home_complete


@FAMILIES
def test_a_jog_with_a_host_is_let_go_on(machine: MachineProfile, dialect: Dialect) -> None:
    host = host_of(machine, dialect)
    host.beat(f"{host.keeper.jog_line()} #1J+")
    host.keep(6.0)
    assert host.place(TOOL) > 50 * 5900
    assert values(host.card, "P1003 P1004") == [1, 0]


@FAMILIES
def test_a_jog_without_any_lease_does_not_get_far(machine: MachineProfile, dialect: Dialect) -> None:
    """No lease, no start: the next scan ends it.

    In a cycle of 5 ms the S-curve, 50 counts/ms in 100 ms with 25 ms at each end, comes to
    50 / 75 / 25 / 2 * 5^2 = 0.33 counts/ms; a ramp of 100 ms from there is 17 counts.
    """
    host = host_of(machine, dialect)
    host.card.tell("P1003=1 #1J+")
    run_for(host.card, 2)
    assert host.value("P1004") == 1
    host.card.settle()
    assert 0 < host.place(TOOL) < 20


@FAMILIES
def test_a_lease_that_comes_back_starts_nothing_again(machine: MachineProfile, dialect: Dialect) -> None:
    host = host_of(machine, dialect)
    host.beat(f"{host.keeper.jog_line()} #1J+")
    host.keep(0.5)
    host.until(host.still)
    ended_at = host.card.card.motors[TOOL].desired
    host.keep(2.0)
    assert host.card.card.motors[TOOL].desired == ended_at
    assert values(host.card, "P1003 P1004") == [0, 1]


@FAMILIES
@pytest.mark.parametrize("i5", [0, 1])
def test_where_i5_forbids_plcs_nothing_ends(machine: MachineProfile, dialect: Dialect, i5: int) -> None:
    """What the check before arming is there for."""
    host = host_of(machine, dialect, i5=i5)
    host.beat(f"{host.keeper.jog_line()} #1J+")
    run_for(host.card, 400)
    assert not host.still(TOOL)


@FAMILIES
@pytest.mark.parametrize("killed", [(TOOL,), (SPINDLE, CARRIAGE), (TOOL, SPINDLE, CARRIAGE)], ids=str)
@pytest.mark.parametrize("policy", list(Policy))
def test_what_is_killed_stays_killed_and_the_rest_is_stopped(
    machine: MachineProfile, dialect: Dialect, killed: tuple[int, ...], policy: Policy
) -> None:
    host = host_of(machine, dialect, policy)
    host.card.tell(*(f"#{motor}K" for motor in killed))
    left = [motor for motor in (TOOL, SPINDLE, CARRIAGE) if motor not in killed]
    host.beat(host.keeper.jog_line())
    host.card.tell(*(f"#{motor}J+" for motor in left))
    host.keep(0.5)
    host.until(lambda: host.still(TOOL, SPINDLE, CARRIAGE))
    run_for(host.card, 200)
    motors = host.card.card.motors
    assert [motors[motor].amplifier_enabled for motor in killed] == [False] * len(killed)
    assert [motors[motor].enabled for motor in left] == [True] * len(left)
    assert host.still(TOOL, SPINDLE, CARRIAGE)
    assert host.card.port.take_output() == b""


@FAMILIES
def test_with_a_slow_background_a_jog_ends_one_cycle_later(machine: MachineProfile, dialect: Dialect) -> None:
    """280 ms, and the 100 ms in which the PLC cannot look."""
    host = host_of(machine, dialect)
    host.beat(f"{host.keeper.jog_line()} #1J+")
    host.keep(0.5)
    host.card.sim.faults.inject("slow-background", cycle_ms=1000.0 * SLOW_S)
    motor = host.card.card.motors[TOOL]
    assert host.until(lambda: motor.velocity < 50.0) <= 0.28 + SLOW_S + 2 * CYCLE_S
    assert host.until(lambda: not motor.jogging) <= 0.28 + SLOW_S + RAMP_S[TOOL] + 2 * CYCLE_S


@FAMILIES
def test_a_stop_that_the_card_refuses_is_told_once(machine: MachineProfile, dialect: Dialect) -> None:
    """The program has the motors, so J/ is ERR001; and what is latched is not tried again."""
    host = host_of(machine, dialect)
    host.card.tell("OPEN PROG7", "CLEAR", "LINEAR INC TA100 TM20000", "X10000", "CLOSE", "&1B7")
    host.beat(host.keeper.jog_line())
    host.card.tell("R")
    run_for(host.card, 400)
    assert host.card.port.take_output() == b"\x07ERR001\r"
    assert host.value("P1004") == 1


@FAMILIES
def test_a_card_that_was_reset_goes_on_with_nothing(machine: MachineProfile, dialect: Dialect) -> None:
    """P-variables outlive a reset: what they say was guarded then must not move or energise anything now."""
    host = host_of(machine, dialect)
    host.card.tell("#1J=20000")
    host.card.settle()
    host.card.tell("SAVE", "P1003=2 P1005=-20000")
    reset(host.card)
    run_for(host.card, 600)
    motors = [host.card.card.motors[number] for number in (TOOL, SPINDLE, CARRIAGE)]
    assert [motor.amplifier_enabled for motor in motors] == [False] * 3
    host.card.tell("#1J/#2J/#3J/", "P1003=2")
    run_for(host.card, 600)
    assert host.value("P1004") == 2
    assert host.place(TOOL) == pytest.approx(0, abs=2)
