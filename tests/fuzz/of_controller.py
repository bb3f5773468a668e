"""Targets at the controller: its replies, its Ethernet board, its language, the lines that the simulator obeys."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress

from drivers.errors import DriverError
from drivers.link.base import StopWay
from drivers.link.ethernet import BoardReplies, RequestPurpose
from drivers.pmac.client import PmacClient
from drivers.pmac.ethernet import Direction, MalformedRequestError, Request, RequestCode, take_request
from drivers.pmac.framing import FramingError, Reply, ReplyReader
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.parser import parse_line
from drivers.pmac.program_text import read_program
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_machine
from tests.fuzz.target import FoundError, Target, Try, pure

REPLIES = [
    b"\x06",
    b"25\r50\r\x06",
    b"\x07ERR003\r",
    b"\x02HELLO\r1\r\x06",
    b"25\r\n",
    b"\x07",
    b"12\r\x07ERR005\r\x06",
]
"""What controllers reply."""

PROGRAM = (
    "#define P P1\nOPEN PROG 1 CLEAR\nINC TA20 TS5 TM50\nWHILE(P1<40)\nP1=P1+SIN(3)*$FF\nX(100*P1)Y-5.5\n"
    "ENDWHILE\n"
    'IF(M26=0 AND P2!>3)DWELL20 ELSE GOTO77\nPVT20 X1:5\nCLOSE\nOPEN PLC 3 CLEAR\nCMD"#1J/"\nCLOSE\n'
)
ONLINE = (
    b"I3=2 I6=1\rP1..3\r#1J=500\r#1?\r&1??\r%\r???\rI100..110\r",
    b"OPEN PROG 1 CLEAR\rX100\rCLOSE\r&1B1R\r&1A\rLIST PROG1\r",
    b"M1->Y:$C000,8,16,S\rM1\rRHY:$720,16\rDEFINE GATHER 100\rGATHER\rENDG\rLIST GATHER\r",
    b"\x0e\x0b\x01\x18P1=1.5E3\r#2HM\r$$$\rSAVE\rTYPE VERSION DATE\rSIZE\r",
    b"#1LIST COMP DEF\r#1DEFINE COMP 8,#2,#1,4000\r1 2 3 4 5 6 7 8\rI51=1\r",
)


def _replies(pieces: list[bytes]) -> list[Reply | str]:
    reader, found = ReplyReader(), list[Reply | str]()
    for piece in pieces:
        reader.feed(piece)
        try:
            while (reply := reader.take()) is not None:
                found.append(reply)
        except FramingError as error:
            return [*found, error.kind]
    return found


def read_replies(data: bytes) -> None:
    """The same bytes are the same replies, however they are split; of a spoilt stream as far as it was sound."""
    whole, split = _replies([data]), _replies([data[place : place + 1] for place in range(len(data))])
    if whole != split:
        raise FoundError(f"{whole} in one piece, {split} byte by byte")


class _Said:
    """A link on which these bytes come, some at a time, and its clock; nothing waits in real time."""

    address, stop_way, checks_bytes = "fuzz", StopWay.DIRECT, False

    def __init__(self, data: bytes) -> None:
        self._left, self._now_s, self.sent = data, 0.0, b""

    def now_s(self) -> float:
        return self._now_s

    def wait(self, seconds: float) -> None:
        self._now_s += seconds

    def send(self, data: bytes) -> None:
        self.sent += data

    send_urgent = send

    def receive(self, timeout_s: float) -> bytes:
        size = 1 + self._left[0] % 16 if self._left else 0
        came, self._left = self._left[1 : 1 + size], self._left[1 + size :]
        self._now_s += 0.001 if came else max(timeout_s, 0.001)
        return came

    def close(self) -> None:
        return


def ask_client(data: bytes) -> None:
    """Whatever is answered, a line that writes is sent once."""
    link = _Said(data)
    client = PmacClient(link, link)
    with suppress(DriverError):
        client.connect()
    with suppress(DriverError):
        client.numbers("P1", "I10", again=True)
    sent = len(link.sent)
    with suppress(DriverError):
        client.send("#1J=77", moves=True)
        client.reply("#1J=77")
    if link.sent[sent:].count(b"J=77") > 1:
        raise FoundError("a line that moves was sent twice")


def board_request(data: bytes) -> None:
    """A request is found at the same place in any segmentation."""
    try:
        whole = take_request(data)
    except MalformedRequestError:
        return
    if whole[0] is not None and take_request(data[: whole[1]]) != whole:
        raise FoundError("not the same without what follows it")


def board_replies(data: bytes) -> None:
    replies, asked = BoardReplies(), list(RequestPurpose)
    for place, byte in enumerate(data[:64]):
        if byte & 0x80:
            replies.record_request(asked[byte % len(asked)])
        replies.take(data[place : place + byte % 32])
        _ = replies.complete, replies.wants_more


def parse(data: bytes) -> None:
    for line in data.decode("latin-1").splitlines():
        with suppress(PmacError):
            parse_line(line)


def read_text(data: bytes) -> None:
    program = read_program(data.decode("latin-1"), [])
    program.code(program.number)


AT_ONCE = 20
"""Inputs that one card gets, one after the other, as a host may send them."""


@contextmanager
def simulated() -> Iterator[Try]:
    """Lines at a simulated card. What it answers is a reply, and it goes on answering."""
    machine = load_machine("lee-2001-lathe").machine
    card = SimulatedLathe(machine)
    port, tried = card.connect(), 0

    def send(data: bytes) -> None:
        nonlocal card, port, tried
        tried += 1
        if tried % AT_ONCE == 0:
            card = SimulatedLathe(machine)
            port = card.connect()
        port.receive(data)
        card.wait(0.02)
        port.take_output()

    yield send


REQUESTS = [
    Request(direction=Direction.DOWNLOAD, code=RequestCode.GETRESPONSE, length=2, data=b"P1").encode(),
    Request(direction=Direction.UPLOAD, code=RequestCode.GETBUFFER, length=1400).encode(),
    Request(direction=Direction.DOWNLOAD, code=RequestCode.SENDCTRLCHAR, value=11).encode(),
]

OF_CONTROLLER = (
    Target(
        name="framing",
        what="replies on a serial line and over TCP",
        seeds=lambda: list(REPLIES),
        errors=(),
        opened=pure(read_replies),
    ),
    Target(
        name="client",
        what="a client and what it is answered",
        seeds=lambda: [b"".join(REPLIES) * 4],
        errors=(),
        opened=pure(ask_client),
    ),
    Target(
        name="board-requests",
        what="requests to the Ethernet board",
        seeds=lambda: REQUESTS,
        errors=(),
        opened=pure(board_request),
    ),
    Target(
        name="board-replies",
        what="replies of the Ethernet board",
        seeds=lambda: [bytes(range(256)), *REPLIES],
        errors=(),
        opened=pure(board_replies),
    ),
    Target(
        name="language", what="lines of programs", seeds=lambda: [PROGRAM.encode()], errors=(), opened=pure(parse)
    ),
    Target(
        name="program-text",
        what="whole program texts",
        seeds=lambda: [PROGRAM.encode()],
        errors=(PmacError,),
        opened=pure(read_text),
    ),
    Target(
        name="online",
        what="lines to the simulated controller",
        seeds=lambda: list(ONLINE),
        errors=(),
        opened=simulated,
    ),
)
