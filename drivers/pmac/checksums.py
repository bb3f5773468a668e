"""The checksum of a line on its way: the controller says on control-N what it has received, before the CR.

The Software Reference has it as one byte, the low byte of the sum of the characters: `J+` is 117. Whether anything
stands around that byte, or digits in its place, no controller was seen to say; a client therefore learns it from a
line of which it knows the sum.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum, auto

from drivers.pmac.framing import ACK, BELL, CR, LF, NUL, STX
from drivers.pmac.reserved import MARKER

ASK = b"\x0e"
"""Control-N."""

PROBE = f"P{MARKER}".encode("ascii")
"""A line that only asks, should it ever be carried out."""

_AROUND = frozenset((ACK, LF, CR))
_AMBIGUOUS = frozenset((NUL, STX, ACK, BELL, LF, CR))
"""What is said for other reasons, too: of an empty line, in front of a message, to a line that was carried out."""


class LineCheck(StrEnum):
    """Who sees that a line arrives as it was sent."""

    NETWORK = auto()
    """What carries the bytes has checksums of its own."""
    CONTROLLER = auto()
    """The controller says the checksum of a line before it is carried out."""
    NOBODY = auto()


@dataclass(frozen=True, slots=True, kw_only=True)
class ChecksumForm:
    """How a controller words a checksum: as one byte or in decimal digits, and what stands around it."""

    digits: bool
    before: bytes
    behind: bytes

    def answer(self, line: bytes) -> bytes:
        """Return what the controller says when it has received this line, and nothing in front of it."""
        return self.before + _worded(checksum(line), digits=self.digits) + self.behind


def checksum(line: bytes) -> int:
    """Return the low byte of the sum of the characters; control characters do not count."""
    return sum(byte for byte in line if byte >= 0x20) & 0xFF


def unmistakable(line: bytes) -> bytes:
    """Return a line whose checksum is nothing else that a controller says: with a space behind it, where it is."""
    return line + b" " if checksum(line) in _AMBIGUOUS else line


def form_of(said: bytes, line: bytes) -> ChecksumForm | None:
    """Return how a checksum is worded by what was said of a line; None when that is none of it."""
    for digits in (False, True):
        before, found, behind = said.partition(_worded(checksum(line), digits=digits))
        if found and _AROUND.issuperset(before + behind):
            return ChecksumForm(digits=digits, before=before, behind=behind)
    return None


def like_an_answer(said: bytes) -> bool:
    """Whether what was said may be an acknowledgement or a refusal: a character of the line arrived as its end."""
    return said[:1] in (bytes((ACK,)), bytes((BELL,)))


def shown(said: bytes) -> str:
    """Return what was said of a line as people read it: the numbers of its bytes, or its digits."""
    text = said.strip().decode("latin-1")
    return text if len(said) > 1 and text.isascii() and text.isdigit() else " ".join(map(str, said))


def _worded(value: int, *, digits: bool) -> bytes:
    return b"%d" % value if digits else bytes((value,))
