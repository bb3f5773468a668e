"""Which lines of somebody else's program write P1000 to P1023 (docs/commissioning.md)."""

from __future__ import annotations

import pytest

from drivers.commissioning.own_variables import own_variables_written
from drivers.pmac.buffer_text import BufferKind

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
        (PLC, 'CMD"P0..99999999999=0"', tuple(f"P{number}" for number in range(1000, 1024))),
        (PROGRAM, "P999=1 P1024=1 Q1000=1 M1000=1", ()),
        (PROGRAM, "P1=P1000+P1023", ()),  # to read them disturbs nobody
        (PROGRAM, "P(P5)=1", ()),  # known only when it runs
        (PLC, 'CMD"P1000"', ()),
        (PLC, 'SEND"P1000=1"', ()),
        (PLC, "no line", ()),
    ],
)
def test_a_line_is_judged_by_what_it_writes(kind: BufferKind, line: str, written: tuple[str, ...]) -> None:
    assert own_variables_written(kind, line) == written
