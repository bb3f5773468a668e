"""Programs of others at the Ethernet board, byte by byte: what they send, and what they wait for."""

from __future__ import annotations

import re

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from profiles.machine import MachineProfile
from tests.drivers.wire_board import DOWN, UP, BoardWire, wire_board


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def board(machine: MachineProfile, request: pytest.FixtureRequest) -> BoardWire:
    """As the factory leaves it: I3 = 1, I6 = 3."""
    dialect: Dialect = request.param
    return wire_board(machine, dialect)


def connected(board: BoardWire) -> BoardWire:
    assert board.response(b"i6=1 i3=2 ver").endswith(b"\x06")
    return board


def test_a_library_connects_with_one_line_and_takes_nothing_but_a_version_and_one_ack(board: BoardWire) -> None:
    """Two assignments without a word, the data of `ver`, and one acknowledgement at the end."""
    (reply,) = board.raw(bytes.fromhex("40bf00000000000d") + b"i6=1 i3=2 ver")
    assert re.fullmatch(rb"\d+\.\d+\s*\r\x06", reply)


def test_a_library_that_receives_once_for_each_command_is_never_one_reply_behind(board: BoardWire) -> None:
    """Each reply is one piece, and the next command gets its own; also behind an error."""
    connected(board)
    for number in range(50):
        assert board.raw(bytes.fromhex("40bf000000000008") + b"P1=%02d P1" % number) == [b"%d\r\x06" % number]
        assert board.raw(bytes.fromhex("40bf000000000003") + b"UUU") == [b"\x07ERR003\r"]


def test_a_library_that_saves_gets_a_nul_in_the_time_that_it_doubles_for_it(board: BoardWire) -> None:
    """It waits 6 s for this line, and its next command gets its own answer."""
    connected(board)
    began_s = board.sim.now_s()
    assert board.raw(bytes.fromhex("40bf000000000004") + b"SAVE") == [b"\x00"]
    assert 3.0 < board.sim.now_s() - began_s < 6.0
    assert board.raw(bytes.fromhex("40bf000000000003") + b"P99") == [b"0\r\x06"]


def test_a_library_whose_longest_line_is_255_characters(board: BoardWire) -> None:
    """It packs the length into one byte; the high one is always 0."""
    connected(board)
    line = b"P1=1".ljust(251) + b"P2=2"
    assert board.raw(bytes.fromhex("40bf0000000000ff") + line) == [b"\x06"]
    assert board.response(b"P1..2") == b"1\r2\r\x06"


def test_a_port_driver_flushes_sends_an_empty_line_and_polls_forty_items(board: BoardWire) -> None:
    """On a silence it would look with READREADY and fetch with GETBUFFER: nothing is left there."""
    connected(board)
    assert board.raw(bytes.fromhex("40b3000000000000")) == [b"@"]
    assert board.raw(bytes.fromhex("40bf000000000000")) == [b"\x06"]
    items = [item for n in range(1, 9) for item in (f"#{n}?", f"#{n}P", f"#{n}F", f"M{n}31", f"P{n}00")]
    reply = board.response(" ".join(items).encode())
    assert len(reply.removesuffix(b"\r\x06").split(b"\r")) == len(items) == 40
    assert board.raw(bytes.fromhex("c0c2000000000002")) == [b"\0\0"]
    assert board.raw(bytes.fromhex("c0c5000000000578")) == [b"\0"]


def test_a_port_driver_that_asks_by_a_control_character_meets_no_ack_and_then_nothing(board: BoardWire) -> None:
    """It can only end such a reply by its own time-out, and asks the board once more before."""
    connected(board)
    (reply,) = board.raw(bytes.fromhex("c0c4000200000578"))
    assert b"\x06" not in reply
    assert reply.count(b" ") == 7
    assert board.raw(bytes.fromhex("c0c2000000000002")) == [b"\0\0"]


def test_a_driver_that_moves_an_axis_by_its_program_and_stops_it(board: BoardWire) -> None:
    """`&2B10R` starts, `&2A` stops."""
    connected(board)
    for line in (b"#1J/ #2J/ #3->0", b"&2#3->Z #3J/", b"OPEN PROG 10 CLEAR"):
        assert board.response(line) == b"\x06"
    for line in (b"LINEAR ABS TA10 TS0 TM(Q70)", b"Z(Q79)", b"CLOSE", b"&2 Q70=500 Q79=400", b"&2B10R"):
        assert board.response(line) == b"\x06"
    board.settle()
    assert board.response(b"&2Q79#3P") == b"400\r400\r\x06"
    assert board.response(b"&2 Q79=0") == b"\x06"
    assert board.response(b"&2B10R") == b"\x06"
    board.sim.wait(0.2)
    assert board.response(b"&2A") == b"\x06"
    board.settle()
    position = float(board.response(b"#3P").removesuffix(b"\r\x06"))
    assert 0 < position < 400


