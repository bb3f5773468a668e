"""Replies of the controller cut out of a stream of bytes, with I3=2 and I6=1.

A line that is accepted answers DATA CR [DATA CR ...] ACK, a line that is refused BELL ERRnnn CR, perhaps after
data of the commands before the error. Pure and incremental: bytes may come in any segmentation.
"""

from __future__ import annotations

from dataclasses import dataclass

ACK = 0x06
BELL = 0x07
CR = 0x0D
NUL = 0x00


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """The answer to one line: its data, and the ERR number when it was refused (None when accepted)."""

    lines: tuple[str, ...]
    error_number: int | None = None


class FramingError(ValueError):
    """Bytes that no controller in this mode sends: the link is out of step."""


def take_reply(buffer: bytes) -> tuple[Reply | None, int]:
    """Return the first complete reply in `buffer` and the number of bytes that it takes (0 while incomplete).

    Raises:
        FramingError: NUL, a byte above 126, or text in front of an ACK or behind a BELL that is no reply.
    """
    for index, byte in enumerate(buffer):
        if byte == ACK:
            return Reply(lines=_data_lines(buffer[:index])), index + 1
        if byte == BELL:
            end = buffer.find(CR, index)
            if end < 0:
                return None, 0
            number = _error_number(buffer[index + 1 : end])
            return Reply(lines=_data_lines(buffer[:index]), error_number=number), end + 1
        if byte == NUL or byte > 126:
            raise FramingError(f"byte {byte:#04x} in a reply")
    return None, 0


def _data_lines(data: bytes) -> tuple[str, ...]:
    if not data:
        return ()
    if data[-1] != CR:
        raise FramingError("data without an end of line")
    return tuple(line.strip(b"\n").decode("ascii") for line in data[:-1].split(b"\r"))


def _error_number(text: bytes) -> int:
    digits = text.removeprefix(b"ERR")
    if len(text) != 6 or len(digits) != 3 or not digits.isdigit():
        raise FramingError("a BELL without an error number")
    return int(digits)
