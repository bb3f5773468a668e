"""A controller that does not cooperate, at a real socket or pseudo-terminal."""

from __future__ import annotations

import math
import os
import re
import select
import socket
import struct
import threading
import tty
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from enum import Enum, auto
from functools import partial
from queue import Empty, SimpleQueue

from profiles.machine import MachineProfile

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


# What a controller would answer, as far as a client gets before it is refused: variables, reports, no listings.
#
# It knows no motion: it is the honest half of a controller that does not cooperate, and no simulator.

VERSION, TYPE = "1.17F", "PMAC1"
_WORD = re.compile(
    r"""
      (?P<name>[IPQM]\d+)\s*(?:->\s*(?P<place>[^\s#&]*)|(?:\.\.(?P<last>\d+)|,(?P<count>\d+),\d+)?
        (?:\s*=\s*(?P<value>[^\s#&]+))?)
    | (?P<axis>\#\d+->)(?P<axis_place>[^\s#&]*)
    | (?P<listing>LIST\s*[A-Z]+\s*\d*)
    | (?P<report>VERSION|VER|TYPE|DATE|CID|CPU|SIZE|\?{1,3}|%|[PVF](?![\dA-Z]))
    | RH?Y:\$[\dA-F]+,(?P<words>\d+)
    | (?P<buffer>OPEN|CLOSE)
    | .
    """,
    re.VERBOSE | re.IGNORECASE,
)
_REPORTS = {
    "VERSION": VERSION,
    "VER": VERSION,
    "TYPE": TYPE,
    "DATE": "01/01/01",
    "CID": "602413",
    "CPU": "DSP56303",
    "%": "100",
}


class PlausibleCard:
    """Answers lines; `variables` are its settings by name, whatever is not there is 0; `axes` as `#1->X`."""

    def __init__(self, variables: Mapping[str, float], axes: Iterable[str]) -> None:
        self._values = {name.upper(): f"{value:.12g}" for name, value in variables.items()}
        self._places = {f"{motor}->": place for motor, place in (each.split("->") for each in axes)}
        self._open = False

    def reply(self, line: str) -> bytes:
        """Answer one line, with I3=2 and I6=1."""
        data: list[str] = []
        for word in _WORD.finditer(line):
            data += self._obey(word)
        return b"".join(each.encode("latin-1") + CR for each in data) + ACK

    def _obey(self, word: re.Match[str]) -> list[str]:
        if word["buffer"]:
            self._open = word["buffer"].upper() == "OPEN"
        if self._open:
            return []
        if word["words"]:
            return [" ".join(["000000"] * int(word["words"]))]
        if word["report"]:
            return [_REPORTS.get(word["report"].upper(), "000000000000" if "?" in word["report"] else "0")]
        if word["axis"]:
            return self._place(word["axis"], word["axis_place"], "0")
        if word["name"] is None:
            return []
        if word["place"] is not None:
            return self._place(word["name"].upper(), word["place"], "*")
        return self._variable(word)

    def _variable(self, word: re.Match[str]) -> list[str]:
        name = word["name"].upper()
        first = int(name[1:])
        last = int(word["last"] or first + int(word["count"] or 1) - 1)
        names = [f"{name[0]}{number}" for number in range(first, min(last, first + 9000) + 1)]
        if word["value"] is not None:
            self._values.update(dict.fromkeys(names, self._value(word["value"])))
            return []
        return [self._values.get(each, "0") for each in names]

    def _value(self, text: str) -> str:
        """Return what is assigned: a console claims a controller with an expression."""
        formula = re.sub(r"[IPQM]\d+", lambda name: self._values.get(name[0], "0"), text)
        formula = re.sub(r"INT|ABS", lambda name: {"INT": "floor", "ABS": "abs"}[name[0]], formula)
        if "floor" not in formula or not re.fullmatch(r"(?:floor|abs|[-+*/().\d])+", formula):
            return text
        return f"{eval(formula, {'floor': math.floor, 'abs': abs}):.12g}"

    def _place(self, name: str, place: str, absent: str) -> list[str]:
        if not place:
            return [self._places.get(name, absent)]
        self._places[name] = place
        return []


# A controller that does not cooperate, at the end of a real socket or pseudo-terminal; every byte it got is kept.
#
# One thread reads what hosts send, and keeps it; another one answers, honestly for some lines and then in its own
# way. Memory stays bounded however much it floods, and both end with the block.

CHUNK = 65_536
POLL_S = 0.02
MOTION = re.compile(
    r"J[-+/=:^*]|HM|(?<![A-Z])B\d+\s*R|(?<![A-Z])[RSA](?![A-Z\d])|\bO[-+.\d]|\$\$?\s*$", re.IGNORECASE
)
"""A line of which a part moves or energises something."""

MOVING_CHARACTERS = {0x01: "^A", 0x12: "^R", 0x13: "^S"}
"""Control-A also closes loops."""


