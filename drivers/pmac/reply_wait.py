"""Wait for one reply: how long the link may be silent, and what came instead of a reply."""

from __future__ import annotations

from drivers.clock import Clock
from drivers.link.base import Link
from drivers.pmac.framing import FaultKind, FramingError, Reply, ReplyReader

QUIET_S = 0.06
"""Inter-byte timeout within a reply."""

SILENCE_S, SLOWEST_BYTES_S = 5.0, 100.0
"""Inter-byte timeout of a long reply: an average rate no slower than a line of 1200 baud.

A controller starts a listing at once. One that falls silent, or sends only a byte now and then, times out.
"""

LONGEST_BYTES = 1_000_000
"""More than any controller buffer can list."""


class FaultError(Exception):
    """Something other than a reply: its kind, the actual value (of a silence: its duration), and the limit."""

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
