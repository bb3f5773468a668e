"""Following, cams and led programs where they meet limits, resets, stops and settings that make no sense."""

from __future__ import annotations

import pytest

from drivers.pmac.compensation.table import TableDefinition, TableSource
from drivers.pmac.compensation.table_text import table_lines
from drivers.pmac.dialect import PMAC, TURBO, Dialect
from profiles.machine import MachineProfile
from tests.drivers.test_led_by_a_master import FAMILIES, card_with, follow, time_base
from tests.drivers.wire_card import Wire, wire

CARRIAGE = 3


def actual(card: Wire, motor: int = CARRIAGE) -> float:
    return card.card.motors[motor].actual


@FAMILIES
def test_a_scale_of_zero_follows_nothing(machine: MachineProfile, dialect: Dialect) -> None:
    card = card_with(machine, dialect)
    follow(card, 96)
    card.tell("I308=0", "#2J=1000")
    card.settle()
    assert actual(card) == 0.0
    assert card.ask("#2P") == ["1000"]


@FAMILIES
@pytest.mark.parametrize("jogging", [False, True])
def test_a_motor_that_follows_stops_at_its_limit_and_says_so(
    machine: MachineProfile, dialect: Dialect, jogging: bool
) -> None:
    card = card_with(machine, dialect)
    card.tell("I313=1000")
    follow(card, 96)
    card.tell("I222=10", "#2J+", *(["#3J=200"] if jogging else []))
    card.sim.wait(2.0)
    # What it goes in one background cycle more: 10 counts/ms for some 5 ms, once to see it and once to stop.
    assert 1000.0 < actual(card) < 1000.0 + 2 * 10.0 * 5.0
    assert card.card.motors[CARRIAGE].travel.stopped
    card.tell("#2J-")
    card.sim.wait(0.5)
    assert actual(card) < 1000.0, "back it goes"


def test_a_cam_that_leads_beyond_a_limit_sets_the_bit_and_ends_the_program(machine: MachineProfile) -> None:
    table = TableDefinition(motor=3, sources=(TableSource(2, 10_000),), target=3, columns=2).fill_table(
        [16 * 5000, 0]
    )
    card = wire(machine)
    card.tell(*table_lines(table), "#1J/#2J/#3J/", "&1#2->0", "I313=1000", "I222=10")
    card.tell("OPEN PROG 1 CLEAR", "LINEAR INC TA10 TM60000 X1", "CLOSE", "I51=1", "&1B1R", "#2J+")
    card.sim.wait(0.5)
    assert card.card.motors[CARRIAGE].travel.stopped
    assert not card.card.systems[1].running


@FAMILIES
def test_a_stepped_program_goes_on_where_the_master_led_it(machine: MachineProfile, dialect: Dialect) -> None:
    card = card_with(machine, dialect)
    card.tell("OPEN PROG 2 CLEAR", "LINEAR INC TA40 TS0 TM100", "Z100", "Z100", "CLOSE")
    follow(card, 96)
    card.tell("&1B2S")
    card.settle()
    card.tell("#2J=1000")
    card.settle()
    assert actual(card) == 1100.0
    card.tell("S")
    card.settle()
    assert actual(card) == 1200.0


@FAMILIES
def test_what_was_followed_in_a_jog_is_the_motors_own(machine: MachineProfile, dialect: Dialect) -> None:
    card = card_with(machine, dialect)
    follow(card, 96)
    card.tell("I322=2", "#2J=1000", "#3J=4000")
    card.sim.wait(0.2)
    card.tell("I306=0")
    card.settle()
    assert actual(card) > 4000.0
    card.tell("#3J=0")
    card.settle()
    assert actual(card) == pytest.approx(0.0, abs=1e-9)


@FAMILIES
def test_offset_following_that_ends_keeps_the_position(machine: MachineProfile, dialect: Dialect) -> None:
    card = card_with(machine, dialect)
    follow(card, 96, offset=True)
    card.tell("#2J=1000")
    card.settle()
    card.tell("I306=0" if dialect is PMAC else "I306=2")
    card.sim.wait(0.05)
    assert card.ask("#3P") == ["0"]
    card.tell("#3$*")
    assert card.ask("#3P") == ["0"]


def test_a_killed_motor_follows_nothing(machine: MachineProfile) -> None:
    card = card_with(machine, PMAC)
    follow(card, 96, offset=True)
    card.tell("#3K", "#2J=1000")
    card.settle()
    assert abs(float(card.ask("#3P")[0])) <= 1.0
    card.tell("#3J/")
    card.sim.wait(0.1)
    assert abs(actual(card)) <= 1.0


def test_a_follower_is_at_zero_behind_its_home(machine: MachineProfile) -> None:
    card = card_with(machine, PMAC)
    follow(card, 24)
    card.tell("I222=0.5", "#2J+")
    card.tell("#3HM")
    card.sim.wait(5.0)
    card.tell("#2J/")
    card.settle()
    assert card.card.motors[CARRIAGE].home_complete
    card.tell("#3J=0")
    card.settle()
    assert card.card.motors[CARRIAGE].true_position == pytest.approx(0.0, abs=0.5)


@FAMILIES
def test_time_that_a_master_took_back_is_not_owed(machine: MachineProfile, dialect: Dialect) -> None:
    card = card_with(machine, dialect)
    card.tell("OPEN PROG 2 CLEAR", "LINEAR INC TA40 TS0 TM100", "Z100", "CLOSE")
    time_base(card)
    card.tell("#2J-", "&1B2R")
    card.sim.wait(5.0)
    card.tell("#2J/", "I5193=0" if dialect is TURBO else "I193=0")
    card.sim.wait(0.5)
    assert actual(card) == 100.0


def test_a_motor_activated_again_is_not_thrown_by_its_table(machine: MachineProfile) -> None:
    table = TableDefinition(motor=4, sources=(TableSource(2, 1000),), target=4, columns=2).fill_table([1600, 0])
    card = wire(machine)
    card.tell(*table_lines(table), "I400=0", "I51=1", "#2J/", "#2J=500")
    card.settle()
    card.tell("I400=1", "#4J/")
    before = actual(card, 4)
    card.sim.wait(0.1)
    assert actual(card, 4) == pytest.approx(before, abs=1.0)
    assert card.card.motors[4].correction == 100.0


@FAMILIES
def test_settings_of_the_master_wrap_as_on_the_card(machine: MachineProfile, dialect: Dialect) -> None:
    card = wire(machine, dialect)
    card.tell("I107=48.7", "I106=1")
    assert card.ask("I107 I106") == ["49", "1"]
    card.tell("I108=-1")
    assert card.ask("I108") == ["8388607"]


def test_a_span_of_too_many_digits_defines_nothing(machine: MachineProfile) -> None:
    card = wire(machine)
    assert card.refusal("#1DEFINE COMP 1,#2,#1," + "9" * 20) == 3
    assert card.refusal("#1DEFINE COMP 1,#2,#1," + "9" * 18) == 3
    assert card.refusal("#1LIST COMP DEF") == 3


def test_a_table_that_is_being_filled_takes_nothing_behind_a_reset(machine: MachineProfile) -> None:
    card = wire(machine)
    card.tell("#1DEFINE COMP 4,#2,#1,1000", "16 32")
    card.raw("$$$\r")
    card.raw("\x18I3=2 I6=1\r")
    card.tell("7")
    assert card.ask("#1LIST COMP")[0].split() == ["16", "32"]
    assert card.ask("P0") == ["7"]