class HostileCard:
    """`address` is where it listens; `lines` and `controls` are what came, in order."""

    def __init__(self, kind: Kind, machine: MachineProfile, honest_lines: int) -> None:
        self.address = ""
        self.lines: list[str] = []
        self.controls: list[int] = []
        self._kind, self._honest = kind, honest_lines
        controller = machine.controller
        self._card = PlausibleCard(controller.variables, controller.axis_definitions)
        self._ended = threading.Event()

    @property
    def moved_by(self) -> list[str]:
        """The lines and control characters that would move a real machine."""
        programs, moving = False, []
        for line in self.lines:
            programs = (programs or "OPEN" in line.upper()) and "CLOSE" not in line.upper()
            if not programs and MOTION.search(line):
                moving.append(line)
        return moving + [MOVING_CHARACTERS[each] for each in self.controls if each in MOVING_CHARACTERS]

    def talk(self, host: int, end: Callable[[End], None]) -> None:
        """Serve one connection, a file descriptor, to its end."""
        asked: SimpleQueue[str] = SimpleQueue()
        gone = threading.Event()
        reader = threading.Thread(target=self._listen, args=(host, asked, gone), name="hostile ear")
        reader.start()
        way = self._kind.way()
        try:
            while not (self._ended.is_set() or gone.is_set()):
                with suppress(Empty):
                    if not self._answer(host, asked.get(timeout=POLL_S), way, gone, end):
                        break
        finally:
            gone.set()
            reader.join()

    def stop(self) -> None:
        """End every connection."""
        self._ended.set()

    @property
    def stopped(self) -> bool:
        """Whether it was ended."""
        return self._ended.is_set()

    def _answer(self, host: int, line: str, way: Way, gone: threading.Event, end: Callable[[End], None]) -> bool:
        """Answer one line; return whether the connection goes on."""
        reply = self._card.reply(line)
        self._honest -= 1
        for step in [reply] if self._honest >= 0 else way(line, reply):
            if isinstance(step, End):
                end(step)
                return False
            if isinstance(step, float):
                waited = 0.0
                while waited < step and not (gone.is_set() or self._ended.is_set()):
                    gone.wait(min(POLL_S, step - waited))
                    waited += POLL_S
            elif not self._write(host, step, gone):
                return False
        return True

    def _write(self, host: int, data: bytes, gone: threading.Event) -> bool:
        left = memoryview(data)
        while left and not (gone.is_set() or self._ended.is_set()):
            try:
                if select.select([], [host], [], POLL_S)[1]:
                    left = left[os.write(host, left) :]
            except BlockingIOError:
                continue
            except (OSError, ValueError):
                return False
        return not left

    def _listen(self, host: int, asked: SimpleQueue[str], gone: threading.Event) -> None:
        line = bytearray()
        while not (gone.is_set() or self._ended.is_set()):
            try:
                if not select.select([host], [], [], POLL_S)[0]:
                    continue
                data = os.read(host, CHUNK)
            except BlockingIOError:
                continue
            except (OSError, ValueError):
                data = b""
            if not data:
                gone.set()
                return
            for byte in data:
                if byte == 0x0D:
                    self.lines.append(line.decode("latin-1"))
                    asked.put(self.lines[-1])
                    line.clear()
                elif byte < 0x20:
                    self.controls.append(byte)
                    if byte == 0x18:
                        line.clear()
                else:
                    line.append(byte)


@contextmanager
def hostile_card(
    kind: Kind, transport: str, machine: MachineProfile, honest_lines: int = 0
) -> Iterator[HostileCard]:
    """Serve a controller that answers `honest_lines` lines, and then in its own way; tcp or serial."""
    card = HostileCard(kind, machine, honest_lines)
    serve = _serve_tcp if transport == "tcp" else _serve_serial
    with serve(card):
        yield card


@contextmanager
def _serve_tcp(card: HostileCard) -> Iterator[None]:
    def accept() -> None:
        while not card.stopped:
            with suppress(OSError):
                host, _ = listener.accept()
                with closing(host):
                    host.setblocking(False)
                    card.talk(host.fileno(), partial(_end, host))

    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(POLL_S)
        card.address = f"tcp:127.0.0.1:{listener.getsockname()[1]}"
        thread = threading.Thread(target=accept, name="hostile card")
        thread.start()
        try:
            yield
        finally:
            card.stop()
            thread.join()


def _end(host: socket.socket, end: End) -> None:
    if end is End.BROKEN:
        host.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))


@contextmanager
def _serve_serial(card: HostileCard) -> Iterator[None]:
    near, far = os.openpty()
    tty.setraw(far)
    os.set_blocking(near, False)
    card.address = f"serial:{os.ttyname(far)}?baud=4000000"
    closed = threading.Event()

    def end(_: End) -> None:
        closed.set()

    thread = threading.Thread(target=card.talk, args=(near, end), name="hostile card")
    thread.start()
    try:
        yield
    finally:
        card.stop()
        thread.join()
        os.close(near)
        os.close(far)
