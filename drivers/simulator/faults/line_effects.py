"""Effects of faults on what a host receives: on the bytes of a reply, and on the arrival time of bytes. Pure."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

from drivers.simulator.faults.catalogue import Value

BELL, CR, NUL = b"\x07", b"\r", b"\0"
CHARACTER_BITS = 10  # a start bit, 8 data bits, a stop bit
_SUMMED = re.compile(rb"(\r)(.)", re.DOTALL)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """The reply to one line: its data, the acceptance or refusal, and the checksum of that.

    With `summed`, each line of data has its checksum after its CR, and `checksum` is that of the host's line,
    which a refused line does not have.
    """

    data: bytes = b""
    end: bytes = b""
    checksum: bytes = b""
    summed: bool = False

    @property
    def sent(self) -> bytes:
        """The bytes as they leave."""
        return self.data + self.end + self.checksum


def without_acknowledgement(reply: Reply) -> Reply:
    """Remove the acceptance of a line; a refusal stays."""
    return reply if reply.end.startswith(BELL) else replace(reply, end=b"")


def with_empty_line(reply: Reply) -> Reply:
    """Put an empty line first."""
    checksum = CR if reply.summed else b""  # the checksum of a CR alone is 13, a CR again
    return replace(reply, data=CR + checksum + reply.data)


def as_nul(_: Reply) -> Reply:
    """Replace it with a NUL."""
    return Reply(data=NUL)


def as_bare_bell(_: Reply) -> Reply:
    """Replace it with a BEL without text."""
    return Reply(end=BELL)


def with_wrong_checksums(reply: Reply) -> Reply:
    """Make each checksum one too large, if there is any."""
    if not reply.summed:
        return reply
    data = _SUMMED.sub(lambda found: found[1] + _next(found[2]), reply.data)
    return replace(reply, data=data, checksum=_next(reply.checksum))


def _next(checksum: bytes) -> bytes:
    return bytes((byte + 1) & 0xFF for byte in checksum)


Spoil = Callable[[Reply], Reply]

SPOILERS: Mapping[str, Spoil] = {
    "dropped-ack": without_acknowledgement,
    "extra-line": with_empty_line,
    "nul": as_nul,
    "wrong-checksum": with_wrong_checksums,
    "bare-bel": as_bare_bell,
}
"""By the name of the fault."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """Bytes that arrive together: `late_s` after they were sent, and `gap_s` after the last ones, at least."""

    data: bytes
    late_s: float = 0.0
    gap_s: float = 0.0


def late(said: bytes, *, delay_s: float) -> list[Piece]:
    """All of it arrives late."""
    return [Piece(data=said, late_s=delay_s)]


def split(said: bytes, *, pieces: int, gap_s: float) -> list[Piece]:
    """It arrives in pieces of about the same length; shorter text arrives byte by byte."""
    count = max(1, min(pieces, len(said)))
    ends = [len(said) * number // count for number in range(count + 1)]
    parts = [said[start:end] for start, end in pairwise(ends)]
    return [Piece(data=part, gap_s=gap_s if number else 0.0) for number, part in enumerate(parts)]


def slow(said: bytes, *, baud: float) -> list[Piece]:
    """It arrives a character at a time."""
    character_s = CHARACTER_BITS / baud
    return [Piece(data=said[place : place + 1], gap_s=character_s) for place in range(len(said))]


Carry = Callable[[bytes], list[Piece]]


def _seconds(values: Mapping[str, Value], key: str) -> float:
    return float(values[key]) / 1000.0


CARRIERS: Mapping[str, Callable[[Mapping[str, Value]], Carry]] = {
    "late-reply": lambda values: partial(late, delay_s=_seconds(values, "delay_ms")),
    "split-segments": lambda values: partial(
        split, pieces=int(values["pieces"]), gap_s=_seconds(values, "gap_ms")
    ),
    "9600-baud": lambda values: partial(slow, baud=float(values["baud"])),
}
"""By the name of the fault: the effect of its parameters on a unit of bytes."""


def combine(pieces: list[Piece], carry: Carry) -> list[Piece]:
    """Apply a second fault to the result of a first one; both delays add up."""
    combined: list[Piece] = []
    for piece in pieces:
        first, *rest = carry(piece.data)
        opening = Piece(data=first.data, late_s=piece.late_s + first.late_s, gap_s=piece.gap_s + first.gap_s)
        combined += [opening, *rest]
    return combined


def schedule(pieces: list[Piece], sent_s: float, last_s: float) -> list[tuple[float, bytes]]:
    """Return when each piece arrives, after the previous arrival `last_s`; nothing overtakes."""
    arrivals: list[tuple[float, bytes]] = []
    for piece in pieces:
        last_s = max(sent_s + piece.late_s, max(sent_s, last_s) + piece.gap_s)
        arrivals.append((last_s, piece.data))
    return arrivals
