"""Programs and PLCs that are listed under each I9 and sent back are the same programs and PLCs."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.language.syntax import Line, PlcProgram, Program, Return
from drivers.pmac.language.text import format_line
from drivers.simulator.hosts.port import LINE_LIMIT
from profiles.machine import MachineProfile
from tests.drivers.language import trees
from tests.drivers.wire_card import Wire, wire

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
def test_any_program_is_the_same_after_it_was_listed_and_sent_back(
    machine: MachineProfile, lines: list[Line]
) -> None:
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


def test_a_place_in_a_program_is_listed_in_the_form_of_i9(machine: MachineProfile, dialect: Dialect) -> None:
    card = wire(machine, dialect)
    card.tell("OPEN PROG 1 CLEAR", "DWELL500", "CLOSE", "&1B1")
    assert [card.ask(f"I9={form} LIST PC") for form in FORMS] == [["P1:0:DWE500"], ["P1:0:DWELL500"]] * 2


def test_m_definitions_and_settings_are_listed_in_the_form_of_i9(
    machine: MachineProfile, dialect: Dialect
) -> None:
    card = wire(machine, dialect)
    card.tell("M11->Y:$FFC2,0", "I5=2 I103=$720")
    assert [card.ask(f"I9={form} M11-> I5 I103 P0") for form in FORMS] == [
        ["Y:$FFC2,0", "2", "1824", "0"],
        ["M11->Y:$FFC2,0", "I5=2", "I103=1824", "0"],
        ["Y:$FFC2,0", "2", "$720", "0"],
        ["M11->Y:$FFC2,0", "I5=2", "I103=$720", "0"],
    ]


@pytest.mark.parametrize("form", [2, 3])
def test_a_reader_that_asks_for_eighty_words_at_a_time_gets_all_of_it(
    machine: MachineProfile, dialect: Dialect, form: int
) -> None:
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


def test_a_part_by_start_and_length_follows_on_the_one_before(machine: MachineProfile, dialect: Dialect) -> None:
    card = wire(machine, dialect)
    card.tell("OPEN PROG 5 CLEAR", *program(7), "CLOSE")
    whole = card.ask("LIST PROG 5,0")
    end = int(whole[-1].partition(":")[0])
    parts = [line for start in range(0, end + 1, 7) for line in card.ask(f"LIST PROG 5,{start},7")]
    assert parts == whole


def test_the_address_of_a_place_is_that_of_its_line_in_the_listing(
    machine: MachineProfile, dialect: Dialect
) -> None:
    card = wire(machine, dialect)
    card.tell("OPEN PROG 1 CLEAR", "P1=P2+P3*P4-P5/100", "TM500 X1", "CLOSE")
    card.tell("#1J/ #2J/ #3J/ &1B1R")
    card.sim.wait(0.1)
    (place,) = card.ask("LIST PE")
    assert place == f"P1:{card.ask('LIST PROG 1,1')[0]}" == "P1:3:TM500X1"
    assert card.ask("PE") == ["P1:3"]
