"""I4 and control-N: sums of characters, for hosts on noisy lines (Software Reference, I4; User Manual)."""

from __future__ import annotations

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    dialect: Dialect = request.param
    return wire(machine, dialect)


@pytest.mark.parametrize(("line", "total"), [("J+", 117), ("J/", 121)])
def test_control_n_reports_the_checksum_of_the_line_so_far_and_the_line_goes_on(
    card: Wire, line: str, total: int
) -> None:
    """74 + 43 and 74 + 47; one byte without an end."""
    assert card.raw(line + "\x0e") == bytes([total])
    assert card.raw(" \x18") == b""


def test_control_n_in_the_middle_of_a_line_does_not_disturb_it(card: Wire) -> None:
    assert card.raw("P1=\x0e7\r") == bytes([0x50 + 0x31 + 0x3D]) + b"\x06"
    assert card.ask("P1") == ["7"]


@pytest.mark.parametrize("i4", [0, 2])
def test_i4_even_sends_no_checksums(card: Wire, i4: int) -> None:
    assert card.raw(f"I4={i4}\rP1\r") == b"\x060\r\x06"


@pytest.mark.parametrize("i4", [1, 3])
@pytest.mark.parametrize(("i3", "handshake"), [(0, b""), (1, b"\n"), (2, b"\x06"), (3, b"\x06")])
def test_i4_odd_sends_the_checksum_of_the_line_behind_the_handshake(
    card: Wire, i4: int, i3: int, handshake: bytes
) -> None:
    card.raw(f"I4={i4} I3={i3}\r")
    assert card.raw("#1J/\r") == handshake + bytes([(0x23 + 0x31 + 0x4A + 0x2F) & 0xFF])


def test_i4_odd_sends_a_checksum_behind_each_line_of_data(card: Wire) -> None:
    """Each sum is of all that was sent of the line, its CR included; the sum of the command comes last."""
    card.tell("P1=25", "P2=50")
    card.raw("I4=1\r")
    expected = b"25\r" + bytes([0x32 + 0x35 + 13]) + b"50\r" + bytes([0x35 + 0x30 + 13])
    assert card.raw("P1..2\r") == expected + b"\x06" + bytes([sum(b"P1..2") & 0xFF])


def test_a_checksum_does_not_count_control_characters_of_the_host(card: Wire) -> None:
    card.raw("I4=1\r")
    assert card.raw("P\x051\x14=3\n\r") == b"\x06" + bytes([sum(b"P1=3")])
    assert card.raw("\r") == b"\x06\x00"


def test_there_is_no_checksum_behind_an_error(card: Wire) -> None:
    card.raw("I4=1\r")
    assert card.raw("UUU\r") == b"\x07ERR003\r"
