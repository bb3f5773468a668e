"""Targets of sockets and terminals: feeds, the instructor's orders, SHDR clients, keys."""

from __future__ import annotations

import logging
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from textual.message import Message

from console.school.instructing.dispatcher import Dispatcher
from console.school.instructing.mailbox import Mailbox, Picture
from console.school.instructing.order import OrderReply, read_answer, read_order
from console.school.instructing.server import InstructorServer
from console.session.errors import SessionError
from console.session.feed.request import asked_hz
from console.site.exchange.adapter import PING, Adapter
from console.tui.driver import Reader
from drivers.simulator.hosts.control_address import UnixAddress
from tests.fuzz.target import FoundError, Target, Try, pure

TOKEN = "0123456789abcdef"
SENT_S = 2.0
KEYS = (
    b"\x1b[A\x1b[1;5C\x1b[97;5u\x1b[97;1:2u\x1b[?1u\x1b[200~pasted\x1b[201~\x1b[<0;3;4M\x1b[I\x1b[O",
    "한글\x1bOP\x1b[15~\x1b[24;80R\x1b[?2026;2$y\x1b]11;rgb:0/0/0\x07".encode(),
    b"\x1b[>0;136;0c\x1bOS\x1bOP\x1bO[\x1b[Q\x1bP>|tmux 3.4\x1b\\\x1b_Gi=1;OK\x1b\\\x1b[?1;2R",
    b"\x1b[1;2R\x1b[57442;5u \x1b",
)


class _Complaints(logging.Handler):
    """What asyncio says of a task that has ended with an error nobody waits for."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.said: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.said.append(self.format(record))


@contextmanager
def at_server(
    served: Callable[[], tuple[Callable[[], socket.socket], Callable[[], None]]], before: bytes
) -> Iterator[Try]:
    """A server that goes on serving whatever a client sends, and whenever it leaves."""
    connect, close = served()
    complaints = _Complaints()
    logger = logging.getLogger("asyncio")
    logger.addHandler(complaints)

    def attempt(data: bytes) -> None:
        with connect() as link:
            link.settimeout(SENT_S)
            with suppress(OSError):  # it may drop who sends nonsense at any time
                link.sendall(before + data)
                link.shutdown(socket.SHUT_WR)
                while link.recv(65_536):
                    pass
        if complaints.said:
            raise FoundError(complaints.said[0])

    try:
        yield attempt
        connect().close()
    finally:
        close()
        logger.removeHandler(complaints)


def _adapter() -> tuple[Callable[[], socket.socket], Callable[[], None]]:
    adapter = Adapter("127.0.0.1", 0, heartbeat_s=0.5, unread_s=0.5)
    host, _, port = adapter.start().rpartition(":")
    return lambda: socket.create_connection((host, int(port))), adapter.close


def _instructor() -> tuple[Callable[[], socket.socket], Callable[[], None]]:
    folder = TemporaryDirectory()
    address = UnixAddress(path=str(Path(folder.name, "socket")))
    mailbox = Mailbox()
    mailbox.picture = Picture(rows=("1",), number=1 << 60, at_s=0.0)  # nobody paints here
    dispatcher = Dispatcher(mailbox, _obeyed, lambda: 0.0)
    server = InstructorServer(address, TOKEN, dispatcher)
    server.start()

    def connect() -> socket.socket:
        link = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        link.connect(address.path)
        return link

    def close() -> None:
        server.close()
        folder.cleanup()

    return connect, close


def _obeyed(intent: object) -> bool:
    intent.answered(OrderReply())  # type: ignore[attr-defined]
    return True


def press(data: bytes) -> None:
    """Keys, as the screens read them: one character after the other."""
    reader = Reader()
    for place, character in enumerate(data.decode("utf-8", "replace")):
        for said in reader.read(character, 0.001 * place):
            if not isinstance(said, Message):
                raise FoundError(repr(said))
    reader.idle(10.0)


OF_SOCKETS = (
    Target(
        name="feed-requests",
        what="what a feed is asked",
        seeds=lambda: [b"rate 5.000\n", b"\n"],
        errors=(),
        opened=pure(asked_hz),
    ),
    Target(
        name="orders",
        what="orders of an instructor",
        seeds=lambda: [b"inject hang", b"speed x2", b'checkpoint "a"', b"return"],
        errors=(SessionError,),
        opened=pure(lambda data: read_order(data.decode("utf-8", "replace"))),
    ),
    Target(
        name="answers",
        what="answers to an instructor",
        seeds=lambda: [b'{"lines": ["a"], "problem": null, "age_s": 0.0}'],
        errors=(ValueError,),
        opened=pure(read_answer),
    ),
    Target(
        name="instructor-socket",
        what="clients of the instructor's server",
        seeds=lambda: [b"screen\nlog\nspeed 2\n"],
        errors=(),
        opened=partial(at_server, _instructor, f"stay {TOKEN}\n".encode()),
    ),
    Target(
        name="shdr-socket",
        what="clients of the SHDR adapter",
        seeds=lambda: [PING + b"\n", b"* PING\r\n"],
        errors=(),
        opened=partial(at_server, _adapter, b""),
    ),
    Target(name="keys", what="what a terminal sends", seeds=lambda: list(KEYS), errors=(), opened=pure(press)),
)
