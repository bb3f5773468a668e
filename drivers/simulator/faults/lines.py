"""The lines between the controller and its hosts, with the effects of faults.

`Lines` is the same for every host; each has its own `HostOutput` and a `LineDirection` for each direction.
"""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from random import Random

from drivers.simulator.faults.catalogue import Value

BELL, CR, NUL = b"\x07", b"\r", b"\0"
CHARACTER_BITS = 10  # a start bit, 8 data bits, a stop bit
_SUMMED = re.compile(rb"(\r)(.)", re.DOTALL)


@dataclass(slots=True, eq=False, kw_only=True)
class Chance:
    """Random selection of the replies that a fault changes: a `fraction` of them, in order, and `left` in all."""

    random: Random
    fraction: float = 1.0
    left: float = math.inf

    def hits(self) -> bool:
        """Draw whether the next one is hit."""
        return self.left > 0 and self.random.random() < self.fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class OutgoingReply:
    """The reply to one line: its data, the acceptance or refusal, and the checksum of that.

    With `summed`, each line of data has its checksum after its CR, and `checksum` is that of the host's line,
    which a refused line does not have.
    """

    data: bytes = b""
    end: bytes = b""
    checksum: bytes = b""
    summed: bool = False

    @property
    def sent_bytes(self) -> bytes:
        """The bytes as they leave."""
        return self.data + self.end + self.checksum


def without_acknowledgement(reply: OutgoingReply) -> OutgoingReply:
    """Remove the acceptance of a line; a refusal stays."""
    return reply if reply.end.startswith(BELL) else replace(reply, end=b"")


def with_empty_line(reply: OutgoingReply) -> OutgoingReply:
    """Put an empty line first."""
    checksum = CR if reply.summed else b""  # the checksum of a CR alone is 13, a CR again
    return replace(reply, data=CR + checksum + reply.data)


def as_nul(_: OutgoingReply) -> OutgoingReply:
    """Replace it with a NUL."""
    return OutgoingReply(data=NUL)


def as_bare_bell(_: OutgoingReply) -> OutgoingReply:
    """Replace it with a BEL without text."""
    return OutgoingReply(end=BELL)


def with_wrong_checksums(reply: OutgoingReply) -> OutgoingReply:
    """Make each checksum one too large, if there is any."""
    if not reply.summed:
        return reply
    data = _SUMMED.sub(lambda found: found[1] + _next(found[2]), reply.data)
    return replace(reply, data=data, checksum=_next(reply.checksum))


def _next(checksum: bytes) -> bytes:
    return bytes((byte + 1) & 0xFF for byte in checksum)


Spoil = Callable[[OutgoingReply], OutgoingReply]

