"""What a tool finds out of memory about the programs of a PMAC (Software Reference, Memory Map)."""

from __future__ import annotations

from drivers.pmac.dialect import PMAC, TURBO
from profiles.machine import MachineProfile
from tests.drivers.wire_card import wire


def test_the_numbers_of_the_programs_and_which_plcs_are_off(machine: MachineProfile) -> None:
    card = wire(machine, PMAC)
    card.tell(
        "I5=2", "OPEN PROG 7 CLEAR", "X1", "X2", "CLOSE", "OPEN PROG 1000 CLEAR", "CLOSE", "OPEN PROG 3", "CLOSE"
    )
    assert card.ask("RX:$E00,4") == ["7 1000 3 0"]
    begins = [int(text) for text in card.ask("RY:$E00,3")[0].split()]
    assert begins == [0x1800, 0x1802, 0x1802]
    card.tell("M1->X:$E00,0,16", "M2->Y:$F03,22", "M3->Y:$F04,22")
    card.tell("OPEN PLC 3 CLEAR", "P1=P1+1", "CLOSE", "ENABLE PLC 3")
    assert card.ask("M1 M2 M3") == ["7", "0", "1"]
    card.tell("DISABLE PLC 3", "DELETE PROG 7")
    assert card.ask("M1 M2") == ["1000", "1"]


def test_on_a_turbo_these_are_plain_words(machine: MachineProfile) -> None:
    card = wire(machine, TURBO)
    card.tell("OPEN PROG 7 CLEAR", "X1", "CLOSE")
    assert card.ask("RX:$E00") == ["0"]
