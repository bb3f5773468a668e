"""Effects of faults on the arrival time of bytes. Pure: bytes in, timed bytes out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

from drivers.simulator.faults.parameter import Value

CHARACTER_BITS = 10
"""A start bit, 8 data bits, a stop bit."""


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


def _late(values: Mapping[str, Value]) -> Carry:
    return partial(late, delay_s=float(values["delay_ms"]) / 1000.0)


def _split(values: Mapping[str, Value]) -> Carry:
    return partial(split, pieces=int(values["pieces"]), gap_s=float(values["gap_ms"]) / 1000.0)


def _slow(values: Mapping[str, Value]) -> Carry:
    return partial(slow, baud=float(values["baud"]))


CARRIERS: Mapping[str, Callable[[Mapping[str, Value]], Carry]] = {
    "late-reply": _late,
    "split-segments": _split,
    "9600-baud": _slow,
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