def test_a_control_panel_polls_everything_in_one_line_without_separators(board: BoardWire) -> None:
    connected(board)
    assert board.response(b"M190=3 M290=4") == b"\x06"
    lines = board.response(b"i65???&1??%#1?PVF m190 #2?PVF m290 p99").removesuffix(b"\r\x06").split(b"\r")
    systems = 12 if board.sim.controller.dialect is PMAC else 18
    assert [len(line) for line in lines[:5]] == [1, 12, systems, 3, 12]
    assert lines[5:9] == [b"0", b"0", b"0", b"3"]
    assert len(lines[9]) == 12
    assert lines[10:] == [b"0", b"0", b"0", b"4", b"0"]


def test_a_control_panel_takes_a_bell_for_an_open_buffer_and_closes_it(board: BoardWire) -> None:
    connected(board)
    assert board.response(b"OPEN PROG 1 CLEAR") == b"\x06"
    assert board.response(b"i65???&1??%#1?PVF m190 p99").startswith(b"\x07")
    assert board.response(b"CLOSE") == b"\x06"
    assert board.response(b"i65???&1??%#1?PVF m190 p99").count(b"\r") == 10


def exchange(board: BoardWire, line: bytes) -> bytes:
    """SENDLINE, which says @, and GETBUFFER."""
    assert board.ask(DOWN, 0xB0, line) == b"@"
    return board.ask(UP, 0xC5, length=1400)


def test_a_controller_class_that_sends_and_fetches(machine: MachineProfile) -> None:
    """It flushes with 500 ms in its header, and follows its jogs by the registers of the motor."""
    board = wire_board(machine, TURBO)
    assert board.raw(bytes.fromhex("40b301f400000000")) == [b"@"]
    assert exchange(board, b"I3=2") == b"\x06"
    assert exchange(board, b"I4=0") == b"\x06"
    replies = [exchange(board, word) for word in (b"VERSION", b"TYPE", b"DATE")]
    assert all(re.fullmatch(rb"[^\r]+\r\x06", reply) for reply in replies)
    for line in (b"M261->D:$000108", b"M262->D:$00010B", b"I219=1000", b"I221=0", b"I220=10", b"I222=50"):
        assert exchange(board, line) == b"\x06"
    assert exchange(board, b"I222") == b"50\r\x06"
    assert exchange(board, b"#2J/") == b"\x06"
    assert exchange(board, b"#2J:1000") == b"\x06"
    (moving,) = re.fullmatch(rb"([0-9A-F]{12})\r\x06", exchange(board, b"#2?")).groups()  # type: ignore[union-attr]
    assert int(moving[:6], 16) >> 17 & 1, "the move timer"
    board.settle()
    assert exchange(board, b"#2P") == b"1000\r\x06"
    assert exchange(board, b"M262") == b"%d\r\x06" % (1000 * 96 * 32)
    assert board.ask(UP, 0xC5, length=1400) == b"\0"


def test_an_interface_that_writes_programs_and_memory_in_blocks(board: BoardWire) -> None:
    """Its FLUSH has to be answered by @, and its WRITEBUFFER by four bytes without 0x80 in the last."""
    assert board.ask(DOWN, 0xB3) == b"@"
    connected(board)
    assert board.ask(DOWN, 0xC6, b"OPEN PROG 5\0CLEAR\0X10\0CLOSE\0") == b"\0\0\0\0"
    assert board.response(b"LIST PROG 5") == b"X10\rRET\r\x06"
    assert board.ask(DOWN, 0xB5, b"\x01\x02", value=0x200) == b"@"
    assert board.ask(UP, 0xB4, value=0x200, length=2) == b"\x01\x02"


def test_a_client_that_reads_blocks_of_variables_and_strips_what_ends_them(board: BoardWire) -> None:
    """One recv of 2048 a command, no look at how it ends."""
    connected(board)
    assert board.response(b"&2 Q20=4 Q21=5") == b"\x06"
    assert board.response(b"&2 Q20").rstrip(b"\r\x06") == b"4"
    assert board.response(b"Q20,6,1").rstrip(b"\r\x06").split(b"\r") == [b"4", b"5", b"0", b"0", b"0", b"0"]
    assert board.response(b"M20,3,1").rstrip(b"\r\x06").split(b"\r") == [b"0"] * 3


def test_after_a_reset_a_client_has_to_flush_and_to_set_the_handshake_again(board: BoardWire) -> None:
    connected(board)
    assert board.response(b"$$$***") == b"\n"
    assert board.response(b"UUU").endswith(b"\x07\r")  # behind its checksum, where the family has I4 = 1
    assert board.ask(DOWN, 0xB3) == b"@"
    assert re.fullmatch(rb"\d+\.\d+\s*\r\x06", board.response(b"i6=1 i3=2 i4=0 ver"))
