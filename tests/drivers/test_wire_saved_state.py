"""SAVE, $$$ and $$$***: what is kept, what comes back, and what is on the disk."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from tests.drivers.wire_card import Wire, wire

SPEAK = "I3=2 I4=0 I6=1\r"


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    dialect: Dialect = request.param
    return wire(machine, dialect)


def reset(card: Wire, word: str = "$$$") -> None:
    card.raw(f"{word}\r")
    card.raw(f"\x18{SPEAK}")


def set_up(card: Wire) -> None:
    card.tell("I116=77.125", "M5->X:$700,4,8,S", "#3->0", "&2 #3->0.5A-7", "OPEN PLC 4 CLEAR", "P1=P1+1", "CLOSE")
    card.tell("OPEN PROG 5 CLEAR", "WHILE(P1<3)", "X(SIN(P1)/3) F1.1", "ENDWHILE", "CLOSE")


def check(card: Wire) -> None:
    assert card.ask("I116 M5-> LIST PLC 4 &2#3->&1") == ["77.125", "X:$700,4,8,S", "P1=P1+1", "RET", "0.5A-7"]
    assert card.listed("PROG 5") == ["WHILE(P1<3)", "X(SIN(P1)/3)F1.1", "ENDWHILE"]


def test_what_was_saved_comes_back_with_a_reset(card: Wire) -> None:
    set_up(card)
    card.tell(
        "SAVE", "I116=1", "M5->*", "&2 UNDEFINE", "DELETE PROG 5", "DELETE PLC 4", "OPEN PROG 6 CLEAR", "CLOSE"
    )
    reset(card)
    check(card)
    assert card.refusal("LIST PROG 6") == 3


def test_without_save_a_reset_brings_the_settings_of_the_machine(card: Wire) -> None:
    before = card.ask("I116 #1->")
    card.tell("I116=77", "#1->7X")
    reset(card)
    assert card.ask("I116 #1->") == before


def test_a_reset_sets_handshake_and_errors_back(card: Wire) -> None:
    """The machine's profile has I3=2 and I6=1; what was saved here is I3=0 and I6=0."""
    card.raw("I3=0 I6=0\rSAVE\rI3=2 I6=1\r")
    assert card.raw("$$$\r") == b""
    assert card.raw("UUU\rP1\r") == b"\x070\r"


def test_the_factory_knows_nothing_of_what_was_saved(card: Wire) -> None:
    set_up(card)
    card.tell("SAVE")
    reset(card, "$$$***")
    assert card.ask("I116 M5-> #3->") == ["32", "*", "0"]
    assert card.refusal("LIST PROG 5") == 3
    assert card.refusal("LIST PLC 4") == 3
    reset(card)
    check(card)


def test_variables_keep_their_values_through_a_reset(card: Wire) -> None:
    card.tell("P1=1", "Q2=2", "M3=3")
    reset(card)
    assert card.ask("P1 Q2 M3") == ["1", "2", "3"]


def test_a_saved_file_outlives_the_process(machine: MachineProfile, tmp_path: Path) -> None:
    path = tmp_path / "saved.json"
    first = wire(machine, saved=path)
    set_up(first)
    assert not path.exists()
    first.tell("PASSWORD=secret", "SAVE")
    second = wire(machine, saved=path)
    assert second.refusal("LIST PLC 4") == 2
    second.tell("PASSWORD=secret")
    check(second)
    assert second.card.programs == first.card.programs
    assert second.ask("I0..1023") == first.ask("I0..1023")
    assert [entry.name for entry in tmp_path.iterdir()] == ["saved.json"]


def test_saved_settings_decide_which_loops_are_closed_at_a_reset(card: Wire) -> None:
    """Ix80 (Software Reference): bit 0 closes the loop at power-up and reset."""
    card.tell("I180=1 I280=1 I380=0", "SAVE", "I180=0 I280=0 I380=1")
    reset(card)
    assert [card.card.motors[number].enabled for number in (1, 2, 3)] == [True, True, False]
    assert card.card.motors[1].amplifier_enabled


def test_saved_settings_decide_which_loops_a_new_process_closes(machine: MachineProfile, tmp_path: Path) -> None:
    path = tmp_path / "saved.json"
    wire(machine, saved=path).tell("I180=1 I280=1", "SAVE")
    again = wire(machine, saved=path)
    assert [again.card.motors[number].enabled for number in (1, 2, 3)] == [True, True, False]
    again.tell("#1J=100")
    again.settle()
    assert again.ask("#1P") == ["100"]


def test_saved_gains_hold_in_a_new_process(machine: MachineProfile, tmp_path: Path) -> None:
    path = tmp_path / "saved.json"
    first = wire(machine, saved=path)
    first.tell("I130=0", "SAVE")
    second = wire(machine, saved=path)
    for card in (first, second):
        card.tell("#1J/", "#1J=100")
        card.sim.wait(1.0)
    assert first.ask("#1P") == second.ask("#1P") == ["0"]


def test_the_axes_that_were_saved_can_be_moved(machine: MachineProfile, tmp_path: Path) -> None:
    path = tmp_path / "saved.json"
    first = wire(machine, saved=path)
    first.tell("#2->0", "#2->10Y", "SAVE")
    second = wire(machine, saved=path)
    second.tell("#1J/ #2J/ #3J/", "OPEN PROG1 CLEAR", "TA10 TS0 TM100 INC Y5", "CLOSE", "B1R")
    second.settle()
    assert second.ask("#2P") == ["50"]


@pytest.mark.parametrize(
    "content", [b"", b"{", b"[]", b"\xff", b'{"family": "pmac"}', b'{"family": "turbo", "settings": {}}', b"null"]
)
def test_a_file_that_is_something_else_is_refused_and_left_alone(
    machine: MachineProfile, tmp_path: Path, content: bytes
) -> None:
    path = tmp_path / "saved.json"
    path.write_bytes(content)
    with pytest.raises(ProfileError) as refused:
        wire(machine, saved=path)
    assert refused.value.problems[0].code == "file.unreadable"
    assert path.read_bytes() == content


def test_a_file_with_a_line_that_is_no_program_is_refused(machine: MachineProfile, tmp_path: Path) -> None:
    path = tmp_path / "saved.json"
    card = wire(machine, saved=path)
    card.tell("SAVE")
    table = json.loads(path.read_bytes())
    table["programs"] = {"1": ["X<3"]}
    path.write_text(json.dumps(table), encoding="ascii")
    with pytest.raises(ProfileError):
        wire(machine, saved=path)


def test_a_file_of_another_family_is_refused(machine: MachineProfile, tmp_path: Path) -> None:
    path = tmp_path / "saved.json"
    wire(machine, TURBO, path).tell("SAVE")
    with pytest.raises(ProfileError) as refused:
        wire(machine, PMAC, path)
    assert "turbo" in str(refused.value.problems[0].value)
    assert wire(machine, TURBO, path).ask("I8191") == ["$0"]


def test_a_save_that_cannot_be_written_is_an_error_and_changes_nothing(
    machine: MachineProfile, tmp_path: Path
) -> None:
    folder = tmp_path / "gone"
    card = wire(machine, saved=folder / "saved.json")
    card.tell("I116=55")
    assert card.refusal("SAVE") == 6
    reset(card)
    assert card.ask("I116") == ["500"]
