"""Effects of faults on the bytes of one reply. Pure: a reply in, a reply out."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

BELL, CR, NUL = b"\x07", b"\r", b"\0"

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
