"""The on-line commands of single motors, as they are typed."""

from __future__ import annotations

import pytest

from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire


@pytest.fixture
def card(machine: MachineProfile) -> Wire:
    """Loops closed; the spindle is motor 2, and stands at 0."""
    made = wire(machine)
    made.tell("#1J/ #2J/ #3J/")
    return made


def place(card: Wire, motor: int = 2) -> float:
    return float(card.ask(f"#{motor}P")[0])


def test_j_plus_and_minus_jog_until_j_slash(card: Wire) -> None:
    card.tell("I222=10 #2J+")
    card.sim.wait(1.0)
    assert float(card.ask("V")[0]) == pytest.approx(10 * card.card.servo_period_ms, abs=1)
    card.tell("J-")
    card.sim.wait(1.0)
    assert float(card.ask("V")[0]) == pytest.approx(-10 * card.card.servo_period_ms, abs=1)
    card.tell("J/")
    card.settle()
    assert card.ask("V") == ["0"]


def test_j_slash_closes_the_loop_of_a_killed_motor(card: Wire) -> None:
    card.tell("#2K")
    assert not card.card.motors[2].enabled
    card.tell("J/")
    assert card.card.motors[2].enabled


def test_j_equals_a_constant_goes_there_and_j_equals_alone_goes_back(card: Wire) -> None:
    card.tell("#2J=100")
    card.settle()
    card.tell("J=-300.5")
    card.settle()
    assert place(card) == pytest.approx(-300.5, abs=1)
    card.tell("J=")
    card.settle()
    assert place(card) == 100


def test_j_colon_is_relative_to_the_commanded_and_j_arrow_to_the_actual_position(card: Wire) -> None:
    card.tell("#2J=100")
    card.settle()
    card.tell("J:50")
    card.settle()
    assert place(card) == 150
    card.tell("J^-20")
    card.settle()
    assert place(card) == 130


def test_the_star_stands_for_the_variable_jog_register(card: Wire) -> None:
    card.tell("M272->L:$8EB M272=40", "#2J=*")
    card.settle()
    card.tell("J:*")
    card.settle()
    assert place(card) == 80
    card.tell("J^*")
    card.settle()
    assert place(card) == 120


def test_a_jog_until_the_trigger_goes_on_past_it(card: Wire) -> None:
    """The spindle has an index every 10 000 counts; the machine stands at 0 of the motor."""
    origin = card.card.motors[2].axis.origin
    card.tell("#2J=15000^-40")
    card.settle()
    assert (place(card) + origin + 40) % 10_000 == pytest.approx(0, abs=1)


def test_hm_and_home_search_the_trigger_and_hmz_needs_none(card: Wire) -> None:
    for word in ("HM", "HOME"):
        card.tell("#2J=1234")
        card.settle()
        card.tell(f"#2{word}")
        card.settle()
        assert place(card) == 0
    card.tell("#2J=777")
    card.settle()
    origin = card.card.motors[2].axis.origin
    card.tell("HMZ")
    assert place(card) == 0
    assert card.card.motors[2].axis.origin == origin + 777
    assert card.card.motors[2].home_complete


def test_o_opens_the_loop_with_an_output_and_k_takes_it_away(card: Wire) -> None:
    card.tell("#1O0")
    assert card.ask("?")[0] == "840000804000"
    card.tell("K")
    assert card.ask("?")[0] == "840000800000"


def test_dollar_closes_the_loop_and_dollar_star_kills(card: Wire) -> None:
    card.tell("#2$*")
    assert not card.card.motors[2].enabled
    card.tell("$")
    assert card.card.motors[2].enabled


def test_p_v_and_f(card: Wire) -> None:
    assert card.ask("#2PVF") == ["0", "0", "0"]
    card.tell("J=5000")
    card.settle()
    assert card.ask("P V F") == ["5000", "0", "0"]


def test_a_position_has_its_fraction_when_the_zero_has_one(card: Wire) -> None:
    """P in tenths of a count on this family (Software Reference)."""
    card.card.motors[2].bias = 0.27
    assert card.ask("#2P") == ["0.3"]


@pytest.mark.parametrize("line", ["J", "J*", "J:", "J^", "J=5^", "JX", "O", "J+5+"])
def test_what_is_no_jog(card: Wire, line: str) -> None:
    assert card.refusal(f"#2{line}") in (3, 5)


def test_addresses_are_kept_and_told(card: Wire) -> None:
    assert card.ask("#3 &5 # &") == ["3", "5"]
    assert card.ask("#&") == ["3", "5"]
    assert [card.refusal(line) for line in ("#0", "#9", "&0", "&9")] == [3] * 4
