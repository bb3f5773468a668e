"""A card that is uploaded by a stranger's tool, sent back to a fresh card and uploaded again: the same text."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

import pytest

from drivers.pmac.dialect import DIALECTS, Dialect
from profiles.machine import MachineProfile
from tests.drivers.wire_card import BELL, Wire, wire

PROGRAMS, PLCS, PART = 30, 20, 256
TEXTS = (
    "inc x10 y(p1) f(p2)",
    "WHILE(P1<3)",
    "P1=((P1+1))",
    "ENDW",
    "if (p1=1 and m2=0) dwe 20",
    "hmz 25..27",
    "home 1..3",
    'cmd "#1j/"',
    "dis plc 2..31",
    "ena plc 2",
    "pvt 20 x0.50:5",
    "N100 gosub 200",
    "call 500.1 a5 b6",
    "spline1 ta40 X5",
    "linear ta10 ts0 tm100",
    "M1==M1|$F",
)
PLC_TEXTS = ("if (p1=1)", "adr&2#4", "P2=P2+1", "endi", 'send "hello; there"', "disable plc 2..31", "P3=.5*(P4-1)")


class Tool:
    """A host that knows nothing but the manual: text in, text out."""

    def __init__(self, card: Wire, dialect: Dialect) -> None:
        self.card, self.dialect = card, dialect
        self.ask("I9=3")

    def ask(self, line: str) -> list[str] | None:
        """Return the lines of an answer, None for a refusal, however long the card takes over it."""
        said = self.card.raw(line + "\r")
        while not said or said[-1:] not in (b"\x06", b"\r") or (said[-1:] == b"\r" and BELL not in said):
            self.card.sim.wait(0.005)
            said += self.card.port.take_output()
        return None if BELL in said else said[:-1].decode("ascii").split("\r")[:-1]

    def send(self, lines: list[str]) -> list[str]:
        """Send a backup; return the lines that were refused."""
        return [line for line in lines if self.ask(line) is None]

    def upload(self) -> list[str]:
        """Everything that stays, as lines to send."""
        motors, systems = range(1, self.dialect.motor_count + 1), range(1, self.dialect.system_count + 1)
        lines = [line for line in self._values("I") if not self._is_fleeting(line)]
        lines += list(self._definitions())
        lines += [line for line in self._values("P") if not line.endswith("=0")]
        for system in systems:
            self.ask(f"&{system}")
            lines += [f"&{system}", *(f"#{m}->{self._one(f'#{m}->')}" for m in motors)]
            lines += [line for line in self._values("Q") if not line.endswith("=0")]
        for motor in reversed(motors):
            table = self.ask(f"#{motor}LIST COMP DEF")
            if table is not None:
                lines += [f"#{motor}DELETE COMP", f"#{motor}DEFINE COMP {table[0]}"]
                lines += self.ask(f"#{motor}LIST COMP") or []
        for kind, last in (("PROG", 1100), ("PLC", 31)):
            for number in range(1, last + 1):
                text = self.ask(f"LIST {kind} {number}")
                if text is not None:
                    lines += [f"OPEN {kind} {number} CLEAR", *text, "CLOSE"]
        return lines + [line for line in self._values("M") if not line.endswith("=0")]

    def _values(self, kind: str) -> Iterator[str]:
        for first in range(0, self.dialect.highest_index + 1, PART):
            found = self.ask(f"{kind}{first}..{first + PART - 1}") or []
            assert len(found) == PART
            long = kind == "I"
            yield from found if long else (f"{kind}{first + n}={value}" for n, value in enumerate(found))

    def _definitions(self) -> Iterator[str]:
        for first in range(0, self.dialect.highest_index + 1, PART):
            yield from (line for line in self.ask(f"M{first}..{first + PART - 1}->") or [] if line[-1] != "*")

    def _one(self, line: str) -> str:
        (text,) = self.ask(line) or [""]
        return text

    def _is_fleeting(self, line: str) -> bool:
        """The handshake of this host, and the timers of a Turbo, which count down."""
        index = int(line[1:].partition("=")[0])
        timer = index % 100 in self.dialect.timer_numbers and 5100 <= index < 6700
        return index in (1, 3, 4, 6, 9) or timer


def fill(tool: Tool, random: Random) -> None:
    """Something of everything, everywhere."""
    dialect = tool.dialect
    motors, systems = dialect.motor_count, dialect.system_count
    lines = ["I5=2", "I15=1", "I108=32", "I130=1999.5", "I125=$C000", f"P{dialect.highest_index}=-0.125", "P7=1/3"]
    lines += ["M1->X:$700,24,S", "M2->Y:$10F0,8,4", "M3->D:$28", "M4->L:$1200", "M5->Y:$12A0,24", "M2=5", "M5=77"]
    lines += [f"P{random.randrange(dialect.highest_index)}={random.uniform(-1e6, 1e6):.6f}" for _ in range(40)]
    lines += ["UNDEFINE ALL"]
    lines += [f"&{n % systems + 1}#{n}->{100 * n}{'XYZ'[n // systems % 3]}+{n}" for n in range(1, motors + 1)]
    lines += [f"&{system}Q{system}={system}.5" for system in range(1, systems + 1)]
    for motor in (4, 3, 1):
        lines += [f"#{motor}DEFINE COMP 8,#2,#{motor},40000", "1 2 3 -4 5 -60 7 0"]
    for number in (*range(1, PROGRAMS), 1000):
        lines += [f"OPEN PROG {number} CLEAR", *random.choices(TEXTS, k=12), "CLOSE"]
    for number in range(1, PLCS + 1):
        lines += [f"OPEN PLC {number} CLEAR", *random.choices(PLC_TEXTS, k=9), "CLOSE"]
    assert tool.send(lines) == []


@pytest.mark.first(1)
@pytest.mark.parametrize("dialect", DIALECTS.values(), ids=DIALECTS)
def test_upload_restore_upload_is_the_same_text(machine: MachineProfile, dialect: Dialect) -> None:
    first = Tool(wire(machine, dialect), dialect)
    fill(first, Random(30))
    text = first.upload()
    assert sum(line.startswith("OPEN PROG") for line in text) == PROGRAMS
    assert sum(line.startswith("OPEN PLC") for line in text) == PLCS
    assert sum("DEFINE COMP" in line for line in text) == 3
    assert sum("->" in line and not line.endswith("->0") for line in text if line[0] == "#") == dialect.motor_count
    fresh = Tool(wire(machine, dialect), dialect)
    assert fresh.send(text) == []
    assert fresh.upload() == text
