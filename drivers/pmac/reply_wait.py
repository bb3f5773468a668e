"""Waiting for one reply: how long the link may be silent, and what came in the place of a reply."""

from __future__ import annotations

from drivers.clock import Clock
from drivers.link.base import Link
from drivers.pmac.framing import FramingError, Reply, ReplyReader
from drivers.pmac.link_faults import FaultKind

QUIET_S = 0.06
"""So long nothing comes in the middle of a reply that is on its way."""

SILENCE_S, SLOWEST_BYTES_S = 5.0, 100.0
"""A long reply may take its time while it comes: so long without a byte, no slower than a line of 1200 baud.

A controller begins to list at once. One that has fallen silent, or that gives a byte now and then, is given up.
"""

LONGEST_BYTES = 1_000_000
"""More than any buffer of a controller lists."""


class FaultError(Exception):
    """Something else than a reply: what kind, what was met (of a silence: how long it was), what is allowed."""

    def __init__(self, kind: FaultKind, met: str = "", allowed: str = "") -> None:
        super().__init__(kind)
        self.kind, self.met, self.allowed = kind, met, allowed


def awaited(reader: ReplyReader, link: Link, clock: Clock, timeout_s: float) -> Reply:
    """Return the next reply on a link.

    Raises:
        FaultError: none in time, or something else.
        LinkError: the link broke.
    """
    began_s = last_s = clock.now_s()
    count = 0
    while True:
        end_s = began_s + min(timeout_s, SILENCE_S + count / SLOWEST_BYTES_S)
        deadline = min(end_s, last_s + SILENCE_S)
        try:
            reply = reader.take()
        except FramingError as error:
            raise FaultError(error.kind, str(error)) from error
        if reply is not None:
            return reply
        left, presumed = deadline - clock.now_s(), reader.presumed
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
