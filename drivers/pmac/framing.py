"""Split a stream of bytes into replies of the controller, with I3=2 and I6=1, and wait for one; the line checksum.

A line that is accepted answers DATA CR [DATA CR ...] ACK, a line that is refused BELL ERRnnn CR, perhaps after
data of the commands before the error. With I64=1 unsolicited program messages are STX TEXT CR, and may come
between any two lines. Incremental: bytes may come in any segmentation, and each is scanned about once.

On control-N the controller reports the checksum of what it has received of a command line, before the CR. By the
Software Reference it is one byte, the low byte of the sum of the characters: `J+` is 117. No real controller has
been observed yet that shows whether anything surrounds that byte, or digits replace it; a client therefore learns
the form from a line whose sum it knows.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, StrEnum, auto
from types import MappingProxyType

from drivers.clock import Clock
from drivers.link.base import Link
from drivers.pmac.reserved import MARKER

QUIET_S = 0.06  # Inter-byte timeout within a reply

SILENCE_S, SLOWEST_BYTES_S = 5.0, 100.0
"""Inter-byte timeout of a long reply: an average rate no slower than a line of 1200 baud.

A controller starts a listing at once. One that falls silent, or sends only a byte now and then, times out.
"""

LONGEST_BYTES = 1_000_000  # More than any controller buffer can list


class FaultKind(StrEnum):
    """What a client received instead of the expected reply."""

    SILENT = auto()  # Nothing came in time
    UNFINISHED = auto()  # Data came, but neither an ACK nor an error number after it
    NUL = auto()
    BARE_BELL = auto()
    """A refusal without a number: I6 is not 1, or the number was lost."""
    HANDSHAKE = auto()
    """A reply in the form of other settings (I3, I6): the controller was reset, or another client has set them."""
    GARBLED = auto()  # Bytes that no controller sends in this place, such as a checksum
    LINE_COUNT = auto()  # More or fewer lines of data than the request asks for
    UNASKED = auto()
    """Input that belongs to no request: a late reply, a message or an error of a program."""
    ABANDONED = auto()  # A request was sent before the previous reply had been read
    DIFFERS = auto()  # The checksum of a line in transit differed from that of the line sent
    LOST = auto()  # The link itself is lost


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultCount:
    """The number of faults of one kind, and the line of the last one."""

    count: int
    line: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkFaults:
    """All faults of a client since it was created."""

    seen: Mapping[FaultKind, FaultCount] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def total(self) -> int:
        """The number of faults of all kinds."""
        return sum(each.count for each in self.seen.values())

    def count(self, kind: FaultKind) -> int:
        """Return the number of faults of one kind."""
        return self.seen[kind].count if kind in self.seen else 0

    def with_another(self, kind: FaultKind, line: str) -> LinkFaults:
        """Return a copy with one more fault."""
        another = FaultCount(count=self.count(kind) + 1, line=line)
        return LinkFaults(seen=MappingProxyType({**self.seen, kind: another}))


NUL, STX, ACK, BELL, LF, CR = 0x00, 0x02, 0x06, 0x07, 0x0A, 0x0D

_NO_TEXT = re.compile(rb"[^\n\x20-\x7e]")
_ACCEPTED_TEXT = re.compile(rb"(?:[\x20-\x7e]*+\r)*+\x06")
"""A whole accepted reply of printable text: what nearly every status poll gets, read at once."""

_REFUSAL = re.compile(rb"ERR(\d{3})")


class FramingError(ValueError):
    """Bytes that no controller in this mode sends: the link is out of step."""

    def __init__(self, message: str, kind: FaultKind = FaultKind.GARBLED) -> None:
        super().__init__(message)
        self.kind = kind


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """The reply to one line: its data, and the ERR number when it was refused (None when accepted).

    `messages` are the program messages that came before its end.
    """

    lines: tuple[str, ...]
    error_number: int | None = None
    messages: tuple[str, ...] = ()


class _Part(Enum):
    LINE = auto()
    MESSAGE = auto()
    ACCEPTED = auto()
    REFUSED = auto()


_LINE, _MESSAGE, _ACCEPTED, _REFUSED = _Part  # by name: a member of an enumeration is slow to look up


class ReplyReader:
    """Bytes in, replies out. `rest` is the received input that is not yet a whole line."""

    def __init__(self) -> None:
        self.rest = b""
        self._lines: list[str] = []
        self._messages: list[str] = []

    @property
    def empty(self) -> bool:
        """Whether nothing has been received, of a reply or anything else."""
        return not (self.rest or self._lines or self._messages)

    @property
    def presumed_fault(self) -> FaultKind | None:
        """The fault if nothing more comes soon; None if more is likely on its way."""
        if self.rest.endswith(bytes((BELL,))):
            return FaultKind.BARE_BELL
        # DATA CR LF, or LF alone, is the end of a reply with I3=1; with I3=2 no line begins like that.
        return FaultKind.HANDSHAKE if self.rest == bytes((LF,)) else None

    def feed(self, data: bytes) -> None:
        """Append received bytes."""
        self.rest += data

    def clear(self) -> None:
        """Discard everything."""
        self.rest = b""
        self._lines.clear()
        self._messages.clear()

    def take(self) -> Reply | None:
        """Return the first complete reply, None while there is none.

        Raises FramingError: the input cannot be a reply, whatever follows.
        """
        if not (self._lines or self._messages) and _ACCEPTED_TEXT.fullmatch(self.rest):
            lines, self.rest = self.rest[:-1].decode("ascii").split("\r")[:-1], b""
            return Reply(lines=tuple(lines))
        end = self._collect()
        if end is None:
            return None
        part, number = end
        error_number = int(number) if part is _REFUSED else None
        reply = Reply(lines=tuple(self._lines), error_number=error_number, messages=tuple(self._messages))
        self._lines.clear()
        self._messages.clear()
        return reply

    def take_messages(self) -> tuple[str, ...]:
        """Return the leading messages while no request is pending; `empty` then shows whether that was all.

        Raises FramingError: the first of them contains something that is not text.
        """
        texts = []
        while self.rest[:1] == bytes((STX,)) and (taken := _part(self.rest, 0)) is not None:
            _, text, place = taken
            texts.append(text)
            self.rest = self.rest[place:]
        return tuple(texts)

    @property
    def within_message(self) -> bool:
        """Whether all input so far is the beginning of a message."""
        return self.rest.startswith(bytes((STX,))) and not self._lines

    def _collect(self) -> tuple[_Part, str] | None:
        """Sort whole lines into data and messages up to the end of a reply; return that end."""
        place = 0
        try:
            while (taken := _part(self.rest, place)) is not None:
                part, text, place = taken
                if part is _LINE:
                    self._lines.append(text)
                elif part is _MESSAGE:
                    self._messages.append(text)
                else:
                    return part, text
        finally:
            self.rest = self.rest[place:]
        return None


def _part(buffer: bytes, start: int) -> tuple[_Part, str, int] | None:
    """Return the next part of a reply, its text, and the start of the following one; None while incomplete."""
    if start == len(buffer):
        return None
    if buffer[start] == ACK:
        return _ACCEPTED, "", start + 1
    begin = start + 1 if buffer[start] in (STX, BELL) else start
    found = _NO_TEXT.search(buffer, begin)
    if found is None:
        return None
    end = found.start()
    if buffer[end] == NUL:
        raise FramingError(f"byte {NUL:#04x} in a reply", FaultKind.NUL)
    if buffer[start] == BELL:
        number = _REFUSAL.fullmatch(buffer, begin, end)
        if buffer[end] != CR or number is None:
            # BELL CR ERRnnn CR is the form with I6=3.
            kind = FaultKind.HANDSHAKE if buffer[end] == CR and begin == end else FaultKind.GARBLED
            raise FramingError("a BELL without an error number", kind)
        return _REFUSED, number[1].decode("ascii"), end + 1
    if buffer[end] != CR:
        problem = "data without an end of line" if buffer[end] in (ACK, BELL) else "in a reply"
        raise FramingError(f"byte {buffer[end]:#04x}: {problem}")
    text = buffer[begin:end].strip(b"\n").decode("ascii", "backslashreplace")
    return _MESSAGE if begin > start else _LINE, text, end + 1


class FaultError(Exception):
    """Something other than a reply: its kind, the actual value (of a silence: its duration), and the limit."""

    def __init__(self, kind: FaultKind, actual: str = "", allowed: str = "") -> None:
        super().__init__(kind)
        self.kind, self.actual, self.allowed = kind, actual, allowed


def await_reply(
    reader: ReplyReader, link: Link, clock: Clock, timeout_s: float, silence_s: float = SILENCE_S
) -> Reply:
    """Return the next reply on a link, which may be silent for `silence_s`.

    Raises:
        FaultError: none in time, or something else.
        LinkError: the link broke.
    """
    began_s = last_s = clock.now_s()
    count = 0
    while True:
        end_s = began_s + min(timeout_s, silence_s + count / SLOWEST_BYTES_S)
        deadline = min(end_s, last_s + silence_s)
        try:
            reply = reader.take()
        except FramingError as error:
            raise FaultError(error.kind, str(error)) from error
        if reply is not None:
            return reply
        left, presumed = deadline - clock.now_s(), reader.presumed_fault
        if presumed is not None:
            left = min(left, QUIET_S)
        came = link.receive(left) if left > 0.0 else b""
        if not came and presumed is not None:
            raise FaultError(presumed, "BEL" if presumed is FaultKind.BARE_BELL else "LF", "ACK | BEL ERRnnn")
        if not came and deadline <= clock.now_s():
            kind = FaultKind.SILENT if reader.empty else FaultKind.UNFINISHED
            raise FaultError(kind, f"{deadline - began_s:.3g} s")
        if came:
            last_s, count = clock.now_s(), count + len(came)
        if count > LONGEST_BYTES:
            raise FaultError(FaultKind.GARBLED, f"> {LONGEST_BYTES} bytes")
        reader.feed(came)


ASK = b"\x0e"  # Control-N
PROBE = f"P{MARKER}".encode("ascii")  # A query, harmless should it ever be executed

_AROUND = frozenset((ACK, LF, CR))
_AMBIGUOUS = frozenset((NUL, STX, ACK, BELL, LF, CR))
"""Sent for other reasons, too: after an empty line, before a message, after a line that was executed."""


class LineCheck(StrEnum):
    """What verifies that a line arrives as it was sent."""

    NETWORK = auto()  # The transport has checksums of its own
    CONTROLLER = auto()  # The controller reports the checksum of a line before it executes the line
    NOBODY = auto()


@dataclass(frozen=True, slots=True, kw_only=True)
class ChecksumForm:
    """The form of a controller's checksum: one byte or decimal digits, and what surrounds it."""

    digits: bool
    before: bytes = b""
    after: bytes = b""

    def answer(self, line: bytes) -> bytes:
        """Return exactly what the controller sends once it has received this line."""
        value = checksum(line)
        return self.before + (b"%d" % value if self.digits else bytes((value,))) + self.after


def checksum(line: bytes) -> int:
    """Return the low byte of the sum of the characters; control characters are not counted."""
    return sum(byte for byte in line if byte >= 0x20) & 0xFF


def unmistakable(line: bytes) -> bytes:
    """Return the line with a checksum that no other reply equals: with a space appended where necessary."""
    return line + b" " if checksum(line) in _AMBIGUOUS else line


def form_of(reported: bytes, line: bytes) -> ChecksumForm | None:
    """Derive the form of a checksum from the reply to a line; None when the reply is no checksum."""
    for digits in (False, True):
        before, found, after = reported.partition(ChecksumForm(digits=digits).answer(line))
        if found and _AROUND.issuperset(before + after):
            return ChecksumForm(digits=digits, before=before, after=after)
    return None


def like_an_answer(reported: bytes) -> bool:
    """Whether a reply may be an acknowledgement or a refusal: a character of the line arrived as its end."""
    return reported[:1] in (bytes((ACK,)), bytes((BELL,)))


def format_reply(reported: bytes) -> str:
    """Return a reply in readable form: the numbers of its bytes, or its digits."""
    text = reported.strip().decode("latin-1")
    return text if len(reported) > 1 and text.isascii() and text.isdigit() else " ".join(map(str, reported))
