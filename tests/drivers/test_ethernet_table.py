"""The list of requests of the Ethernet board: the codes, which way their data go, and the very reply of each."""

from __future__ import annotations

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from profiles.machine import MachineProfile
from tests.drivers.wire_board import DOWN, UP, BoardWire, wire_board

LOOK = bytes.fromhex("c0c2 0000 0000 0002")
FETCH = bytes.fromhex("c0c5 0000 0000 0578")
LINE = bytes.fromhex("c0b1 0000 0000 0578")


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def board(machine: MachineProfile, request: pytest.FixtureRequest) -> BoardWire:
    dialect: Dialect = request.param
    made = wire_board(machine, dialect)
    made.ask(DOWN, 0xBF, b"I3=2 I6=1 P1=25 P2=50")
    made.ask(DOWN, 0xB3)
    return made


ROWS: dict[str, list[tuple[bytes, bytes]]] = {
    "B0 SENDLINE adds the CR and says @": [
        (bytes.fromhex("40b0 0000 0000 0002") + b"P1", b"@"),
        (FETCH, b"25\r\x06"),
    ],
    "B1 GETLINE ends with CR ACK or LF": [
        (bytes.fromhex("40b0 0000 0000 0005") + b"P1..2", b"@"),
        *((LINE, piece) for piece in (b"25\r", b"50\r", b"\x06", b"\0")),
    ],
    "B3 FLUSH empties the queue and says @": [
        (bytes.fromhex("40b0 0000 0000 0002") + b"P1", b"@"),
        (bytes.fromhex("40b3 0000 0000 0000"), b"@"),
        (LOOK, b"\0\0"),
        (FETCH, b"\0"),
    ],
    "B3 FLUSH with 500 ms": [(bytes.fromhex("40b3 01f4 0000 0000"), b"@")],
    "B4 B5 memory by its offset": [
        (bytes.fromhex("40b5 0102 0000 0003") + b"abc", b"@"),
        (bytes.fromhex("c0b4 0102 0000 0003"), b"abc"),
        (bytes.fromhex("c0b4 0101 0000 0002"), b"\0a"),
    ],
    "B5 SETMEM as an upload": [
        (bytes.fromhex("c0b5 0000 0000 0001") + b"z", b"@"),
        (bytes.fromhex("c0b4 0000 0000 0001"), b"z"),
    ],
    "B4 GETMEM of 1400 bytes": [(bytes.fromhex("c0b4 0000 0000 0578"), bytes(1400))],
    "BA SETBIT ors with 1 and ands with 0": [
        (bytes.fromhex("40ba 0010 0001 0004 0500 0080"), b"@"),
        (bytes.fromhex("c0b4 0010 0000 0004"), bytes.fromhex("05000080")),
        (bytes.fromhex("40ba 0010 0000 0004 feff ffff"), b"@"),
        (bytes.fromhex("c0b4 0010 0000 0004"), bytes.fromhex("04000080")),
    ],
    "BB SETBITS sets four bytes and clears four": [
        (bytes.fromhex("40b5 0010 0000 0004 0f0f 0f0f"), b"@"),
        (bytes.fromhex("40bb 0010 0000 0008 f000 0000 0003 0000"), b"@"),
        (bytes.fromhex("c0b4 0010 0000 0004"), bytes.fromhex("ff0c0f0f")),
    ],
    "BE PORT one byte each way": [
        *((bytes([0x40, 0xBE, 0, 0, 0, byte, 0, 0]), b"@") for byte in b"P2\r"),
        *((bytes.fromhex("c0be 0000 0000 0001"), bytes([byte])) for byte in b"50\r\x06\0"),
    ],
    "BF GETRESPONSE up to ACK": [(bytes.fromhex("40bf 0000 0000 0005") + b"P1..2", b"25\r50\r\x06")],
    "BF GETRESPONSE of an error up to its CR": [
        (bytes.fromhex("40bf 0000 0000 0003") + b"UUU", b"\x07ERR003\r"),
        (FETCH, b"\0"),
    ],
    "BF GETRESPONSE of nothing": [(bytes.fromhex("40bf 0000 0000 0000"), b"\x06")],
    "C2 READREADY first byte": [
        (LOOK, b"\0\0"),
        (bytes.fromhex("40b0 0000 0000 0002") + b"P1", b"@"),
        (LOOK, b"\1\0"),
        (FETCH, b"25\r\x06"),
        (LOOK, b"\0\0"),
    ],
    "C5 GETBUFFER as much as is wanted": [
        (bytes.fromhex("40b0 0000 0000 0005") + b"P1..2", b"@"),
        (bytes.fromhex("c0c5 0000 0000 0004"), b"25\r5"),
        (bytes.fromhex("c0c5 0000 0000 0800"), b"0\r\x06"),
    ],
    "C5 GETBUFFER of an empty queue": [(FETCH, b"\0"), (bytes.fromhex("c0c5 0000 0000 0800"), b"\0")],
    "C6 C7 WRITEBUFFER and what came of it": [
        (bytes.fromhex("40c6 0000 0000 000a") + b"P1=3\0P2=4\0", b"\0\0\0\0"),
        (bytes.fromhex("c0c7 0000 0000 0004"), b"\0\0\0\0"),
        (bytes.fromhex("40bf 0000 0000 0005") + b"P1..2", b"3\r4\r\x06"),
        (bytes.fromhex("40c6 0000 0000 000b") + b"P1=5\0P1=\0X1", bytes([2, 0, 3, 0x80])),
        (bytes.fromhex("c0c7 0000 0000 0004"), bytes([2, 0, 3, 0x80])),
    ],
    "CB FWDOWNLOAD one byte": [(bytes.fromhex("40cb 0000 0000 0002 1234"), b"@")],
    "E0 IPADDRESS get and set": [
        (bytes.fromhex("c0e0 0000 0000 0004"), bytes((192, 6, 94, 5))),
        (bytes.fromhex("40e0 0000 0000 0004 0a00 0009"), bytes((10, 0, 0, 9))),
        (bytes.fromhex("c0e0 0000 0000 0004"), bytes((10, 0, 0, 9))),
    ],
}


