"""Requests of Ethernet clients, byte by byte, and what faults of the line make of the replies."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.ethernet import (
    Direction,
    MalformedRequestError,
    Request,
    RequestCode,
    buffer_length,
    line_length,
    take_request,
    write_reply,
)
from drivers.simulator.hosts.connection import HostConnection, PlainStream
from drivers.simulator.hosts.ethernet import Board, EthernetSession
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from tests.drivers.test_connections import GETRESPONSE, Hall, Network, pass_time
from tests.drivers.wire_card import CYCLE_S, DOWN, UP, BoardWire, wire_board

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
def test_c4_an_answer_to_a_control_character_has_no_ack(board: BoardWire, character: int, line: str) -> None:
    systems = len(board.sim.controller.systems) if line[0] == "&" else 8
    asked = " ".join(dict.fromkeys(line.format(number) for number in range(1, systems + 1)))
    values = board.response(asked.encode()).removesuffix(b"\r\x06").split(b"\r")
    reply = board.ask(UP, 0xC4, value=character, length=1400)
    assert reply == b" ".join(values) + b"\r"
    assert board.raw(LOOK) == [b"\0\0"]


@pytest.mark.parametrize("character", [1, 4, 11, 15, 17, 18, 19])
def test_c4_a_control_character_without_an_answer_is_answered_by_nul(board: BoardWire, character: int) -> None:
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
def test_a_reply_has_1400_bytes_at_most(board: BoardWire, line: bytes, data: bytes, pieces: list[int]) -> None:
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


# Faults as a client of the Ethernet board meets them: its replies are frames, and the empty queue is a NUL.


@pytest.fixture
def faulty_board(machine: MachineProfile) -> BoardWire:
    made = wire_board(machine)
    assert made.response(b"I6=1 I3=2 P1=25 P2=50") == b"\x06"
    return made


@pytest.mark.parametrize(
    ("fault", "reply"),
    [("dropped-ack", b"25\r50\r"), ("extra-line", b"\r25\r50\r\x06"), ("nul", b"\0"), ("bare-bel", b"\x07")],
)
def test_a_spoiled_reply_byte_by_byte(faulty_board: BoardWire, fault: str, reply: bytes) -> None:
    faulty_board.sim.faults.inject(fault, replies=1)
    assert faulty_board.response(b"P1P2") == reply
    assert faulty_board.response(b"P1P2") == b"25\r50\r\x06"


def test_a_reply_leaves_in_pieces(faulty_board: BoardWire) -> None:
    faulty_board.sim.faults.inject("split-segments", gap_ms=20)
    replies = faulty_board.raw(GETRESPONSE[:-1] + b"\x04P1P2")
    assert replies == [b"25\r"]
    faulty_board.sim.wait(0.021)
    faulty_board.sim.wait(CYCLE_S)
    assert faulty_board.session.turn() == [b"50\r\x06"]


def test_a_late_reply_is_no_empty_queue(faulty_board: BoardWire) -> None:
    """A board that has nothing to say answers a NUL; one whose reply is late says nothing yet."""
    faulty_board.sim.faults.inject("late-reply", delay_ms=300)
    before_s = faulty_board.sim.now_s()
    assert faulty_board.response(b"P1") == b"25\r\x06"
    assert 0.3 <= faulty_board.sim.now_s() - before_s < 0.32


def test_a_hanging_card_has_a_silent_board_and_reads_afterwards(faulty_board: BoardWire) -> None:
    faulty_board.sim.faults.inject("hang", for_s=0.2)
    faulty_board.session.receive(GETRESPONSE + b"P1")
    for _ in range(30):
        faulty_board.sim.wait(CYCLE_S)
        assert faulty_board.session.turn() == []
        assert not faulty_board.session.busy
    faulty_board.sim.wait(0.1)
    assert faulty_board.raw(b"") == [b"25\r\x06"]


def test_a_slow_line_takes_a_millisecond_a_character(faulty_board: BoardWire) -> None:
    faulty_board.sim.faults.inject("9600-baud")
    before_s = faulty_board.sim.now_s()
    faulty_board.session.receive(GETRESPONSE + b"P1")
    said = b""
    while not said.endswith(b"\x06"):
        faulty_board.sim.wait(CYCLE_S)
        said += b"".join(faulty_board.session.turn())
    assert said == b"25\r\x06"
    # Ten characters there and four back.
    assert faulty_board.sim.now_s() - before_s == pytest.approx(14 / 960, abs=3 * CYCLE_S)


@pytest.mark.parametrize(
    "discipline", [PlainStream, partial(EthernetSession, board=Board())], ids=["plain", "board"]
)
def test_a_cut_cable_resets_the_connection_and_every_new_one_until_it_is_mended(
    machine: MachineProfile, discipline: Callable[..., PlainStream]
) -> None:
    async def scene() -> None:
        hall = Hall(SimulatedLathe(machine))
        network, late, mended = Network(), Network(), Network()
        hall.enter(discipline, network)
        hall.lathe.faults.inject("cut-cable", for_s=0.1)
        await pass_time(hall, 1)
        assert (network.ended, len(hall.hosts)) == ("aborted", 0)
        hall.enter(discipline, late)
        assert late.ended == "aborted"
        await pass_time(hall, 21)
        assert isinstance(hall.enter(discipline, mended), HostConnection)
        assert mended.ended == ""
        assert hall.lathe.faults.active() == ()

    asyncio.run(scene())


def test_a_power_cycle_resets_the_connections_of_a_board_and_leaves_a_serial_line(machine: MachineProfile) -> None:
    async def scene() -> None:
        hall = Hall(SimulatedLathe(machine))
        serial, faulty_board = Network(), Network()
        host = hall.plain(serial)
        hall.ethernet(faulty_board)
        hall.lathe.power_cycle()
        await pass_time(hall, 1)
        assert (serial.ended, faulty_board.ended) == ("", "aborted")
        host.data_received(b"I3=2\r")
        assert serial.sent == [b"\x06"]

    asyncio.run(scene())


# The wire format of the Ethernet board, with bytes as clients send them.

REQUEST_DOWN, REQUEST_UP = Direction.DOWNLOAD, Direction.UPLOAD


def cut(chunks: list[bytes]) -> list[Request]:
    """The requests in a stream that comes in these segments; complete ones are taken at once."""
    waiting, found = bytearray(), []
    for chunk in chunks:
        waiting += chunk
        while True:
            request, used = take_request(waiting)
            if request is None:
                assert used == 0
                break
            found.append(request)
            del waiting[:used]
    assert not waiting
    return found


@pytest.mark.parametrize(
    ("sent", "request_"),
    [
        (
            bytes.fromhex("40bf00000000000d") + b"i6=1 i3=2 ver",
            Request(direction=REQUEST_DOWN, code=RequestCode.GETRESPONSE, length=13, data=b"i6=1 i3=2 ver"),
        ),
        (
            bytes.fromhex("c0c5000000000800"),
            Request(direction=REQUEST_UP, code=RequestCode.GETBUFFER, length=2048),
        ),
        (bytes.fromhex("40b301f400000000"), Request(direction=REQUEST_DOWN, code=RequestCode.FLUSH, value=500)),
        (bytes.fromhex("c0c2000000000002"), Request(direction=REQUEST_UP, code=RequestCode.READREADY, length=2)),
        (
            bytes.fromhex("40ba040200010004") + b"\x10\0\0\0",
            Request(
                direction=REQUEST_DOWN, code=RequestCode.SETBIT, value=0x402, index=1, length=4, data=b"\x10\0\0\0"
            ),
        ),
        (
            bytes.fromhex("c0b5000800000003") + b"abc",
            Request(direction=REQUEST_UP, code=RequestCode.SETMEM, value=8, length=3, data=b"abc"),
        ),
        (bytes.fromhex("c0e0000000000004"), Request(direction=REQUEST_UP, code=RequestCode.IPADDRESS, length=4)),
        (
            bytes.fromhex("40be0007004a0000"),
            Request(direction=REQUEST_DOWN, code=RequestCode.PORT, value=7, index=0x4A),
        ),
    ],
)
def test_requests_of_clients_are_read_as_they_mean_them(sent: bytes, request_: Request) -> None:
    assert take_request(sent) == (request_, len(sent))
    assert request_.encode() == sent


def test_an_upload_carries_no_data_whatever_its_length_field_says() -> None:
    """Clients leave the field unset when they fetch: the next request follows at once."""
    sent = bytes.fromhex("c0b10000 00009999") + bytes.fromhex("c0c50000 0000ffff")
    assert [request.code for request in cut([sent])] == [RequestCode.GETLINE, RequestCode.GETBUFFER]


@pytest.mark.parametrize(
    ("length", "target"), [(0, 1400), (1, 1), (1399, 1399), (1400, 1400), (2048, 1400), (65_535, 1400)]
)
def test_a_reply_has_1400_bytes_unless_the_client_wants_fewer(length: int, target: int) -> None:
    assert Request(direction=REQUEST_UP, code=RequestCode.GETBUFFER, length=length).reply_length == target


@pytest.mark.parametrize("on_the_wire", ["0002", "0200"])
def test_a_control_character_may_stand_in_either_byte(on_the_wire: str) -> None:
    request, _ = take_request(bytes.fromhex(f"c0c4{on_the_wire}00000000"))
    assert request is not None
    assert request.control_character == 2


@pytest.mark.parametrize(
    "sent",
    [
        "00",
        "80b0",
        "c0b0",  # a line goes to the board
        "40c5",  # and a buffer comes from it
        "40aa",
        "4000",
        "40bf0000000005d5",  # 1493 bytes
        "40c6000000000401",  # 1025 bytes of lines
        "c0b4000000000579",  # 1401 bytes of memory
        "c0b4000000000000",  # and none
        "40b5000000000579",
        "c0b4ffff00000002",  # beyond the end of the memory
        "40bafffd00010004",
        "40ba000000010003",
        "40bb000000000004",
        "40e0000000000005",
        "c0c4004100000000",  # A is no control character
        "c0c4010200000000",
    ],
)
def test_what_is_no_request_is_told_as_soon_as_it_is_seen(sent: str) -> None:
    with pytest.raises(MalformedRequestError):
        take_request(bytes.fromhex(sent))


CARRYING = {
    RequestCode.SENDLINE: 1492,
    RequestCode.GETRESPONSE: 1492,
    RequestCode.WRITEBUFFER: 1024,
    RequestCode.FWDOWNLOAD: 1492,
}
BARE = (RequestCode.GETLINE, RequestCode.GETBUFFER, RequestCode.READREADY, RequestCode.WRITEERROR)
words = st.integers(0, 0xFFFF)


@st.composite
def requests(draw: st.DrawFn) -> Request:
    code = draw(st.sampled_from([*CARRYING, *BARE, RequestCode.SETMEM]))
    value, index = draw(words), draw(words)
    if code in BARE:
        return Request(direction=REQUEST_UP, code=code, value=value, index=index, length=draw(words))
    data = draw(st.binary(min_size=code == RequestCode.SETMEM, max_size=CARRYING.get(code, 1400)))
    place = min(value, 65_536 - len(data)) if code == RequestCode.SETMEM else value
    return Request(direction=REQUEST_DOWN, code=code, value=place, index=index, length=len(data), data=data)


@given(st.lists(requests(), max_size=6), st.data())
def test_any_segmentation_gives_the_same_requests(sent: list[Request], data: st.DataObject) -> None:
    stream = b"".join(request.encode() for request in sent)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=12)))
    edges = [0, *cuts, len(stream)]
    assert cut([stream[a:b] for a, b in pairwise(edges)]) == sent


@given(st.lists(requests(), max_size=2))
def test_a_stream_that_comes_byte_by_byte_gives_the_same_requests(sent: list[Request]) -> None:
    stream = b"".join(request.encode() for request in sent)
    assert cut([bytes([byte]) for byte in stream]) == sent


@given(
    st.one_of(st.binary(max_size=60), st.binary(max_size=60).map(lambda tail: b"\x40\xbf\0\0\0\0\0\x02" + tail))
)
def test_garbage_is_refused_or_is_a_request_and_raises_nothing_else(garbage: bytes) -> None:
    waiting = bytearray(garbage)
    try:
        while waiting:
            request, used = take_request(waiting)
            if request is None:
                return
            assert request.encode() == bytes(waiting[:used])
            del waiting[:used]
    except MalformedRequestError:
        return


@pytest.mark.parametrize(
    ("waiting", "length"),
    [
        (b"", 0),
        (b"\x06", 1),
        (b"25\r50\r\x06P", 7),
        (b"25\r50\r", 0),
        (b"\x07ERR003\r\x06", 8),
        (b"1\r\x07ERR003\r5\r\x06", 10),
        (b"\x07ERR00", 0),
        (b"\x07\rERR003\r", 2),
        (b"\x07\nERR003\r", 9),
        (b"\x02data\r\x06", 6),
        (b"\n25\r\n", 1),
        (b"25\r\n", 4),
        (b"0\r" * 700, 1400),
        (b"0\r" * 699 + b"0\x06", 1400),
        (b"0\r" * 699 + b"00\x06", 1400),
    ],
)
def test_a_reply_ends_with_ack_or_lf_and_an_error_with_its_cr(waiting: bytes, length: int) -> None:
    assert buffer_length(waiting, 1400) == length


def test_fewer_bytes_than_the_reply_has_are_taken_from_its_beginning() -> None:
    assert buffer_length(b"123\r\x06", 3) == 3
    assert buffer_length(b"12", 3) == 0


@pytest.mark.parametrize(
    ("waiting", "length"), [(b"25\r50\r\x06", 3), (b"\x06", 1), (b"\n25\r", 1), (b"25", 0), (b"", 0)]
)
def test_a_line_ends_with_cr_ack_or_lf(waiting: bytes, length: int) -> None:
    assert line_length(waiting, 1400) == length


def test_the_result_of_a_write_has_the_line_with_its_low_byte_first_and_0x80_last() -> None:
    """Clients look for 0x80 in the last byte, for the ERR number before it, and read the first two as a number."""
    assert write_reply() == b"\0\0\0\0"
    assert write_reply(0x0102, 3) == b"\x02\x01\x03\x80"
