"""Format output to a host: handshake (I3), checksums (I4), errors (I6), messages (I62, I64).

Pure: settings and text in, bytes out.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from drivers.pmac.variables import VariableStore

STX, ACK, BELL, LF, CR = b"\x02", b"\x06", b"\x07", b"\n", b"\r"
_BITS = 3
_LINE_FEEDS = 1  # the bit of I3 that puts line feeds before data, and instead of a missing acknowledgement


@dataclass(frozen=True, slots=True, kw_only=True)
class Wording:
    """The present settings. Values above 3 wrap in their effect."""

    handshake: int
    checksums: bool
    errors: int
    silent_end: bool
    marked: bool

    @property
    def lead(self) -> bytes:
        """Prefix of each line of data."""
        return LF if self.handshake in (1, 3) else b""

    @property
    def acknowledgement(self) -> bytes:
        """The acknowledgement of a line."""
        return (b"", LF, ACK, ACK)[self.handshake]


def wording(variables: VariableStore) -> Wording:
    """Return the present settings of the controller."""
    i = variables.i
    handshake = int(i(3)) & _BITS
    switch = variables.dialect.no_line_feeds_switch
    if switch is not None and i(switch):
        handshake &= ~_LINE_FEEDS
    return Wording(
        handshake=handshake,
        checksums=bool(int(i(4)) & 1),
        errors=int(i(6)) & _BITS,
        silent_end=i(62) != 0.0,
        marked=i(64) != 0.0,
    )


def data(lines: Iterable[str], how: Wording) -> bytes:
    """Return lines of data, each with its end and, where enabled, with a checksum of all its bytes."""
    lead, said = how.lead, bytearray()
    if not how.checksums:
        before, behind = lead.decode("ascii"), CR.decode("ascii")
        return "".join([f"{before}{line}{behind}" for line in lines]).encode("ascii", "replace")
    for line in lines:
        sent = lead + line.encode("ascii", "replace") + CR
        said += sent
        said.append(checksum(sent))
    return bytes(said)


def line_checksum(line: bytes, how: Wording) -> bytes:
    """Return the checksum of a line that is accepted; it follows the acknowledgement."""
    return bytes([checksum(line)]) if how.checksums else b""


def refused(code: int, how: Wording) -> bytes:
    """Return the error reply to a line. No acknowledgement or checksum follows it."""
    text = b"ERR%03d" % code
    match how.errors:
        case 1:
            return BELL + how.lead + text + CR
        case 3:
            return BELL + CR + how.lead + text + CR
        case _:
            return BELL


def message(text: str, how: Wording) -> bytes:
    """Return an unsolicited program message: without an acknowledgement."""
    mark = STX if how.marked else b""
    return mark + how.lead + text.encode("ascii", "replace") + (b"" if how.silent_end else CR)


def complaint(code: int, how: Wording) -> bytes:
    """Return the error of a program's command; with I6 = 2 only hosts get error messages."""
    return b"" if how.errors == 2 else refused(code, how)


def checksum(sent: bytes | bytearray) -> int:
    """Return the sum of the bytes, its lowest 8 bits."""
    return sum(sent) & 0xFF
