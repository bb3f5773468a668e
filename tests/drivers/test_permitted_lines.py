"""Lines that are permitted, and what a line writes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.commissioning.downloadable import OwnVariables
from drivers.errors import RefusedError
from drivers.lathe.ownership import ITEMS
from drivers.pmac.buffer_text import BufferKind
from drivers.pmac.dialect import DIALECTS, Dialect
from drivers.pmac.reserved import OWN_VARIABLES
from drivers.requests.permitted_lines import RequestKind, gathers, parse_watch_item, permission
from tests.tui.side_stage import DirectSide
from tests.tui.stage import lathe

FAMILIES = pytest.mark.parametrize("dialect", DIALECTS.values(), ids=DIALECTS)

QUERIES = (
    "I130",
    "p1",
    "P1..8",
    "M1->",
    "#1?",
    "&1??",
    "???",
    "#1P #1V #1F",
    "%",
    "#1->",
    "VERSION",
    "SIZE",
    "CID",
)
MEMORY = ("RX:$28", "RHY:$720,8", "RHX $3D")

# What each does is that of the Software Reference; the word is what the answer is chosen by.
MOVES = {
    "jog": ("#1J+", "#1J-", "J=100", "#2J:50", "J^10", "#1 J+"),
    "enable": ("#1J/", "J/"),
    "home": ("#1HM", "HM", "HMZ", "HOME"),
    "run": ("&1B1R", "B1 R", "R", "S", "&1R"),
    "open_loop": ("#1O5", "O-10"),
    "kill": ("#1K", "K"),
    "stop": ("A", "H", "Q", "\\", "/"),
}
WRITES = (
    *("I130=2000", "P1=1", "M1->X:$28", "M1=1", "WX:$28,0", "SAVE", "$$$", "$$$***", "OPEN PROG 1 CLEAR", "CLOSE"),
    *("ENABLE PLC 1", "DELETE GATHER", "DEFINE GATHER 10", "GATHER", "I20=3", "X10", "UNDEFINE", "P1=P1+1", "%50"),
)
ODD = ("", "\x01", "I130\r#1J+", "한글", "I130\x0b", "P" * 200)


@FAMILIES
def test_queries_are_permitted(dialect: Dialect) -> None:
    for line in (*QUERIES, *MEMORY):
        assert permission(line, dialect).kind is RequestKind.QUERY, line
    for line in ("LIST PLC 1", "LIST PROG 10", "LIST GATHER 0,16"):
        assert permission(line, dialect).kind is RequestKind.LISTING, line


@FAMILIES
@pytest.mark.parametrize("what", MOVES)
def test_what_moves_is_refused_with_the_page_that_does_it(what: str, dialect: Dialect) -> None:
    for line in (*MOVES[what], *(f"I130 {line}" for line in MOVES[what]), *(f"{line} P1" for line in MOVES[what])):
        with pytest.raises(RefusedError) as refused:
            permission(line, dialect)
        problem = refused.value.problems[0]
        assert (problem.code, problem.key) == ("terminal.moves", what), line
    assert any(word in str(problem) for word in ("page", "Press", "console")), str(problem)


@FAMILIES
def test_what_changes_anything_is_refused(dialect: Dialect) -> None:
    for line in (*WRITES, *ODD):
        with pytest.raises(RefusedError):
            permission(line, dialect)


@FAMILIES
def test_a_reply_that_would_hold_up_the_polls_is_refused(dialect: Dialect) -> None:
    for line in ("I0..1000", "P1..8 I0..99", f"RX:$100,{200}"):
        with pytest.raises(RefusedError) as refused:
            permission(line, dialect)
        assert refused.value.problems[0].code == "terminal.too_long"


def test_a_register_of_the_hardware_is_not_read_by_its_address() -> None:
    """PMAC Software Reference, memory map: DSPGATE at $C000; Turbo: servo ICs at $78000."""
    for family, line in (("pmac", "RX:$C003"), ("turbo", "RHX:$078003"), ("pmac", "RX:$BFFF,4")):
        with pytest.raises(RefusedError) as refused:
            permission(line, DIALECTS[family])
        assert refused.value.problems[0].code == "terminal.hardware"


@FAMILIES
def test_only_single_values_are_watched(dialect: Dialect) -> None:
    assert [parse_watch_item(item, dialect) for item in (" p100 ", "#1P", "RHX:$3D")] == ["P100", "#1P", "RHX:$3D"]
    for item in ("P1 P2", "P1..4", "LIST PLC 1", "RX:$28,2", "#1", "P1=1"):
        with pytest.raises(RefusedError):
            parse_watch_item(item, dialect)


@FAMILIES
def test_a_gather_line_sets_up_gathering_and_nothing_else(dialect: Dialect) -> None:
    places = dialect.gathering
    good = (f"I{places.period}=2 I{places.masks[0]}=7 I{places.first_source}=40", "GATHER", "DEFINE GATHER 100")
    assert all(gathers(line, dialect) for line in good)
    for line in ("I130=1", f"I{places.period}=2 I130=1", "GATHER #1J+", "DEFINE GATHER 9 I130=2", "#1J+", ""):
        assert not gathers(line, dialect), line


WORDS = st.sampled_from(
    (*QUERIES, *MEMORY, *WRITES, *(line for lines in MOVES.values() for line in lines), "#3", "&1", "LIST PROG 1")
)


@given(st.lists(WORDS, min_size=1, max_size=3))
def test_a_permitted_line_leaves_the_controller_as_it_was(words: list[str]) -> None:
    side, line = SIDE, " ".join(words)
    try:
        permission(line, side.dialect)
    except RefusedError:
        return
    before = state_of(side)
    side.client.send(line)
    try:
        side.client.reply(line)
    except Exception as refused:  # an item that the controller does not have
        assert "ERR" in str(refused) or "controller" in str(refused), refused
    assert state_of(side) == before


def state_of(side: DirectSide) -> tuple[object, ...]:
    ask = side.client.request
    return (
        ask("I0..1023"),
        ask("P0..99"),
        ask("M0..99->"),
        ask("#1? #2? #3? #4? &1?? ???"),
        ask("SIZE #1P #2P #3P"),
    )


SIDE = DirectSide(lathe().machine)


# Which lines of somebody else's program write what belongs to the console (docs/commissioning.md).

PROGRAM, PLC = BufferKind.PROGRAM, BufferKind.PLC


@pytest.mark.parametrize(
    ("kind", "line", "written"),
    [
        (PROGRAM, "P1000=0", ("P1000",)),
        (PROGRAM, "X10 P1023=P5 P1024=1", ("P1023",)),
        (PROGRAM, "IF(P1=1) P1002=P1002+1", ("P1002",)),
        (PROGRAM, "P(2*500+4)=1", ("P1004",)),
        (PLC, "P1003=0", ("P1003",)),
        (PLC, 'CMD"P1000=5"', ("P1000",)),
        (PLC, 'CMD"#1J/ P(1004)=0"', ("P1004",)),
        (PLC, 'CMD"P1,3,500=0"', ("P1001",)),  # P1, P501, P1001
        (PLC, 'CMD"P1022,99=0"', ("P1022", "P1023")),
        (PLC, 'CMD"P0..99999999999=0"', tuple(f"P{number}" for number in range(971, 1024))),
        (PLC, 'CMD"P$3E8=1 P($3E9)=1 P(500*2+2)=1"', ("P1000", "P1001", "P1002")),
        (PROGRAM, "M1000=1 M1014=1 M1015=1 M26=1", ("M26", "M1000", "M1014")),
        (PROGRAM, "P970=1 P1024=1 Q1000=1 M999=1", ()),
        (PROGRAM, "P1=P1000+P1023", ()),  # to read them disturbs nobody
        (PROGRAM, "P(P5)=1", ()),  # known only when it runs
        (PLC, 'CMD"P1000"', ()),
        (PLC, 'SEND"P1000=1"', ()),
        (PLC, "no line", ()),
    ],
)
def test_a_line_is_judged_by_what_it_writes(kind: BufferKind, line: str, written: tuple[str, ...]) -> None:
    assert OwnVariables(DIALECTS["pmac"]).find_written(kind, line) == written


@pytest.mark.parametrize(("family", "written"), [("pmac", ("M70", "M71")), ("turbo", ("I5111", "I5112"))])
def test_a_program_that_winds_up_a_timer_of_the_heartbeat_is_seen(family: str, written: tuple[str, ...]) -> None:
    """Each renews the lease of a host that may be gone: nothing would end its motion."""
    of_family = OwnVariables(DIALECTS[family])
    assert of_family.find_written(PLC, "M70=1000000 M71=1 I5111=1000000 I5112=1") == written
    assert of_family.find_written(PLC, 'CMD"M70=9 M71..71=9 I5111=9 I(5000+112)=9"') == written


def test_the_signature_ends_where_what_belongs_to_the_console_ends() -> None:
    assert ITEMS[-1] == f"P{OWN_VARIABLES[-1]}" == "P1023"
