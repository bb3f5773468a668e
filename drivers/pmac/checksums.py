"""The checksum of a command line: the controller reports on control-N what it has received, before the CR.

By the Software Reference it is one byte, the low byte of the sum of the characters: `J+` is 117. No real
controller has been observed yet that shows whether anything surrounds that byte, or digits replace it; a client
therefore learns the form from a line whose sum it knows.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum, auto

from drivers.pmac.framing import ACK, BELL, CR, LF, NUL, STX
from drivers.pmac.reserved import MARKER

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


def shown(reported: bytes) -> str:
    """Return a reply in readable form: the numbers of its bytes, or its digits."""
    text = reported.strip().decode("latin-1")
    return text if len(reported) > 1 and text.isascii() and text.isdigit() else " ".join(map(str, reported))
