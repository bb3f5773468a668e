"""Ways in which a controller does not cooperate: what it does instead of its honest reply.

A way gets the line and the reply that a controller would give, and returns what happens on the wire: bytes, pauses
(seconds), and `End`s of the connection. It is the same for any command of any client.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import Enum, auto

ACK, CR = b"\x06", b"\r"
LATE_S = 6.0
"""Longer than a client waits for the first byte of any reply."""

ENDLESS = 1 << 40
BLOCK = 65_536
WAITS_S = 3600.0


class End(Enum):
    """How a connection ends."""

    CLOSED = auto()
    BROKEN = auto()


Step = bytes | float | End
Way = Callable[[str, bytes], Iterable[Step]]


def endless(block: bytes) -> Way:
    """Send one thing and never stop."""
    long = block * (BLOCK // len(block))

    def flood(line: str, reply: bytes) -> Iterator[Step]:
        for _ in range(ENDLESS):
            yield long

    return flood


def flipped(line: str, reply: bytes) -> Iterator[Step]:
    """One bit of each byte of data is wrong, and arrives as text."""
    yield bytes(byte ^ 0x01 if byte > 0x20 else byte for byte in reply)


def echoed(line: str, reply: bytes) -> Iterator[Step]:
    """A terminal server with its echo on."""
    yield line.encode("latin-1") + CR + reply


class Behind:
    """Each reply is that of the line before: a reply was lost in some buffer."""

    def __init__(self) -> None:
        self._kept = b""

    def __call__(self, line: str, reply: bytes) -> Iterator[Step]:
        self._kept, late = reply, self._kept
        yield late


class Yesterdays:
    """Each line is answered as it was the first time, whatever has been written since."""

    def __init__(self) -> None:
        self._kept: dict[int, bytes] = {}

    def __call__(self, line: str, reply: bytes) -> Iterator[Step]:
        yield self._kept.setdefault(len(line.split()), reply)


def freshly_started(line: str, reply: bytes) -> Iterator[Step]:
    """After power-up nothing is set: the handshake is another (I3=1), and every variable is 0."""
    data = b"".join(b"0" + CR + b"\n" for _ in range(reply.count(CR)))
    yield data or b"\n"


def silent(line: str, reply: bytes) -> Iterator[Step]:
    """Nothing comes, for ever."""
    yield WAITS_S


def say(*steps: Step) -> Way:
    """The same for every line."""
    return lambda line, reply: steps


def around(before: bytes, after: bytes = b"") -> Way:
    """The honest reply with something beside it."""
    return lambda line, reply: (before + reply + after,)


def dribbled(line: str, reply: bytes) -> Iterator[Step]:
    """Byte by byte, each so late that the whole never arrives in time."""
    for place in range(len(reply)):
        yield 0.3
        yield reply[place : place + 1]
    yield WAITS_S


@dataclass(frozen=True, kw_only=True)
class Kind:
    """One row of the table: a fresh way for each connection, and whether its replies may well be taken as true.

    `deceives`: what comes until the end of a reply is well formed, so that a single query cannot tell.
    """

    name: str
    way: Callable[[], Way]
    deceives: bool = False


def _kind(name: str, way: Way) -> Kind:
    return Kind(name=name, way=lambda: way)


WAYS = (
    _kind("silent", silent),
    _kind("slow: each reply comes when nobody waits for it any more", lambda line, reply: (LATE_S, reply)),
    _kind("slow: byte by byte", dribbled),
    _kind("partial: half of each reply, no ACK", lambda line, reply: (reply[: len(reply) // 2], WAITS_S)),
    _kind("partial: no ACK", lambda line, reply: (reply.removesuffix(ACK),)),
    Kind(name="garbled: a bit of each character", way=lambda: flipped, deceives=True),
    _kind("garbled: foreign bytes", say(bytes(range(0x80, 0x100)) + ACK)),
    _kind("garbled: NUL", say(b"\0")),
    _kind("garbled: LF in place of ACK", lambda line, reply: (reply.replace(ACK, b"\r\n"),)),
    _kind("garbled: echo", echoed),
    Kind(name="stale: one reply behind", way=Behind),
    Kind(name="stale: yesterday's replies", way=Yesterdays, deceives=True),
    _kind("resetting: closes", say(End.CLOSED)),
    _kind("resetting: breaks", say(End.BROKEN)),
    _kind("resetting: half a reply, then closes", lambda line, reply: (reply[:1], End.CLOSED)),
    _kind("resetting: freshly powered up", freshly_started),
    _kind("flooding: text without an end", endless(b"0123456789abcdef")),
    _kind("flooding: lines without an ACK", endless(b"0\r")),
    _kind("flooding: ACK", endless(ACK)),
    _kind("flooding: errors", endless(b"\x07ERR003\r")),
    _kind("flooding: messages", endless(b"\x02HELLO\r")),
    _kind("refusing: ERR003", say(b"\x07ERR003\r")),
    _kind("refusing: an unknown number", say(b"\x07ERR999\r")),
    _kind("refusing: a bare BELL", say(b"\x07")),
    _kind("unsolicited: a line before each reply", around(b"42\r")),
    Kind(name="unsolicited: a line after each reply", way=lambda: around(b"", b"42\r"), deceives=True),
    Kind(name="unsolicited: another controller's reply", way=lambda: around(b"", b"0\r" + ACK), deceives=True),
)