@pytest.mark.parametrize("steps", ROWS.values(), ids=ROWS)
def test_a_request_has_its_reply(board: BoardWire, steps: list[tuple[bytes, bytes]]) -> None:
    for sent, reply in steps:
        assert board.raw(sent) == [reply], sent.hex(" ")


@pytest.mark.parametrize(
    ("character", "line"),
    [(2, "#{}?"), (3, "&{}??"), (6, "#{}F"), (7, "???"), (16, "#{}P"), (22, "#{}V")],
    ids=["^B", "^C", "^F", "^G", "^P", "^V"],
)
def test_c4_the_answer_to_a_control_character_has_no_acknowledgement(
    board: BoardWire, character: int, line: str
) -> None:
    systems = len(board.sim.controller.systems) if line[0] == "&" else 8
    asked = " ".join(dict.fromkeys(line.format(number) for number in range(1, systems + 1)))
    values = board.response(asked.encode()).removesuffix(b"\r\x06").split(b"\r")
    reply = board.ask(UP, 0xC4, value=character, length=1400)
    assert reply == b" ".join(values) + b"\r"
    assert board.raw(LOOK) == [b"\0\0"]


@pytest.mark.parametrize("character", [1, 4, 11, 15, 17, 18, 19])
def test_c4_a_control_character_without_an_answer_is_acted_on_and_answered_by_nul(
    board: BoardWire, character: int
) -> None:
    board.response(b"#1J/")
    assert board.ask(UP, 0xC4, value=character) == b"\0"
    assert board.sim.controller.motors[1].enabled is (character != 11)


@pytest.mark.parametrize(
    ("line", "data", "pieces"),
    [
        (b"P10..708", b"0\r" * 699, [1399]),
        (b"P1 P10..707", b"25\r" + b"0\r" * 698, [1400]),
        (b"P10..709", b"0\r" * 700, [1400, 1]),
        (b"P1 P10..708", b"25\r" + b"0\r" * 699, [1400, 2]),
        (b"P10..1009 P10..1009", b"0\r" * 2000, [1400, 1400, 1201]),
    ],
    ids=["1399", "1400", "1400 that end with CR, then ACK", "1402", "4001"],
)
def test_a_reply_has_1400_bytes_at_most_and_the_rest_comes_by_getbuffer(
    board: BoardWire, line: bytes, data: bytes, pieces: list[int]
) -> None:
    taken = [board.response(line)]
    while not taken[-1].endswith(b"\x06"):
        assert board.raw(LOOK) == [b"\1\0"]
        taken.append(board.fetched(2048))
    assert [len(piece) for piece in taken] == pieces
    assert b"".join(taken) == data + b"\x06"
    assert board.fetched() == b"\0"


def test_what_a_program_sends_ends_a_reply_at_its_cr(board: BoardWire) -> None:
    """With I64 there is an STX in front of it: the client gets it by itself, and its own reply whole."""
    board.response(b"#1J/ #2J/ #3J/ I64=1")
    for line in (b"OPEN PROG 1 CLEAR", b'SEND"Hello"', b"CLOSE", b"&1B1R"):
        assert board.response(line) == b"\x06"
    board.sim.wait(0.1)
    assert board.fetched() == b"\x02Hello\r"
    assert board.response(b"P1") == b"25\r\x06"


@pytest.mark.parametrize(
    ("i6", "reply"),
    [(0, b"\x07"), (1, b"\x07ERR003\r"), (2, b"\x07"), (3, b"\x07\r")],
    ids=lambda value: str(value),
)
def test_errors_come_as_the_card_words_them(board: BoardWire, i6: int, reply: bytes) -> None:
    """There is no error of the board's own; with I6 = 3 the text is fetched behind BELL CR."""
    board.response(b"I6=%d" % i6)
    assert board.response(b"UUU") == reply
    if i6 == 3:
        assert board.fetched() == b"ERR003\r"
    assert board.fetched() == b"\0"
