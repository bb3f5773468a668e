"""A backup with values: sent to a fresh card by the client, and read again, it is the same text to the byte."""

from __future__ import annotations

from random import Random

import pytest

from drivers.commissioning.backup import backup_text, read_backup, typed_lines
from drivers.commissioning.reading import Extent, read_configuration, whole_card
from drivers.pmac.dialect import Dialect
from profiles.machine import MachineProfile
from tests.drivers.commissioned import Commissioned, commissioned
from tests.drivers.families import machine as machine  # both families
from tests.drivers.test_backup_whole import PLC_TEXTS, TEXTS

PROGRAMS, PLCS = 30, 20
DATE = "2026-03-01T12:00:00+00:00"


def filled(machine: MachineProfile, random: Random) -> Commissioned:
    """A card with something of everything, in every coordinate system."""
    card = commissioned(machine)
    dialect = card.dialect
    motors, systems, highest = dialect.motor_count, dialect.system_count, dialect.highest_index
    lines = ["I15=1", "I108=32", "I130=1999.5", f"P{highest}=-0.125", "P7=1/3", "P8=-2000000.25", f"M{highest}=3"]
    lines += ["M1->X:$700,24,S", "M2->Y:$10F0,8,4", "M3->D:$28", "M4->L:$1200", "M5->Y:$12A0,24", "M5=77", "M7=5"]
    lines += [f"P{random.randrange(1000)}={random.uniform(-1e6, 1e6):.6f}" for _ in range(40)]
    lines += ["UNDEFINE ALL"]
    lines += [f"&{n % systems + 1}#{n}->{100 * n}{'XYZ'[n // systems % 3]}+{n}" for n in range(1, motors + 1)]
    lines += [f"&{system}Q{system}={system}.5" for system in range(1, systems + 1)]
    for motor in (4, 3, 1):
        lines += [f"#{motor}DEFINE COMP 40,#2,#{motor},40000", *["1 2 3 -4 5 -60 7 0"] * 5]
    for number in (*range(1, PROGRAMS), 1000):
        lines += [f"OPEN PROG {number} CLEAR", *random.choices(TEXTS, k=12), "CLOSE"]
    for number in range(1, PLCS + 1):
        lines += [f"OPEN PLC {number} CLEAR", *random.choices(PLC_TEXTS, k=9), "CLOSE"]
    last = {"pmac": 0x9FFF, "turbo": 0x107FF}[dialect.name]
    lines += ["DEFINE UBUFFER 300", f"WX:${last - 299:X},$ABCDEF,1", f"WY:${last:X},$FFFFFF"]
    if dialect.kinematics is not None:
        lines += ["&3", "OPEN INVERSE CLEAR", "P4=Q7*100", "IF(Q10=1)", "ENDIF", "CLOSE"]
        lines += ["&16OPEN FORWARD CLEAR", "Q7=P4/100", "CLOSE", "&1"]
    card.tell(*lines)
    return card


def text_of(card: Commissioned, extent: Extent) -> str:
    return backup_text(read_configuration(card.client, card.dialect, extent), DATE)


def restored(machine: MachineProfile, text: str) -> Commissioned:
    """A fresh card to which our client has sent the text."""
    card = commissioned(machine)
    card.client.download(typed_lines(text))
    assert card.client.in_step
    return card


def part(dialect: Dialect) -> Extent:
    """Everything but most of what takes time: the definitions and settings of the factory."""
    every = range(200)
    return Extent(settings=(every,), pointers=(every,), motors=tuple(range(1, dialect.motor_count + 1)))


def test_text_of_programs_tables_and_systems_comes_back(machine: MachineProfile) -> None:
    first = filled(machine, Random(30))
    extent = part(first.dialect)
    text = text_of(first, extent)
    for kind, count in (("OPEN PROG", PROGRAMS), ("OPEN PLC", PLCS), ("; #", 3)):
        assert sum(line.startswith(kind) for line in text.splitlines()) == count
    assert {line.partition("#")[0] for line in text.splitlines() if line[0:1] == "&"} == {
        f"&{n}" for n in range(1, first.dialect.system_count + 1)
    }
    again = text_of(restored(machine, text), extent)
    tables = [line for line in text.splitlines() if line.startswith("; #")]
    assert [line for line in again.splitlines() if "sha256" not in line] == [
        line for line in text.splitlines() if "sha256" not in line and line not in tables
    ], "without the values the entries of tables are not kept"


@pytest.mark.long
def test_backup_restore_backup_is_identical(machine: MachineProfile) -> None:
    first = filled(machine, Random(31))
    extent = whole_card(first.dialect, values=True)
    text = text_of(first, extent)
    systems = first.dialect.system_count
    for line in ("P7=0.3333333333", "M7=5", f"&{systems}Q{systems}={systems}.5", "#4DEFINE COMP 40,#2,#4,40000"):
        assert f"\n{line}\n" in text
    assert "\nDEFINE UBUFFER 300\nWX:$" in text
    assert ("\n&3OPEN INVERSE\n" in text) == (first.dialect.kinematics is not None)
    assert text_of(restored(machine, text), extent) == text
    backup = read_backup(text, "file")
    assert backup_text(backup.configuration, backup.date) == text
