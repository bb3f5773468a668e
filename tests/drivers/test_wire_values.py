"""Variables on the line: single ones, ranges, start-count-step, defaults, long and short form."""

from __future__ import annotations

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    dialect: Dialect = request.param
    return wire(machine, dialect)


@pytest.fixture
def turbo(machine: MachineProfile) -> Wire:
    return wire(machine, TURBO)


@pytest.mark.parametrize("kind", ["P", "Q", "M"])
def test_a_variable_is_set_and_asked_for(card: Wire, kind: str) -> None:
    assert card.ask(f"{kind}10") == ["0"]
    card.tell(f"{kind}10=-2.5")
    assert card.ask(f"{kind}10") == ["-2.5"]


def test_a_range_answers_one_line_for_each(card: Wire) -> None:
    card.tell("P1=25", "P2=50", "P3=75")
    assert card.ask("P1..3") == ["25", "50", "75"]


def test_start_count_and_step(card: Wire) -> None:
    card.tell("Q53=1", "Q55=3", "Q57=5")
    assert card.ask("Q53,3,2") == ["1", "3", "5"]
    assert card.ask("Q53,3") == ["1", "0", "3"]


def test_a_range_is_set_with_one_assignment(card: Wire) -> None:
    card.tell("I20..44=7", "P1,3,2=4")
    assert card.ask("I20..22") == ["$7", "$7", "$7"]
    assert card.ask("P1..5") == ["4", "0", "4", "0", "4"]


def test_a_setting_of_fifteen_coordinate_systems_in_one_line(turbo: Wire) -> None:
    turbo.tell("i5213,15,100=10")
    assert turbo.ask("I5113 I5213 I6613") == ["0", "10", "10"]


def test_expressions_with_the_variable_itself(card: Wire) -> None:
    card.tell("I130=2000", "I130=1.25*I130", "I125=0", "i125=i125|$20000")
    assert card.ask("I130 I125") == ["2500", "$20000"]
    card.tell("i125=i125&$FDFFFF")
    assert card.ask("I125") == ["$0"]


def test_factory_defaults_of_one_and_of_a_range(card: Wire) -> None:
    card.tell("I116=5 I130..131=1", "I116=*", "I130..131=*")
    assert card.ask("I116 I130 I131") == ["32", "2000", "1280"]


@pytest.mark.parametrize(
    ("i9", "answers"),
    [
        (0, ["49152", "32", "Y:$FFC2,0"]),
        (1, ["I125=49152", "I116=32", "M11->Y:$FFC2,0"]),
        (2, ["$C000", "32", "Y:$FFC2,0"]),
        (3, ["I125=$C000", "I116=32", "M11->Y:$FFC2,0"]),
    ],
)
def test_i9_chooses_the_form_of_answers(card: Wire, i9: int, answers: list[str]) -> None:
    card.tell("I125=$C000 I116=32 M11->Y:$FFC2,0", f"I9={i9}")
    assert card.ask("I125 I116 M11->") == answers


def test_values_of_p_q_and_m_have_one_form(card: Wire) -> None:
    card.tell("I9=3 P1=5 Q1=6 M900=7")
    assert card.ask("P1 Q1 M900") == ["5", "6", "7"]


@pytest.mark.parametrize(("dialect", "highest"), [(PMAC, 1023), (TURBO, 8191)])
def test_variables_go_as_far_as_the_family_has_them(
    machine: MachineProfile, dialect: Dialect, highest: int
) -> None:
    card = wire(machine, dialect)
    card.tell(*(f"{kind}{highest}=1" for kind in "PQM"))
    assert card.ask(f"P{highest} Q{highest} M{highest}") == ["1", "1", "1"]
    assert [card.refusal(f"{kind}{highest + 1}") for kind in "IPQM"] == [3] * 4
    assert len(card.ask(f"P0..{highest}")) == highest + 1


def test_a_setting_out_of_its_range_wraps_without_a_word(card: Wire) -> None:
    card.tell("I3=6")
    assert card.ask("I3") == ["2"]


def test_q_variables_are_those_of_the_addressed_system(card: Wire) -> None:
    card.tell("&1 Q20=5", "&2 Q20=7")
    assert card.ask("&1 Q20 &2 Q20") == ["5", "7"]


def test_a_line_that_is_only_a_number_sets_p0(card: Wire) -> None:
    card.tell("342")
    assert card.ask("P0") == ["342"]
    card.tell("-1.5")
    assert card.ask("P0") == ["-1.5"]
    assert card.refusal("P5=1 2") == 3


@pytest.mark.parametrize("line", ["P1..", "P3..1", "P1,0,1", "P1,2,0", "P1,9999999,1", "P1=", "I1=**", "P1=*"])
def test_what_is_no_range_and_no_value(card: Wire, line: str) -> None:
    assert card.refusal(line) == 3


def test_what_the_line_did_before_a_command_is_refused_stays_done(card: Wire) -> None:
    assert card.raw("P1=5 P1 P2=6 CLEAR P3=7\r") == b"5\r\x07ERR005\r"
    assert card.ask("P1..3") == ["5", "6", "0"]


def test_of_a_line_that_is_not_understood_nothing_is_done(card: Wire) -> None:
    assert card.raw("P1=5 P1 P2=6 UUU P3=7\r") == b"\x07ERR003\r"
    assert card.ask("P1..3") == ["0", "0", "0"]


def test_the_factory_leaves_the_line_as_its_documents_say(card: Wire) -> None:
    """I4 of a Turbo as read out of real cards: its checksums are on. I9 is not confirmed."""
    card.raw("$$$***\r")
    assert card.card.variables.i(4) == (card.card.dialect is TURBO)
    card.raw("I4=0\r")
    settings = (1, 3, 0, 0, 2, 0, 0, 0)
    assert card.raw("I3 I6 I1 I4 I9 I62..64\r") == b"".join(b"\n%d\r" % value for value in settings) + b"\n"


def test_a_machine_that_is_set_up_has_no_checksums(card: Wire) -> None:
    assert card.ask("I4") == ["0"]


def test_the_factory_of_a_turbo_as_read_out_of_real_cards(turbo: Wire) -> None:
    expected = {"I192": "10", "I190": "0", "I5": "0", "I60": "15", "I61": "8", "I167": "4194304", "I187": "64"}
    hexadecimal = {"I5193": "$2000", "I124": "$40001", "I3224": "$40001"}
    for name, value in {**expected, **hexadecimal}.items():
        turbo.tell(f"{name}=*")
        assert turbo.ask(name) == [value], name


@pytest.mark.parametrize("text", ["M5 ->*", "M5 -> D:$28", "M5\t->", "M1..3 ->*"])
def test_003_a_space_in_front_of_the_arrow_of_a_definition(card: Wire, text: str) -> None:
    card.tell("M5->X:$700,4")
    assert card.refusal(text) == 3
    assert card.ask("M5->") == ["X:$700,4"]


def test_other_spaces_do_not_matter_in_a_definition(card: Wire) -> None:
    card.tell("M 5-> Y : $700, 4 ,8")
    assert card.ask("M5->") == ["Y:$700,4,8"]
