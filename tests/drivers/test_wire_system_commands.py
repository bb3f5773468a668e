"""The on-line commands of coordinate systems, as they are typed."""

from __future__ import annotations

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    """Loops closed; program 1 goes three steps of 30 counts in X, each in 100 ms."""
    dialect: Dialect = request.param
    made = wire(machine, dialect)
    made.tell("#1J/ #2J/ #3J/", "OPEN PROG 1 CLEAR", "INC TA10 TS0 TM100", "Z30", "Z30", "N500 Z30", "CLOSE")
    return made


def place(card: Wire) -> float:
    return float(card.ask("#3P")[0])


def test_b_and_r_on_one_line(card: Wire) -> None:
    card.tell("&1B1R")
    card.settle()
    assert place(card) == 90


def test_b_with_a_label_begins_there(card: Wire) -> None:
    """The fraction is the label in units of 1/100000: N500 is .005."""
    card.tell("B1.005R")
    card.settle()
    assert place(card) == 30


@pytest.mark.parametrize("number", ["0", "0.5", "32768", "99999999999999"])
def test_003_a_program_number_that_there_cannot_be(card: Wire, number: str) -> None:
    assert card.refusal(f"B{number}") == 3
    card.tell("B32767", "B1")


def test_s_does_one_move_at_a_time(card: Wire) -> None:
    card.tell("B1")
    for done in (30, 60, 90):
        card.tell("S")
        card.settle()
        assert place(card) == done


def test_q_stops_and_r_goes_on(card: Wire) -> None:
    card.tell("B1R")
    card.sim.wait(0.03)
    card.tell("Q")
    card.settle()
    assert place(card) < 90
    card.tell("R")
    card.settle()
    assert place(card) == 90


@pytest.mark.parametrize("hold", ["H", "\\"])
def test_h_holds_and_r_goes_on(card: Wire, hold: str) -> None:
    card.tell(f"I{card.card.dialect.system_index(1, 95)}=50000", "B1R")
    card.sim.wait(0.1)
    card.tell(hold)
    card.sim.wait(2.0)
    held = place(card)
    assert 0 < held < 90
    card.sim.wait(1.0)
    assert place(card) == held
    card.tell("R")
    card.settle()
    assert place(card) == 90


def test_slash_stops_at_the_end_of_what_is_calculated(card: Wire) -> None:
    card.tell("B1R")
    card.sim.wait(0.03)
    card.tell("/")
    card.settle()
    assert place(card) in (30, 60)


def test_a_stops_everything_where_it_is(card: Wire) -> None:
    card.tell("B1R")
    card.sim.wait(0.1)
    card.tell("A")
    card.settle()
    assert 0 < place(card) < 90
    assert not card.card.systems[1].running


def test_percent_sets_and_reports_the_time_base(card: Wire) -> None:
    card.tell(f"I{card.card.dialect.system_index(1, 94)}=8388607", "%50")
    card.sim.wait(0.1)
    assert card.ask("%") == ["50"]
    card.tell("B1R")
    card.sim.wait(0.31)
    assert card.card.systems[1].moving
    assert place(card) < 60
    card.settle()
    assert place(card) == 90


def test_the_program_counter_and_what_is_executed(card: Wire) -> None:
    """P{program}:{line}; the counter is ahead of the motion by a move."""
    card.tell("B1")
    assert card.ask("PC LIST PC LIST PE,2") == ["P1:0", *["P1:0:INCTA10TS0TM100"] * 2, "P1:2:Z30"]
    card.tell("R")
    card.sim.wait(0.05)
    (counter,) = card.ask("PC")
    (executing,) = card.ask("PE")
    assert counter.startswith("P1:")
    assert executing.startswith("P1:")
    assert int(counter[3:]) >= int(executing[3:])
    assert card.ask("PR") == ["0"]


def test_an_axis_is_called_something_else_without_a_move(card: Wire) -> None:
    card.tell("Z=1000")
    before = card.card.motors[3].actual
    card.tell("OPEN PROG2 CLEAR", "ABS TA10 TS0 TM100", "Z1010", "CLOSE", "B2R")
    card.settle()
    assert card.card.motors[3].actual - before == pytest.approx(10, abs=0.5)


def test_z_calls_every_axis_zero(card: Wire) -> None:
    card.tell("#3J=500")
    card.settle()
    card.tell("Z", "OPEN PROG2 CLEAR", "ABS TA10 TS0 TM100", "Z10", "CLOSE", "B2R")
    before = card.card.motors[3].actual
    card.settle()
    assert card.card.motors[3].actual - before == pytest.approx(10, abs=0.5)


def test_003_an_axis_that_nothing_is_assigned_to(card: Wire) -> None:
    assert card.refusal("U=5") == 3


def test_pmatch_takes_the_axes_to_be_where_the_motors_are(card: Wire) -> None:
    card.tell("#3J=500")
    card.settle()
    card.tell("PMATCH", "OPEN PROG2 CLEAR", "ABS TA10 TS0 TM100", "Z500", "CLOSE", "B2R")
    card.settle()
    assert place(card) == 500


def test_axis_definitions_are_asked_for_as_clients_do(card: Wire) -> None:
    assert card.ask("&1#1->, #2->, #3->,") == ["X", "Y", "Z"]
    assert card.ask("#4->") == ["0"]
    card.tell("#3->0", "#3->8660Z+10.5")
    assert card.ask("#3->") == ["8660Z+10.5"]


def test_undefine_forgets_the_axes_of_a_system_and_undefine_all_those_of_all(card: Wire) -> None:
    card.tell("#3->0", "&2 #3->A", "&1 UNDEFINE")
    assert card.ask("#1-> #2-> #3->") == ["0", "0", "0"]
    assert card.ask("&2#3->&1") == ["A"]
    card.tell("UNDEFINE ALL")
    assert card.ask("&2#3->&1") == ["0"]
    assert card.refusal("&1 B1R") == 14
