"""PLCs over the line: typing, listing, switching, saving, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.language.plc_statements import parse_plc_line
from drivers.pmac.language.syntax import PlcLine
from drivers.pmac.language.text import format_plc_line
from drivers.simulator.hosts.port import LINE_LIMIT
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from tests.drivers.language.plc_trees import plc_lines
from tests.drivers.plc_card import plc_card, reset, run_for, store, values
from tests.drivers.wire_card import Wire, wire


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    """Background PLCs are permitted."""
    dialect: Dialect = request.param
    return plc_card(machine, dialect)


def test_a_plc_is_listed_in_one_spelling_with_what_stands_behind_a_condition_below_it(card: Wire) -> None:
    store(card, 4, 'if (p1=1) adr&2#4 ; here\n  and(p2 !> 3)\nElse P2=2 cmd"#1j/"\nendi', on=False)
    listed = [
        "IF(P1=1)",
        "ADDRESS&2#4",
        "AND(P2!>3)",
        "ELSE",
        'P2=2COMMAND"#1j/"',
        "ENDIF",
    ]
    assert card.listed("PLC 4") == listed


@given(lines=st.lists(plc_lines, min_size=1, max_size=5))
def test_every_plc_that_is_typed_is_stored_and_its_listing_is_the_same_plc(
    machine: MachineProfile, lines: list[PlcLine]
) -> None:
    """No word of it is taken for a command, and none is executed."""
    texts = [format_plc_line(line) for line in lines if line]
    assume(all(len(text) <= LINE_LIMIT for text in texts))
    card = wire(machine)
    card.tell("OPEN PLC 1 CLEAR", *texts, "CLOSE")
    listed = card.listed("PLC 1")
    assert [s for text in listed for s in parse_plc_line(text)] == [s for line in lines for s in line]
    card.tell("OPEN PLC 2 CLEAR", *listed, "CLOSE")
    assert card.listed("PLC 2") == listed


@pytest.mark.parametrize("text", ["X10", "LINEAR", "DWELL10", "GOTO5", "N5", "M1==1", "IF(P1)", "CALL5", "G1"])
def test_what_belongs_to_motion_programs_is_refused_and_not_stored(card: Wire, text: str) -> None:
    card.tell("OPEN PLC 1 CLEAR", "P1=1")
    assert card.refusal(text) == 3
    card.tell("CLOSE")
    assert card.listed("PLC 1") == ["P1=1"]


@pytest.mark.parametrize(
    "text", ["AND(P1=1)", "OR(P1=1)", "ADDRESS#1", "ADR&2", 'SEND"lost"', "IF(P1=1) AND(P2=1)", 'CMDS"P1"', "ELSE"]
)
def test_a_plc_that_is_typed_without_its_open_moves_and_stops_nothing(card: Wire, text: str) -> None:
    """None of its words is a command: A would abort the program that runs, S step it, O open the loop."""
    card.tell("#1J/ #2J/ #3J/", "OPEN PROG 1 CLEAR", "TM1000 TA10 INC X100", "X100", "CLOSE", "&1B1R#1")
    run_for(card, 5)
    assert card.refusal(text) == 5
    run_for(card, 5)
    system = card.card.systems[1]
    assert (system.running, system.motion.single_step) == (True, False)
    assert not any(motor.jog.aborting for motor in card.card.motors.values())
    card.tell("&1A", "OPEN PROG 2 CLEAR")
    assert card.refusal("AND(P1=1)") == 3


def test_enable_finds_out_whether_the_plc_is_well_formed(card: Wire) -> None:
    store(card, 1, "P1=P1+1", on=False)
    store(card, 2, "P2=1\nENDIF", on=False)
    store(card, 3, "WHILE(P1=1)", on=False)
    assert card.refusal("ENABLE PLC 2") == 9
    assert card.refusal("ENABLE PLC 1..3") == 9
    assert card.refusal("ENABLE PLC 1,3") == 16
    assert card.card.plcs.switches.enabled == set(), "all of them or none"
    card.tell("ENABLE PLC 1", "OPEN PLC 2", "CLEAR", "P2=P2+1", "CLOSE", "ENABLE PLC 2")
    run_for(card)
    assert values(card, "P1 P2") == [1, 1]


def test_a_plc_that_switches_on_one_that_is_not_well_formed_is_switched_off(card: Wire) -> None:
    store(card, 2, "ENDIF", on=False)
    store(card, 1, "P1=P1+1\nENABLE PLC 2")
    run_for(card, 3)
    assert values(card, "P1") == [1]
    assert (card.card.plcs.faults[1].line, card.card.plcs.faults[1].code) == (1, 9)


def test_a_program_that_switches_on_one_that_is_not_well_formed_ends_with_a_run_time_error(card: Wire) -> None:
    store(card, 2, "ENDIF", on=False)
    card.tell("#1J/ #2J/ #3J/", "OPEN PROG 1 CLEAR", "P1=1", "ENABLE PLC 2", "P1=2", "CLOSE", "&1B1R")
    run_for(card, 3)
    assert card.card.systems[1].motion.runtime_error
    assert values(card, "P1") == [1]


def test_a_plc_is_off_while_it_is_open_and_stays_off_until_it_is_switched_on(card: Wire) -> None:
    other = Wire(sim=card.sim, port=card.sim.connect())
    store(card, 1, "P1=P1+1")
    run_for(card, 2)
    card.tell("OPEN PLC 1")
    assert other.refusal("ENABLE PLC 1") == 7
    assert other.refusal("ENABLE PLC 1..3") == 7
    other.tell("DISABLE PLC 1", "ENABLE PLC 2")
    run_for(card, 2)
    card.tell("P2=P2+1", "CLOSE")
    run_for(card, 2)
    assert values(card, "P1 P2") == [2, 0]
    card.tell("ENABLE PLC 1")
    run_for(card)
    assert values(card, "P1 P2") == [3, 1]


@pytest.mark.parametrize("line", ["DELETE PLC 1", "DELETE ALL"])
def test_a_plc_that_is_deleted_is_gone(card: Wire, line: str) -> None:
    store(card, 1, "P1=P1+1")
    run_for(card, 2)
    card.tell(line)
    run_for(card, 2)
    assert values(card, "P1") == [2]
    assert card.refusal("LIST PLC 1") == 3
    assert card.card.plcs.switches.enabled == set()


def test_switching_on_a_plc_that_is_not_there_does_nothing_even_when_it_comes(card: Wire) -> None:
    card.tell("ENABLE PLC 6")
    run_for(card, 2)
    store(card, 6, "P1=P1+1", on=False)
    run_for(card, 2)
    assert values(card, "P1") == [0]


def test_a_reset_brings_saved_plcs_back_and_switches_them_on(card: Wire) -> None:
    text = "P1=P1+1\nWHILE(P3=0)\nP2=P2+1\nENDWHILE"
    store(card, 1, text)
    store(card, 2, "ENDIF", on=False)
    store(card, 3, "P4=P4+1", on=False)
    run_for(card, 4)
    assert values(card, "P1 P2 P4") == [1, 4, 0]
    card.tell("SAVE", "OPEN PLC 1 CLEAR", "CLOSE", "DELETE PLC 3")
    reset(card)
    assert card.listed("PLC 1") == text.split("\n")
    assert card.listed("PLC 2") == ["ENDIF"]
    assert card.card.plcs.switches.enabled == {1, 3}, "what is not well formed stays off"
    run_for(card, 2)
    assert values(card, "P1 P2 P4") == [2, 7, 2], "from its top, after one more scan at the end of the SAVE"


def test_a_reset_without_save_keeps_the_plcs_and_permits_what_the_machine_does(card: Wire) -> None:
    store(card, 1, "P1=P1+1", on=False)
    reset(card)
    assert card.card.plcs.switches.enabled == {1}
    run_for(card, 3)
    assert values(card, "P1") == [3], "the profile of the machine permits PLC 1 to 31"


def test_the_factory_has_no_plcs(card: Wire) -> None:
    card.tell("I5=3")
    store(card, 0, "P1=P1+1")
    store(card, 1, "P1=P1+1")
    reset(card, "$$$***")
    run_for(card, 3)
    assert values(card, "P1") == [0]
    assert card.refusal("LIST PLC 1") == 3
    assert card.card.plcs.switches.enabled == set()


def test_a_saved_plc_runs_in_the_next_process(machine: MachineProfile, tmp_path: Path) -> None:
    path = tmp_path / "saved.json"
    first = wire(machine, saved=path)
    store(first, 1, 'P1=P1+1\nIF(P1=2)\nAND(P2=0)\nADDRESS#3\nCMD"J^500"\nENDIF', on=False)
    first.tell("I5=2", "SAVE")
    second = wire(machine, saved=path)
    run_for(second, 5)
    second.settle()
    assert second.ask("#3P") == ["500"]


def test_a_saved_plc_without_an_end_comes_back_and_cannot_be_switched_on(
    machine: MachineProfile, tmp_path: Path
) -> None:
    path = tmp_path / "saved.json"
    first = wire(machine, saved=path)
    store(first, 5, "P1=P1+1", on=False)
    first.tell("I5=2", "SAVE")
    table = json.loads(path.read_bytes())
    table["plcs"]["6"] = ["IF(P1=1) P2=9"]
    path.write_text(json.dumps(table), encoding="ascii")
    second = wire(machine, saved=path)
    run_for(second, 3)
    assert values(second, "P1 P2") == [3, 0]
    assert second.listed("PLC 6") == ["IF(P1=1)", "P2=9"]
    assert second.refusal("ENABLE PLC 6") == 16


def test_a_file_with_a_line_that_no_plc_can_hold_is_refused_and_left_alone(
    machine: MachineProfile, tmp_path: Path
) -> None:
    """Without the line it would be another PLC, and without the PLC another machine."""
    path = tmp_path / "saved.json"
    wire(machine, saved=path).tell("SAVE")
    table = json.loads(path.read_bytes())
    table["plcs"]["4"] = ["P2=P2+1", "DWELL10"]
    content = json.dumps(table)
    path.write_text(content, encoding="ascii")
    with pytest.raises(ProfileError) as refused:
        wire(machine, saved=path)
    assert refused.value.problems[0].code == "file.unreadable"
    assert path.read_text(encoding="ascii") == content


def test_a_full_plc_takes_no_more(card: Wire) -> None:
    """20 000 lines; a condition with something behind it is two."""
    card.tell("OPEN PLC 1 CLEAR", "P1=1")
    lines = card.card.plcs.buffers[1]
    lines *= 19_999
    assert card.refusal("IF(P1=1) P2=1") == 6
    card.tell("P1=1")
    assert card.refusal("P1=1") == 6
    card.tell("CLOSE")
    assert len(card.listed("PLC 1")) == 20_000
