"""The on-line commands of single motors, as they are typed."""

from __future__ import annotations

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    """Loops closed; the spindle is motor 2, and stands at 0."""
    dialect: Dialect = request.param
    made = wire(machine, dialect)
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
    card.sim.wait(0.2)  # the velocity of a Turbo is an average
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
    register = {"pmac": "$8EB", "turbo": "$157"}[card.card.dialect.name]
    card.tell(f"M272->L:{register} M272=40", "#2J=*")
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


@pytest.mark.parametrize("jog", ["J=15000^-40", "J:15000^-40", "J^15000^-40", "J=*^-40", "J:*^-40", "J^*^-40"])
def test_every_jog_to_a_place_may_go_until_the_trigger(card: Wire, jog: str) -> None:
    motor = card.card.motors[2]
    motor.variable_jog = 15000
    card.tell(f"#2{jog}")
    card.settle()
    assert (place(card) + motor.axis.origin + 40) % 10_000 == pytest.approx(0, abs=1)


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
    on, off = {
        "pmac": ("840000804000", "840000800000"),
        "turbo": ("8C0000078000", "840000078000"),
    }[card.card.dialect.name]
    assert card.ask("?") == [on]
    card.tell("K")
    assert card.ask("?") == [off]


def test_dollar_closes_the_loop_and_dollar_star_kills(card: Wire) -> None:
    card.tell("#2$*")
    assert not card.card.motors[2].enabled
    card.tell("$")
    assert card.card.motors[2].enabled


def test_p_v_and_f(card: Wire) -> None:
    assert card.ask("#2PVF") == ["0", "0", "0"]
    card.tell("J=5000")
    card.settle()
    card.sim.wait(0.2)  # the velocity of a Turbo is an average
    assert card.ask("P V F") == ["5000", "0", "0"]


def test_a_position_has_its_fraction_when_the_zero_has_one(card: Wire) -> None:
    """P in tenths of a count, on a Turbo in thirty-seconds (Software References)."""
    card.card.motors[2].bias = 0.27
    assert card.ask("#2P") == [{"pmac": "0.3", "turbo": "0.28125"}[card.card.dialect.name]]


@pytest.mark.parametrize("line", ["J", "J*", "J:", "J^", "J=5^", "JX", "O", "J+5+"])
def test_what_is_no_jog(card: Wire, line: str) -> None:
    assert card.refusal(f"#2{line}") in (3, 5)


@pytest.mark.parametrize(
    "jog", ["J={}", "J=-{}", "J:{}", "J:-{}", "J^{}", "J=1^{}", "J:1^-{}", "J^1^{}", "J=*", "J:*", "J^*"]
)
def test_a_jog_goes_no_farther_than_the_registers_reach(card: Wire, jog: str) -> None:
    """48 bits, with a sign, in units of 1/(96 x 32) count."""
    farthest = 2.0**47 / (96 * 32)
    card.card.motors[2].variable_jog = 1e20
    for counts in ("99999999999999999999", f"{farthest + 2000:.0f}"):
        assert card.refusal("#2" + jog.format(counts)) == 3
    assert not card.card.motors[2].jogging
    card.tell(f"#2J={int(farthest)}")
    assert card.card.motors[2].jogging


def test_addresses_are_kept_and_told(card: Wire) -> None:
    assert card.ask("#3 &5 # &") == ["3", "5"]
    assert card.ask("#&") == ["3", "5"]
    motors, systems = {"pmac": (8, 8), "turbo": (32, 16)}[card.card.dialect.name]
    lines = ("#0", f"#{motors + 1}", "&0", f"&{systems + 1}")
    assert [card.refusal(line) for line in lines] == [3] * 4
    assert card.ask(f"#{motors} &{systems} # #1 # &") == [str(motors), "1", str(systems)]


def test_number_9_counts_a_cycle_are_counts_a_ms_by_i10(card: Wire) -> None:
    """21.9 counts a servo cycle x 8388608 / 3713707 are 49.5 counts/ms (Software Reference, V)."""
    card.tell("I10=3713707 I219=0 I220=10 I221=0 I222=49.5 #2J+")
    card.sim.wait(1.0)
    told = []
    for _ in range(200):
        card.sim.wait(0.005)
        told.append(float(card.ask("#2V")[0]))
    assert sum(told) / len(told) == pytest.approx(21.9, abs=0.1)


def test_two_motors_are_asked_in_one_line_without_a_space(card: Wire) -> None:
    card.card.motors[5].bias = 7
    assert card.ask("#5P#2P") == ["7", "0"]
    assert card.ask("#5V#2V") == ["0", "0"]
    assert card.ask("#") == ["2"]


def test_a_space_parts_the_sign_that_asks_from_the_one_that_addresses(card: Wire) -> None:
    """Without it, `##3` would choose the last eight motors of a Turbo."""
    assert card.ask("#4 # #3 #") == ["4", "3"]
