"""How the factory settings of a Turbo are reported: in the form in which a real card reported all 8192 of them.

The numbers below are those of a public read-out of a re-initialised card (firmware 1.94, I9=2) whose answers began
with `$`; every other answer was decimal.
"""

from __future__ import annotations

import pytest

from drivers.pmac.dialect import PMAC, TURBO
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire

GLOBAL = (
    *(20, 21, 22, 23, 24, 37, 67, *range(69, 78), *range(90, 100)),
    *(4900, 4901, 4902, 4903, 4904, 4908, *range(5001, 5049), 5050, 5051, *range(5061, 5077), *range(5081, 5097)),
    *(6805, 6806, 6840, 6841, *range(8000, 8192)),
)
OF_A_MOTOR = (2, 3, 4, 5, 10, 24, 25, 42, 43, 55, 81, 82, 83, 84, 91, 95)
OF_A_SYSTEM = (93,)


@pytest.fixture
def card(machine: MachineProfile) -> Wire:
    made = wire(machine, TURBO)
    made.raw("$$$***\r")
    made.raw("I3=2I6=1I4=0\r")
    return made


def reported(card: Wire) -> list[str]:
    return [text for first in range(0, 8192, 256) for text in card.ask(f"I{first}..{first + 255}")]


def test_a_setting_is_reported_in_the_form_of_a_real_card(card: Wire) -> None:
    wanted = {
        *GLOBAL,
        *(100 * motor + number for motor in range(1, 33) for number in OF_A_MOTOR),
        *(5000 + 100 * system + number for system in range(1, 17) for number in OF_A_SYSTEM),
    }
    assert {number for number, text in enumerate(reported(card)) if text.startswith("$")} == wanted


def test_the_number_of_coordinate_systems_is_decimal(card: Wire) -> None:
    """Public programs take it as it is, and have that many systems and one."""
    assert card.ask("I68") == ["15"]
    assert card.ask("I9=3 I68 I20") == ["I68=15", "I20=$0"]


def test_without_bit_1_of_i9_every_setting_is_decimal(card: Wire) -> None:
    for form in (0, 1):
        card.tell(f"I9={form}")
        assert not [text for text in reported(card) if "$" in text]


def test_addresses_of_a_pmac_are_those_that_the_manual_names(machine: MachineProfile) -> None:
    """Software Reference I9: I20 to I44, I47, and those of motors and coordinate systems."""
    card = wire(machine, PMAC)
    assert card.ask("I9=2 I20 I44 I47 I48 I105") == ["$0", "$0", "$0", "0", "$73F"]
