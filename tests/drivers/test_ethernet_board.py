"""The Ethernet board and its clients."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.ethernet import Direction, MalformedRequestError, Request, RequestCode
from drivers.simulator.hosts.ethernet import Board, EthernetSession
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.store import load_machine
from tests.drivers.wire_card import DOWN, UP, BoardWire, wire_board

CYCLE_S = 0.005
"""A little more than one background cycle of the bundled machine, 11 x 443 us."""

UPLOADS = {
    RequestCode.GETLINE,
    RequestCode.GETMEM,
    RequestCode.READREADY,
    RequestCode.CTRL_RESPONSE,
    RequestCode.GETBUFFER,
    RequestCode.WRITEERROR,
}


@dataclass(frozen=True, kw_only=True)
class Client:
    """One client of a board."""

    lathe: SimulatedLathe
    session: EthernetSession

    def send(self, data: bytes) -> list[bytes]:
        """Send bytes; return the replies, each as it is sent. Time passes only where the card wants it to."""
        self.session.receive(data)
        replies = self.session.turn()
        while self.session.busy or not self.session._port.idle:
            if not self.session.busy:
                self.lathe.wait(CYCLE_S)
            replies += self.session.turn()
        return replies

    def ask(
        self,
        code: RequestCode,
        data: bytes = b"",
        *,
        value: int = 0,
        index: int = 0,
        length: int | None = None,
        direction: Direction | None = None,
    ) -> bytes:
        """Send one request and return its one reply."""
        way = direction or (Direction.UPLOAD if code in UPLOADS else Direction.DOWNLOAD)
        size = len(data) if length is None else length
        request = Request(direction=way, code=code, value=value, index=index, length=size, data=data)
        (reply,) = self.send(request.encode())
        return reply

    def response(self, line: bytes) -> bytes:
        return self.ask(RequestCode.GETRESPONSE, line)

    def fetched(self) -> bytes:
        return self.ask(RequestCode.GETBUFFER)


Connect = Callable[[], Client]


@pytest.fixture
def connect(machine: MachineProfile) -> Connect:
    """Clients of one board, in the handshake that clients use."""
    lathe, board = SimulatedLathe(machine), Board()

    def one_more() -> Client:
        client = Client(lathe=lathe, session=EthernetSession(lathe, lathe.connect(), board))
        assert client.response(b"I6=1 I3=2") == b"\x06"
        return client

    return one_more


@pytest.fixture
def client(connect: Connect) -> Client:
    return connect()


def test_what_sendline_brings_is_fetched_later_and_in_order(client: Client) -> None:
    assert client.ask(RequestCode.SENDLINE, b"P1=7 P1") == b"@"
    assert client.ask(RequestCode.SENDLINE, b"UUU") == b"@"
    assert client.ask(RequestCode.SENDLINE, b"P2..3") == b"@"
    assert client.ask(RequestCode.READREADY, length=2)[0] != 0
    assert client.fetched() == b"7\r\x06"
    assert client.fetched() == b"\x07ERR003\r"
    assert [client.ask(RequestCode.GETLINE) for _ in range(4)] == [b"0\r", b"0\r", b"\x06", b"\0"]


def test_what_nobody_fetched_comes_before_the_response_to_the_next_line(client: Client) -> None:
    client.ask(RequestCode.SENDLINE, b"P1=7 P1")
    assert client.response(b"P1=8 P1") == b"7\r\x06"
    assert client.fetched() == b"8\r\x06"


@pytest.mark.parametrize(
    ("handshake", "good", "silent", "bad"),
    [
        (b"I3=0 I6=1", [b"1\r2\r"], [b"\0"], [b"\x07ERR003\r"]),
        (b"I3=0 I6=0", [b"1\r2\r"], [b"\0"], [b"\x07"]),
        (b"I3=1 I6=1", [b"\n", b"1\r\n", b"2\r\n"], [b"\n"], [b"\x07\nERR003\r"]),
        (b"I3=2 I6=1", [b"1\r2\r\x06"], [b"\x06"], [b"\x07ERR003\r"]),
        (b"I3=2 I6=3", [b"1\r2\r\x06"], [b"\x06"], [b"\x07\r", b"ERR003\r"]),
        (b"I3=2 I6=2", [b"1\r2\r\x06"], [b"\x06"], [b"\x07"]),
        (b"I3=3 I6=1", [b"\n", b"1\r\n", b"2\r\x06"], [b"\x06"], [b"\x07\nERR003\r"]),
    ],
)
def test_in_other_handshakes_the_board_ends_a_reply_at_the_same_characters(
    client: Client, handshake: bytes, good: list[bytes], silent: list[bytes], bad: list[bytes]
) -> None:
    client.response(handshake)
    client.ask(RequestCode.FLUSH)
    for line, replies in ((b"P1=1 P2=2 P1..2", good), (b"P3=1", silent), (b"UUU", bad)):
        assert [client.response(line), *(client.fetched() for _ in replies[1:])] == replies
        assert client.fetched() == b"\0"


@pytest.mark.parametrize("code", [RequestCode.CTRL_RESPONSE, RequestCode.SENDCTRLCHAR])
@pytest.mark.parametrize("on_the_wire", [0x000B, 0x0B00])
def test_a_control_k_kills_and_answers_one_byte(client: Client, code: RequestCode, on_the_wire: int) -> None:
    client.response(b"#1J/")
    assert client.lathe.controller.motors[1].enabled
    assert len(client.ask(code, value=on_the_wire, length=1)) == 1
    assert not client.lathe.controller.motors[1].enabled


def test_lines_of_a_write_buffer_are_typed_and_answered_as_one(client: Client) -> None:
    lines = b"OPEN PROG 1\0CLEAR\0X10\0X20\0CLOSE\0P5=42\0"
    assert client.ask(RequestCode.WRITEBUFFER, lines) == b"\0\0\0\0"
    assert client.fetched() == b"\0"
    assert client.response(b"LIST PROG 1") == b"X10\rX20\rRET\r\x06"
    assert client.ask(RequestCode.WRITEBUFFER, lines[:-1]) == b"\0\0\0\0"
    assert client.response(b"P5") == b"42\r\x06"
    # A hundred lines are more than are executed in one cycle, and the last but one of them is wrong.
    data = b"P1\r" * 98 + b"\rUUU\r"
    line = Request(direction=Direction.DOWNLOAD, code=RequestCode.SENDLINE, length=len(data), data=data)
    buffer = Request(direction=Direction.DOWNLOAD, code=RequestCode.WRITEBUFFER, length=11, data=b"P2=1\0P2\0P3\0")
    assert client.send(line.encode() + buffer.encode()) == [b"@", b"\0\0\0\0"]
    fetched = [client.fetched() for _ in range(102)]
    assert fetched == [b"0\r\x06"] * 98 + [b"\x06", b"\x07ERR003\r", b"\x06", b"\0"]


@pytest.mark.parametrize(
    ("handshake", "error_number"),
    [(b"I3=2 I6=1", 5), (b"I3=2 I6=3", 5), (b"I3=1 I6=1", 5), (b"I3=0 I6=3", 5), (b"I3=2 I6=0", 0)],
)
def test_a_write_buffer_ends_at_its_first_error(client: Client, handshake: bytes, error_number: int) -> None:
    client.response(handshake)
    client.ask(RequestCode.FLUSH)
    reply = client.ask(RequestCode.WRITEBUFFER, b"P1=1\0\0X10\0P1=2\0")
    assert reply == bytes([3, 0, error_number, 0x80])
    assert client.ask(RequestCode.WRITEERROR, length=4) == reply
    assert client.fetched() == b"\0"
    client.response(b"I3=2 I6=1")
    client.ask(RequestCode.FLUSH)
    assert client.response(b"P1") == b"1\r\x06"
    client.ask(RequestCode.WRITEBUFFER, b"P1=3\0")
    assert client.ask(RequestCode.WRITEERROR) == b"\0\0\0\0"


def test_a_line_number_above_255_takes_both_bytes(client: Client) -> None:
    assert client.ask(RequestCode.WRITEBUFFER, b"\0" * 300 + b"UUU\0") == b"\x2d\x01\x03\x80"


def test_all_clients_see_one_memory_and_each_bit_can_be_changed_alone(connect: Connect) -> None:
    one, other = connect(), connect()
    assert one.ask(RequestCode.SETMEM, b"\x0f\0\xf0\xff", value=100) == b"@"
    assert other.ask(RequestCode.SETMEM, b"z", value=65_535, direction=Direction.UPLOAD) == b"@"
    assert other.ask(RequestCode.GETMEM, value=99, length=6) == b"\0\x0f\0\xf0\xff\0"
    assert one.ask(RequestCode.GETMEM, value=65_535, length=1) == b"z"
    assert one.ask(RequestCode.SETBIT, b"\0\x01\0\0", value=100, index=1) == b"@"
    assert one.ask(RequestCode.SETBIT, b"\xfe\xff\xff\xff", value=100, index=0) == b"@"
    assert one.ask(RequestCode.GETMEM, value=100, length=4) == b"\x0e\x01\xf0\xff"
    assert one.ask(RequestCode.SETBITS, b"\x01\0\0\0" + b"\x0e\0\0\xff", value=100) == b"@"
    assert one.ask(RequestCode.GETMEM, value=100, length=4) == b"\x01\x01\xf0\0"
    assert one.ask(RequestCode.SETBITS, b"\xff\0\0\0" + b"\x0f\0\0\0", value=100) == b"@"
    assert one.ask(RequestCode.GETMEM, value=100, length=1) == b"\xf0"


def test_each_client_has_its_own_addressing_and_its_own_queue(connect: Connect) -> None:
    one, other = connect(), connect()
    one.ask(RequestCode.SENDLINE, b"#2 P1=1 P1")
    other.ask(RequestCode.SENDLINE, b"#3 P2=2 P2")
    assert (one.fetched(), other.fetched()) == (b"1\r\x06", b"2\r\x06")
    assert (one.response(b"#"), other.response(b"#")) == (b"2\r\x06", b"3\r\x06")


def test_a_control_x_of_one_client_leaves_the_queue_of_the_other(connect: Connect) -> None:
    one, other = connect(), connect()
    other.ask(RequestCode.SENDLINE, b"P1")
    one.ask(RequestCode.FLUSH)
    assert other.fetched() == b"0\r\x06"


def test_requests_in_one_segment_are_answered_in_order_one_reply_each(client: Client) -> None:
    lines = [b"P1=%d P1" % number for number in range(50)]
    requests = [
        Request(direction=Direction.DOWNLOAD, code=RequestCode.GETRESPONSE, length=len(line), data=line)
        for line in lines
    ]
    replies = client.send(b"".join(request.encode() for request in requests))
    assert replies == [b"%d\r\x06" % number for number in range(50)]


def test_what_came_before_garbage_is_answered_and_then_it_is_told(client: Client) -> None:
    client.session.receive(bytes.fromhex("40bf000000000002") + b"P1" + b"garbage")
    assert client.session.turn() == [b"0\r\x06"]
    assert client.session.busy
    for _ in range(2):
        with pytest.raises(MalformedRequestError):
            client.session.turn()


def test_a_client_that_never_fetches_costs_little_memory(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """An answer of 2003 bytes is still kept whole when it is the one that goes beyond the limit."""
    monkeypatch.setattr("drivers.simulator.hosts.ethernet.UNREAD_LIMIT", 10_000)
    kept = b""
    for _ in range(30):
        client.ask(RequestCode.SENDLINE, b"P0..1000")
    while (piece := client.fetched()) != b"\0":
        kept += piece
    assert kept == (b"0\r" * 1001 + b"\x06") * 5
    assert client.response(b"P1") == b"0\r\x06"


SIZES = {RequestCode.SETBIT: 4, RequestCode.SETBITS: 8, RequestCode.IPADDRESS: 4}


@st.composite
def well_formed(draw: st.DrawFn) -> bytes:
    """A request that the board takes, with anything at all in it."""
    code = draw(st.sampled_from(RequestCode))
    if code in UPLOADS:
        request = Request(
            direction=Direction.UPLOAD,
            code=code,
            value=draw(st.integers(0, 0x1F)),
            length=draw(st.integers(1, 1400)),
        )
        return request.encode()
    size = SIZES.get(code)
    data = draw(st.binary(min_size=size or 1, max_size=size or 60))
    bare = code in (RequestCode.FLUSH, RequestCode.PORT, RequestCode.SENDCTRLCHAR)
    request = Request(
        direction=Direction.DOWNLOAD,
        code=code,
        value=draw(st.integers(0, 0x1F)),
        index=draw(st.integers(0, 0xFFFF)),
        length=len(data),
        data=b"" if bare else data,
    )
    return request.encode()


@given(st.lists(well_formed(), max_size=8), st.binary(max_size=20))
def test_each_request_has_one_reply_and_garbage_only_closes(sent: list[bytes], garbage: bytes) -> None:
    lathe = SimulatedLathe(load_machine("lee-2001-lathe").machine)
    client = Client(lathe=lathe, session=EthernetSession(lathe, lathe.connect(), Board()))
    replies = client.send(b"".join(sent))
    assert len(replies) == len(sent)
    assert all(1 <= len(reply) <= 1400 for reply in replies)
    lathe.wait(0.01)
    with suppress(MalformedRequestError):
        client.send(garbage)
    lathe.wait(0.01)


# Programs of others at the Ethernet board, byte by byte: what they send, and what they wait for.


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def board(machine: MachineProfile, request: pytest.FixtureRequest) -> BoardWire:
    """As the factory leaves it: I3 = 1, I6 = 3."""
    dialect: Dialect = request.param
    return wire_board(machine, dialect)


def connected(board: BoardWire) -> BoardWire:
    assert board.response(b"i6=1 i3=2 ver").endswith(b"\x06")
    return board


def test_libraries_take_a_version_one_ack_and_lines_of_255_characters(board: BoardWire) -> None:
    """Two assignments without a word, the data of `ver`, and one acknowledgement at the end."""
    (reply,) = board.raw(bytes.fromhex("40bf00000000000d") + b"i6=1 i3=2 ver")
    assert re.fullmatch(rb"\d+\.\d+\s*\r\x06", reply)
    # Each reply is one piece, and the next command gets its own; also behind an error.
    connected(board)
    for number in range(50):
        assert board.raw(bytes.fromhex("40bf000000000008") + b"P1=%02d P1" % number) == [b"%d\r\x06" % number]
        assert board.raw(bytes.fromhex("40bf000000000003") + b"UUU") == [b"\x07ERR003\r"]
    # It packs the length into one byte; the high one is always 0.
    connected(board)
    line = b"P1=1".ljust(251) + b"P2=2"
    assert board.raw(bytes.fromhex("40bf0000000000ff") + line) == [b"\x06"]
    assert board.response(b"P1..2") == b"1\r2\r\x06"


def test_a_library_that_saves_gets_a_nul_in_the_time_that_it_doubles_for_it(board: BoardWire) -> None:
    """It waits 6 s for this line, and its next command gets its own answer."""
    connected(board)
    began_s = board.sim.now_s()
    assert board.raw(bytes.fromhex("40bf000000000004") + b"SAVE") == [b"\x00"]
    assert 3.0 < board.sim.now_s() - began_s < 6.0
    assert board.raw(bytes.fromhex("40bf000000000003") + b"P99") == [b"0\r\x06"]


def test_a_port_driver_flushes_polls_and_asks_by_control_characters(board: BoardWire) -> None:
    """On a silence it would look with READREADY and fetch with GETBUFFER: nothing is left there."""
    connected(board)
    assert board.raw(bytes.fromhex("40b3000000000000")) == [b"@"]
    assert board.raw(bytes.fromhex("40bf000000000000")) == [b"\x06"]
    items = [item for n in range(1, 9) for item in (f"#{n}?", f"#{n}P", f"#{n}F", f"M{n}31", f"P{n}00")]
    reply = board.response(" ".join(items).encode())
    assert len(reply.removesuffix(b"\r\x06").split(b"\r")) == len(items) == 40
    assert board.raw(bytes.fromhex("c0c2000000000002")) == [b"\0\0"]
    assert board.raw(bytes.fromhex("c0c5000000000578")) == [b"\0"]
    # It can only end such a reply by its own time-out, and asks the board once more before.
    connected(board)
    (reply,) = board.raw(bytes.fromhex("c0c4000200000578"))
    assert b"\x06" not in reply
    assert reply.count(b" ") == 7
    assert board.raw(bytes.fromhex("c0c2000000000002")) == [b"\0\0"]


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


def test_after_a_reset_a_client_has_to_flush_and_to_set_the_handshake_again(board: BoardWire) -> None:
    connected(board)
    assert board.response(b"$$$***") == b"\n"
    assert board.response(b"UUU").endswith(b"\x07\r")  # behind its checksum, where the family has I4 = 1
    assert board.ask(DOWN, 0xB3) == b"@"
    assert re.fullmatch(rb"\d+\.\d+\s*\r\x06", board.response(b"i6=1 i3=2 i4=0 ver"))
