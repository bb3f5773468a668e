"""Format output to a host: handshake (I3), checksums (I4), errors (I6), messages (I62, I64).

Pure: settings and text in, bytes out.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from drivers.pmac.variables import VariableStore

STX, ACK, BELL, LF, CR = b"\x02", b"\x06", b"\x07", b"\n", b"\r"
_BITS = 3
_LINE_FEEDS = 1  # the bit of I3 that puts line feeds before data, and instead of a missing acknowledgement


class Wording(NamedTuple):  # created three times as fast, for each reply
    """The present settings; values above 3 wrap in their effect.

    `lead` is the prefix of each line of data, `acknowledgement` that of a line.
    """

    lead: bytes
    acknowledgement: bytes
    checksums: bool
    errors: int
    silent_end: bool
    marked: bool


def wording(variables: VariableStore) -> Wording:
    """Return the present settings of the controller."""
    i = variables.i
    handshake = int(i(3)) & _BITS
    switch = variables.dialect.no_line_feeds_switch
    if switch is not None and i(switch):
        handshake &= ~_LINE_FEEDS
    return Wording(
        lead=LF if handshake & _LINE_FEEDS else b"",
        acknowledgement=(b"", LF, ACK, ACK)[handshake],
        checksums=bool(int(i(4)) & 1),
        errors=int(i(6)) & _BITS,
        silent_end=i(62) != 0.0,
        marked=i(64) != 0.0,
    )


def data(lines: Iterable[str], how: Wording) -> bytes:
    """Return lines of data, each with its end and, where enabled, with a checksum of all its bytes."""
    lead, end = how.lead.decode("ascii"), CR.decode("ascii")
    if not how.checksums:
        return "".join([f"{lead}{line}{end}" for line in lines]).encode("ascii", "replace")
    sent = [f"{lead}{line}{end}".encode("ascii", "replace") for line in lines]
    return b"".join([line + bytes([checksum(line)]) for line in sent])


def error_reply(code: int, how: Wording) -> bytes:
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


def checksum(sent: bytes | bytearray) -> int:
    """Return the sum of the bytes, its lowest 8 bits."""
    return sum(sent) & 0xFF