SPOILERS: Mapping[str, Spoil] = {
    "dropped-ack": without_acknowledgement,
    "extra-line": with_empty_line,
    "nul": as_nul,
    "wrong-checksum": with_wrong_checksums,
    "bare-bel": as_bare_bell,
}
"""By the name of the fault."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplyPiece:
    """Bytes that arrive together: `late_s` after they were sent, and `gap_s` after the last ones, at least."""

    data: bytes
    late_s: float = 0.0
    gap_s: float = 0.0


def delay_bytes(said: bytes, *, delay_s: float) -> list[ReplyPiece]:
    """All of it arrives late."""
    return [ReplyPiece(data=said, late_s=delay_s)]


def split(said: bytes, *, pieces: int, gap_s: float) -> list[ReplyPiece]:
    """It arrives in pieces of about the same length; shorter text arrives byte by byte."""
    count = max(1, min(pieces, len(said)))
    ends = [len(said) * number // count for number in range(count + 1)]
    parts = [said[start:end] for start, end in pairwise(ends)]
    return [ReplyPiece(data=part, gap_s=gap_s if number else 0.0) for number, part in enumerate(parts)]


def slow(said: bytes, *, baud: float) -> list[ReplyPiece]:
    """It arrives a character at a time."""
    character_s = CHARACTER_BITS / baud
    return [ReplyPiece(data=said[place : place + 1], gap_s=character_s) for place in range(len(said))]


Carry = Callable[[bytes], list[ReplyPiece]]


def _seconds(values: Mapping[str, Value], key: str) -> float:
    return float(values[key]) / 1000.0


CARRIERS: Mapping[str, Callable[[Mapping[str, Value]], Carry]] = {
    "late-reply": lambda values: partial(delay_bytes, delay_s=_seconds(values, "delay_ms")),
    "split-segments": lambda values: partial(
        split, pieces=int(values["pieces"]), gap_s=_seconds(values, "gap_ms")
    ),
    "9600-baud": lambda values: partial(slow, baud=float(values["baud"])),
}
"""By the name of the fault: the effect of its parameters on a unit of bytes."""


def combine(pieces: list[ReplyPiece], carry: Carry) -> list[ReplyPiece]:
    """Apply a second fault to the result of a first one; both delays add up."""
    combined: list[ReplyPiece] = []
    for piece in pieces:
        first, *rest = carry(piece.data)
        opening = ReplyPiece(data=first.data, late_s=piece.late_s + first.late_s, gap_s=piece.gap_s + first.gap_s)
        combined += [opening, *rest]
    return combined


def schedule(pieces: list[ReplyPiece], sent_s: float, last_s: float) -> list[tuple[float, bytes]]:
    """Return when each piece arrives, after the previous arrival `last_s`; nothing overtakes."""
    arrivals: list[tuple[float, bytes]] = []
    for piece in pieces:
        last_s = max(sent_s + piece.late_s, max(sent_s, last_s) + piece.gap_s)
        arrivals.append((last_s, piece.data))
    return arrivals


@dataclass(slots=True, eq=False, kw_only=True)
class Spoiler(Chance):
    """A fault that spoils replies."""

    spoil: Spoil


@dataclass(slots=True, eq=False, kw_only=True)
class Carrier(Chance):
    """A fault that delays bytes; also those of hosts, if it is `both_ways`."""

    carry: Carry
    both_ways: bool = False


@dataclass(slots=True, eq=False, kw_only=True)
class Garbling:
    """A fault that alters the next line with text in it; it is `over` then."""

    find: bytes
    replace: bytes
    over: bool = False


@dataclass(slots=True, eq=False, kw_only=True)
class Lines:
    """The state of all lines.

    `cut` is whether no host can connect, `hung` whether the controller neither reads nor replies, `dead` whether
    it is shut down, `slow` whether it serves its hosts in its background cycle only. `clearings` counts how often
    all faults were ended.
    """

    now_s: Callable[[], float]
    cut: bool = False
    hung: bool = False
    dead: bool = False
    slow: bool = False
    clearings: int = 0
    spoilers: list[Spoiler] = field(default_factory=list)
    carriers: list[Carrier] = field(default_factory=list)
    garblings: list[Garbling] = field(default_factory=list)

    @property
    def silent(self) -> bool:
        """Whether the controller sends nothing, whatever it receives."""
        return self.hung or self.dead

    def read(self, line: bytes) -> bytes:
        """Return the line as the controller reads it."""
        for garbling in self.garblings:
            if not garbling.over and garbling.find in line:
                garbling.over = True
                line = line.replace(garbling.find, garbling.replace, 1)
        return line

    def spoil_reply(self, reply: OutgoingReply) -> bytes:
        """Return a reply as the faults leave it."""
        for spoiler in self.spoilers:
            if spoiler.hits() and (spoilt := spoiler.spoil(reply)).sent_bytes != reply.sent_bytes:
                reply = spoilt
                spoiler.left -= 1
        return reply.sent_bytes

    def carry_bytes(self, said: bytes, *, inward: bool) -> list[ReplyPiece]:
        """Return the pieces in which bytes arrive."""
        pieces = [ReplyPiece(data=said)]
        for carrier in self.carriers:
            if (carrier.both_ways or not inward) and carrier.hits():
                carried = combine(pieces, carrier.carry)
                if carried != pieces:
                    pieces = carried
                    carrier.left -= 1
        return pieces


class HostOutput:
    """The controller's output to one host, a unit for each reply or message; faults have already been applied."""

    def __init__(self, lines: Lines) -> None:
        self._lines = lines
        self._units: list[bytes] = []
        self._begun = bytearray()
        self.waiting = 0

    def say(self, said: bytes) -> None:
        """Add output that answers no line."""
        self._units.append(said)
        self.waiting += len(said)

    def begin(self, data: bytes) -> None:
        """Add data of a reply whose end is still to come; where replies are spoiled it waits for that."""
        if self._lines.spoilers or self._begun:
            self._begun += data
        else:
            self.say(data)

    def reply(self, data: bytes = b"", end: bytes = b"", checksum: bytes = b"", *, summed: bool = False) -> None:
        """Add a reply, or the end of the one that has begun."""
        if self._begun:
            data = bytes(self._begun) + data
            self._begun.clear()
        said = data + end + checksum
        if said and self._lines.spoilers:
            said = self._lines.spoil_reply(OutgoingReply(data=data, end=end, checksum=checksum, summed=summed))
        if said:
            self.say(said)

    def take(self) -> list[bytes]:
        """Return and clear the output."""
        if not self._units:
            return []
        units, self._units = self._units, []
        self.waiting = 0
        return units

    def forget(self) -> None:
        """Discard the pending output."""
        self.take()
        self._begun.clear()


class LineDirection:
    """One direction of a line, with the bytes in transit, in order; without faults all arrives at once."""

    def __init__(self, lines: Lines, *, inward: bool) -> None:
        """`inward` is the direction from the host to the controller."""
        self._lines = lines
        self._inward = inward
        self._in_transit: deque[tuple[float, bytes]] = deque()
        self._last_s = 0.0
        self._clearings = lines.clearings
        self.waiting = 0

    @property
    def clear(self) -> bool:
        """Whether all arrives at once."""
        return not (self._in_transit or self._lines.carriers or self._lines.silent)

    def carry(self, units: Iterable[bytes]) -> list[bytes]:
        """Send units of bytes; return what has arrived by now, each item in one go."""
        if self.clear:
            return [unit for unit in units if unit]
        lines, now_s = self._lines, self._lines.now_s()
        if self._clearings != lines.clearings:
            # All faults were ended: what was in transit then arrives at once.
            self._clearings, self._last_s = lines.clearings, 0.0
            self._in_transit = deque((0.0, data) for _, data in self._in_transit)
        for unit in filter(None, units):
            arrivals = schedule(lines.carry_bytes(unit, inward=self._inward), now_s, self._last_s)
            self._last_s = arrivals[-1][0]
            self._in_transit.extend(arrivals)
            self.waiting += len(unit)
        arrived: list[bytes] = []
        while self._in_transit and self._in_transit[0][0] <= now_s and not lines.silent:
            arrived.append(self._in_transit.popleft()[1])
            self.waiting -= len(arrived[-1])
        return arrived

    def forget(self) -> None:
        """Discard the bytes in transit."""
        self._in_transit.clear()
        self._last_s, self.waiting = 0.0, 0
