"""PLCs that are stored, and the forms in which what is stored is listed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.language.plc_statements import parse_plc_line
from drivers.pmac.language.syntax import Line, PlcLine, PlcProgram, Program, Return
from drivers.pmac.language.text import format_line, format_plc_line
from drivers.simulator.hosts.port import LINE_LIMIT
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from tests.drivers.language import trees
from tests.drivers.language.trees import plc_lines
from tests.drivers.plc_bench import plc_card, reset, run_for, store, values
from tests.drivers.wire_card import Wire, wire


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    """Background PLCs are permitted."""
    dialect: Dialect = request.param
    return plc_card(machine, dialect)


def test_a_plc_is_listed_in_one_spelling_with_what_stands_behind_a_condition_below_it(card: Wire) -> None:
    store(card, 4, 'if (p1=1) adr&2#4 ; here\n  and(p2 !> 3)\nElse P2=2 cmd"#1j/"\nendi', on=False)
    listed = ["IF(P1=1)", "ADDRESS&2#4", "AND(P2!>3)", "ELSE", 'P2=2COMMAND"#1j/"', "ENDIF"]
    assert card.listed("PLC 4") == listed


@given(lines=st.lists(plc_lines, min_size=1, max_size=5))
def test_every_plc_that_is_typed_is_listed_as_the_same(machine: MachineProfile, lines: list[PlcLine]) -> None:
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


def test_who_switches_on_a_plc_that_is_not_well_formed_has_a_run_time_error(card: Wire) -> None:
    store(card, 2, "ENDIF", on=False)
    store(card, 1, "P1=P1+1\nENABLE PLC 2")
    run_for(card, 3)
    assert values(card, "P1") == [1]
    assert (card.card.plcs.faults[1].line, card.card.plcs.faults[1].code) == (1, 9)
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


def test_a_saved_plc_without_an_end_cannot_be_switched_on(machine: MachineProfile, tmp_path: Path) -> None:
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


def test_a_file_with_a_line_of_no_plc_is_refused(machine: MachineProfile, tmp_path: Path) -> None:
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


# Programs and PLCs that are listed under each I9 and sent back are the same programs and PLCs.

FORMS = range(4)
PROGRAM_NUMBERS, PLC_NUMBERS = range(1, 31), range(1, 21)


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def dialect(request: pytest.FixtureRequest) -> Dialect:
    chosen: Dialect = request.param
    return chosen


def program(number: int) -> Iterator[str]:
    """Yield the lines of a program; no two programs have the same."""
    yield from ("LINEAR INC FRAX(X,Y)", f"TA{number} TS0 F{number}.5", "P1=0", f"N{number * 10}")
    yield f"WHILE(P1<{number} AND M{number}=0 OR Q1!~2)"
    yield from (f"P1=P1+1 X(SIN(P1)*{number}) Y-0.25", "IF(P2>3)", "WHILE(P3!<1)", f"P3=P3-I{100 + number}/2")
    yield from ("ENDWHILE", "ELSE", f"DWELL{number}", f"IF(P4=1) DELAY(Q{number}) ELSE RAPID Z1", "ENDIF F100")
    yield from ("ENDWHILE", "GOSUB900", f"CALL{500 + number}.1 X5 Y6", f'CMD"#{number % 3 + 1}J=*"', "HOME1..2")
    yield from (
        f'SENDP"program {number} LINEAR RETURN"',
        "CMD^A",
        "CIRCLE1 X1 Y1 I5 J5",
        "NORMAL K-1 CIRCLE2 X1 R2",
    )
    yield from ("SPLINE1 TA40 X5", "PVT20 X5:10", "BLOCKSTART", "M1==1", f"M2|={number}", "BLOCKSTOP", "PSET X0")
    yield from (
        f"ENABLE PLC {number % 31}",
        "DISABLE PLC 2..31",
        "HOMEZ3",
        "GOTO(P5)",
        "STOP",
        "RETURN",
        "N900 I5=2",
    )
    if number % 2:
        yield "RETURN"


def plc(number: int) -> Iterator[str]:
    """Yield the lines of a PLC; no two PLCs have the same."""
    yield from (f"IF(P{number}=1)", "OR(M1=0)", f"ADDRESS#{number % 8 + 1}&2", f"P2=P2+{number}", "WHILE(Q1<5)")
    yield from (f"Q1=Q1+I{100 * (number % 8 + 1) + 30}*{number}.25", "IF(P3!~2)", f'COMMAND"&1B{number}R"', "ELSE")
    yield from (
        'SEND"ENDIF"',
        "ENDIF",
        "ENDWHILE",
        "ENDIF",
        f"PAUSE PLC {number}",
        "RESUME PLC 3",
        'DISPLAY8"DWELL"',
    )
    yield from ("CMDS^K", f"M{number}=$F{number}", f"DISABLE PLC {number}")


def buffers() -> dict[str, list[str]]:
    """Return the lines of 30 programs and 20 PLCs, by the names of their buffers."""
    programs = {f"PROG {number}": list(program(number)) for number in PROGRAM_NUMBERS}
    return {**programs, **{f"PLC {number}": list(plc(number)) for number in PLC_NUMBERS}}


def fill(card: Wire, texts: dict[str, list[str]]) -> None:
    for name, lines in texts.items():
        card.tell(f"OPEN {name} CLEAR", *lines, "CLOSE")


def listed(card: Wire, form: int) -> dict[str, list[str]]:
    card.tell(f"I9={form}")
    return {name: card.ask(f"LIST {name}") for name in buffers()}


def done_by(card: Wire) -> tuple[list[Program], list[PlcProgram]]:
    """Return what the programs and PLCs do; a RETURN at the end of a program may be typed or not."""
    programs = [tuple(line.statements for line in lines) for _, lines in sorted(card.card.programs.items())]
    plcs = [tuple(line.statements for line in lines) for _, lines in sorted(card.card.plcs.buffers.items())]
    return [lines[:-1] if lines[-1:] == ((Return(),),) else lines for lines in programs], plcs


@pytest.mark.first(2)
@pytest.mark.parametrize("form", [2, 3])
def test_a_backup_of_thirty_programs_and_twenty_plcs_is_the_same_again(
    machine: MachineProfile, dialect: Dialect, form: int
) -> None:
    first, second, third = (wire(machine, dialect) for _ in range(3))
    fill(first, buffers())
    backup = listed(first, form)
    fill(second, backup)
    assert listed(second, form) == backup
    fill(third, listed(second, 5 - form))  # from the other form
    assert listed(third, form) == backup
    assert done_by(third) == done_by(first)


def test_the_factory_form_is_the_short_one(machine: MachineProfile, dialect: Dialect) -> None:
    """A reader that puts CLOSE in the place of RET gets no `CLOSEURN`, and as many buffers as there are."""
    card = wire(machine, dialect)
    fill(card, buffers())
    (form,) = card.ask("I9")
    assert form == "2"
    backup = {name: card.ask(f"LIST {name}") for name in buffers()}
    for name, lines in backup.items():
        assert lines[-1] == "RET", name
        assert not [line for line in lines if "CLOSEURN" in line.replace("RET", "CLOSE") and '"' not in line]
    other = wire(machine, dialect)
    for name, lines in backup.items():
        other.tell(f"OPEN {name} CLEAR", *lines[:-1], "CLOSE")
    assert (len(other.card.programs), len(other.card.plcs.buffers)) == (len(PROGRAM_NUMBERS), len(PLC_NUMBERS))


@given(lines=st.lists(trees.lines, min_size=1, max_size=6))
def test_any_program_listed_and_sent_back_is_the_same(machine: MachineProfile, lines: list[Line]) -> None:
    texts = [format_line(line) for line in lines if line]
    assume(all(len(text) <= LINE_LIMIT for text in texts))
    card = wire(machine)
    card.tell("OPEN PROG 1 CLEAR", *texts, "CLOSE")
    for form in FORMS:
        card.tell(f"I9={form}")
        back = card.ask("LIST PROG 1")
        card.tell("OPEN PROG 2 CLEAR", *back, "CLOSE")
        assert card.ask("LIST PROG 2") == back
        typed, again = done_by(card)[0]
        assert again == typed


def test_places_definitions_and_settings_have_the_form_of_i9(machine: MachineProfile, dialect: Dialect) -> None:
    card = wire(machine, dialect)
    card.tell("OPEN PROG 1 CLEAR", "DWELL500", "CLOSE", "&1B1")
    assert [card.ask(f"I9={form} LIST PC") for form in FORMS] == [["P1:0:DWE500"], ["P1:0:DWELL500"]] * 2
    card = wire(machine, dialect)
    card.tell("M11->Y:$FFC2,0", "I5=2 I103=$720")
    assert [card.ask(f"I9={form} M11-> I5 I103 P0") for form in FORMS] == [
        ["Y:$FFC2,0", "2", "1824", "0"],
        ["M11->Y:$FFC2,0", "I5=2", "I103=1824", "0"],
        ["Y:$FFC2,0", "2", "$720", "0"],
        ["M11->Y:$FFC2,0", "I5=2", "I103=$720", "0"],
    ]


@pytest.mark.parametrize("form", [2, 3])
def test_a_reader_of_eighty_words_at_a_time_gets_all(machine: MachineProfile, dialect: Dialect, form: int) -> None:
    """It goes on with the address of the last line, and ends when it is refused; 1350 characters are its limit."""
    card = wire(machine, dialect)
    texts = [f"IF(P1={n}ANDM2={n}) X(P1+{n}) Y{n}.5 DWELL{n}" for n in range(300)]
    card.tell("OPEN PROG 5 CLEAR", *texts, "X1", "CLOSE", f"I9={form}")
    found: list[str] = []
    start = 0
    while not (said := card.raw(f"LIST PROG 5,{start},80\r")).startswith(b"\x07"):
        assert len(said) < 1350
        lines = said[:-1].decode().split("\r")[:-1]
        addresses, bodies = zip(*(line.split(":", 1) for line in lines), strict=True)
        start = int(addresses[-1]) if len(lines) > 1 else start + 80
        found += bodies[:-1] if len(lines) > 1 else bodies
    assert said == b"\x07ERR003\r"
    assert found == card.ask("LIST PROG 5")


def test_parts_and_addresses_are_those_of_the_listing(machine: MachineProfile, dialect: Dialect) -> None:
    card = wire(machine, dialect)
    card.tell("OPEN PROG 5 CLEAR", *program(7), "CLOSE")
    whole = card.ask("LIST PROG 5,0")
    end = int(whole[-1].partition(":")[0])
    parts = [line for start in range(0, end + 1, 7) for line in card.ask(f"LIST PROG 5,{start},7")]
    assert parts == whole
    card = wire(machine, dialect)
    card.tell("OPEN PROG 1 CLEAR", "P1=P2+P3*P4-P5/100", "TM500 X1", "CLOSE")
    card.tell("#1J/ #2J/ #3J/ &1B1R")
    card.sim.wait(0.1)
    (place,) = card.ask("LIST PE")
    assert place == f"P1:{card.ask('LIST PROG 1,1')[0]}" == "P1:3:TM500X1"
    assert card.ask("PE") == ["P1:3"]
