"""Words that public programs and drivers use, each as a host would type it."""

from __future__ import annotations

import pytest

from drivers.pmac.dialect import PMAC, TURBO
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire


@pytest.fixture
def card(machine: MachineProfile) -> Wire:
    return wire(machine, TURBO)


def test_a_plc_addresses_by_a_variable(card: Wire) -> None:
    card.tell(
        "I5=2 P1=2 P2=3", "&3Q5=33", "&1Q5=11", "OPEN PLC 4 CLEAR", "ADDRESS#P1 ADDRESS&P2", "P9=Q5", "CLOSE"
    )
    card.tell("OPEN PLC 5 CLEAR", "ADR#P1", 'CMD"J/"', "DISABLE PLC 5", "CLOSE", "ENABLE PLC 4,5")
    card.sim.wait(0.1)
    assert card.ask("P9") == ["33"]
    assert [card.card.motors[number].enabled for number in (1, 2, 3)] == [False, True, False]
    assert card.listed("PLC 4") == ["ADDRESS#P1ADDRESS&P2", "P9=Q5"]


def test_a_plc_that_addresses_what_does_not_exist_is_switched_off(card: Wire) -> None:
    card.tell("I5=2 P1=0", "OPEN PLC 4 CLEAR", "ADDRESS#P1", "P9=1", "CLOSE", "ENABLE PLC 4")
    card.sim.wait(0.1)
    assert card.ask("P9") == ["0"]
    assert card.card.plcs.switches.enabled == set()


def test_a_paused_plc_goes_on_where_it_was(card: Wire) -> None:
    card.tell("I5=2", "OPEN PLC 4 CLEAR", "P1=P1+1", "WHILE(P3=0)", "P2=P2+1", "ENDWHILE", "CLOSE", "ENABLE PLC 4")
    card.sim.wait(0.05)
    card.tell("PAUSE PLC 4")
    (first,) = card.ask("P2")
    card.sim.wait(0.05)
    assert card.ask("P1 P2") == ["1", first]
    card.tell("RESUME PLC 4")
    card.sim.wait(0.05)
    assert card.ask("P1") == ["1"], "from the WHILE, not from the top"
    assert int(card.ask("P2")[0]) > int(first)
    card.tell("PAUSE PLC 4", "ENABLE PLC 4")
    card.sim.wait(0.05)
    assert card.ask("P1") == ["2"], "from the top"


def test_resume_of_a_plc_that_is_not_paused_does_nothing(card: Wire) -> None:
    card.tell("I5=2", "OPEN PLC 4 CLEAR", "P1=P1+1", "CLOSE", "RESUME PLC 4", "DISABLE PLC 4", "RESUME PLC 4")
    card.sim.wait(0.05)
    assert card.ask("P1") == ["0"]


def test_a_rapid_move_until_the_trigger_ends_past_it(card: Wire) -> None:
    """The trigger of motor 1 is a flag below its home position: it is found at once on the way down."""
    card.tell("#1J/#2J/#3J/", "#1HM")
    card.settle()
    card.tell("#1J=4000")
    card.settle()
    card.tell("OPEN PROG 1 CLEAR", "RAPID ABS", "P2=300", "X(-9000)^(P2)", "P9=1", "CLOSE", "&1B1R")
    card.settle()
    (place,) = card.ask("#1P")
    assert card.ask("P9") == ["1"]
    assert float(place) == pytest.approx(300, abs=60), "the flag is at 0, within the counts of one look"
    assert card.listed("PROG 1")[2] == "X(-9000)^(P2)"


def test_a_move_until_a_trigger_that_never_comes_ends_at_its_target(card: Wire) -> None:
    card.tell("#1J/#2J/#3J/", "OPEN PROG 1 CLEAR", "RAPID INC", "X500^10 Y200", "P9=1", "CLOSE", "&1B1R")
    card.settle()
    assert card.ask("P9") == ["1"]
    assert [card.card.motors[number].desired for number in (1, 2)] == [500, 200]


def test_a_move_until_a_trigger_belongs_to_rapid(card: Wire) -> None:
    card.tell("#1J/#2J/#3J/", "OPEN PROG 1 CLEAR", "LINEAR TA10 TM20", "X500^10", "CLOSE", "&1B1R")
    card.settle()
    assert card.ask("#1P") == ["0"]


def test_e_closes_the_loops_of_a_system(card: Wire) -> None:
    card.tell("&1E")
    assert [card.card.motors[number].enabled for number in (1, 2, 3)] == [True, True, True]
    assert card.refusal("&2E") == 14
    card.tell("I200=0")
    assert card.refusal("&1E") == 13


def test_a_pvt_sequence_may_end_in_a_dwell(card: Wire) -> None:
    card.tell("#1J/#2J/#3J/", "OPEN PROG 1 CLEAR", "INC PVT100 X50:1000", "X100:1000", "DWELL10", "P9=1", "CLOSE")
    card.tell("&1B1R")
    card.settle()
    assert card.ask("P9") == ["1"]
    (place,) = card.ask("#1P")
    assert float(place) > 150, "past the point, as far as Ix15 takes to stop"


@pytest.mark.parametrize(
    "line", ["DEFINE LOOKAHEAD 1000,100", "DEFINE UBUFFER 256", "DELETE TEMPS", "DEL LOOKAHEAD"]
)
def test_buffers_that_are_accepted(card: Wire, line: str) -> None:
    card.tell(line)


@pytest.mark.parametrize("line", ["MS0,MI910", "MSR0,MI910,P1", "MSW0,MI910,P1", "MSCLRF0", "MS0,I5=1"])
def test_without_a_ring_no_station_answers(card: Wire, line: str) -> None:
    assert card.refusal(line) == 8


def test_what_drivers_ask_at_connect(card: Wire, machine: MachineProfile) -> None:
    assert card.ask("IDNUMBER SID MOVETIME") == ["0", "0", "0"]
    assert wire(machine, PMAC).refusal("IDNUMBER") == 3


def test_a_computed_variable_on_line(card: Wire) -> None:
    card.tell("P1=4", "P(P1+1)=7", "M(P1)=8", "Q(2*P1)=9")
    assert card.ask("P5 P(P1+1) M4 Q8") == ["7", "7", "8", "9"]
    assert card.refusal("P(0-1)") == 3


@pytest.mark.parametrize("line", ["OPEN PLCC 1", "OPEN ROT", "LEARN", "CC1", "!X5"])
def test_what_is_not_there_is_refused(card: Wire, line: str) -> None:
    assert card.refusal(line) in (3, 5)
