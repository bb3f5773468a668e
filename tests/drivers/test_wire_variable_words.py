"""Variables and definitions as memory: what is written to their words is what they are."""

from __future__ import annotations

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire

DEFINITIONS = {"pmac": 0xBC00, "turbo": 0x4000}
P_VARIABLES, Q_VARIABLES = {"pmac": 0x1000, "turbo": 0x6000}, {"pmac": 0x1400, "turbo": 0x8000}


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    dialect: Dialect = request.param
    return wire(machine, dialect)


def test_a_pointer_that_is_written_through_memory_points_there(card: Wire) -> None:
    """The idiom of public PLCs: M35 is the address that M34 points at, and so an index into memory."""
    first = DEFINITIONS[card.card.dialect.name]
    card.tell("M34->Y:$1800,0,24", f"M35->Y:${first + 34:X},0,16", "M34=5")
    assert card.ask("M35") == [str(0x1800)]
    card.tell("M35=$1801", "M34=6")
    assert card.ask("M34-> RY:$1800,2 M34") == ["Y:$1801,24", "5 6", "6"]


def test_a_definition_is_copied_word_by_word(card: Wire) -> None:
    first = DEFINITIONS[card.card.dialect.name]
    card.tell("M1->X:$1820,8,4,S")
    (code,) = card.ask(f"RHX:${first + 1:X}")
    card.tell(f"WX:${first + 2:X},${code}", f"WY:${first + 2:X},$1821")
    assert card.ask("M2->") == ["X:$1821,8,4,S"]
    card.tell(f"WX:${first + 2:X},0")
    assert card.ask("M2->") == ["*"]


def test_p_and_q_by_their_addresses(card: Wire) -> None:
    p, q = P_VARIABLES[card.card.dialect.name], Q_VARIABLES[card.card.dialect.name]
    card.tell("P5=1.25", "&2Q3=9", "&1Q3=-4", f"M1->L:${p + 7:X}", "M1=0.5")
    assert card.ask(f"RL:${p + 5:X} RL:${q + 3:X} P7") == ["1.25", "-4", "0.5"]
    card.tell(f"WL:${p + 5:X},3")
    assert card.ask("P5") == ["3"]


def test_the_memory_of_the_program_is_kept_apart(card: Wire) -> None:
    card.tell("WP$10,$ABC,2", "WX$10,1")
    assert card.ask("RHP$10,2 RP$10 RX$10") == ["000ABC 000002", "2748", "1"]


def test_the_clocks_that_drivers_read_at_connect(machine: MachineProfile) -> None:
    """(2 x 6527 + 3) x (0 + 1) x (3 + 1) x 640/9 is the factory's I10 within its clock's tolerance."""
    turbo = wire(machine, TURBO)
    maximum, phase, servo = (int(text) for text in turbo.ask("I7000 I7001 I7002"))
    assert (2 * maximum + 3) * (phase + 1) * (servo + 1) * 640 / 9 == pytest.approx(3_713_707, rel=1e-3)


def test_a_user_buffer_is_at_the_end_of_the_memory_for_buffers(machine: MachineProfile) -> None:
    """The example of the Turbo Software Reference, I4908; of a PMAC, X:$0F42 of its memory map."""
    turbo = wire(machine, TURBO)
    turbo.tell("I9=2")
    assert turbo.ask("I4908") == ["$10800"]
    turbo.tell("DEF UBUF 512")
    assert turbo.ask("I4908") == ["$10600"]
    turbo.tell("I4908=5", "WY:$10600,7")
    assert turbo.ask("I4908 RY:$10600") == ["$10600", "7"]
    assert turbo.refusal("DEFINE UBUFFER 60000") == 6
    turbo.tell("DEFINE UBUFFER 0")
    assert turbo.ask("I4908") == ["$10800"]
    pmac = wire(machine, PMAC)
    pmac.tell("DEFINE UBUFFER 256")
    assert pmac.ask("RHX:$F42") == ["009F00"]
    pmac.tell("DEL UBUF")
    assert pmac.ask("RHX:$F42") == ["00A000"]
