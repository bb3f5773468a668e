"""Which lines of somebody else's program write what belongs to the console (docs/commissioning.md)."""

from __future__ import annotations

import pytest

from drivers.commissioning.downloadable import OwnVariables
from drivers.lathe.ownership import ITEMS
from drivers.pmac.buffer_text import BufferKind
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.reserved import OWN_VARIABLES

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
    assert OwnVariables(DIALECTS["pmac"]).written(kind, line) == written


@pytest.mark.parametrize(("family", "written"), [("pmac", ("M70", "M71")), ("turbo", ("I5111", "I5112"))])
def test_a_program_that_winds_up_a_timer_of_the_heartbeat_is_seen(family: str, written: tuple[str, ...]) -> None:
    """Each renews the lease of a host that may be gone: nothing would end its motion."""
    of_family = OwnVariables(DIALECTS[family])
    assert of_family.written(PLC, "M70=1000000 M71=1 I5111=1000000 I5112=1") == written
    assert of_family.written(PLC, 'CMD"M70=9 M71..71=9 I5111=9 I(5000+112)=9"') == written


def test_the_signature_ends_where_what_belongs_to_the_console_ends() -> None:
    assert ITEMS[-1] == f"P{OWN_VARIABLES[-1]}" == "P1023"
