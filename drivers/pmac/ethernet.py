"""The wire format of a PMAC's Ethernet board: requests with a header of eight bytes, replies without one.

    RequestType u8 | Request u8 | wValue u16 | wIndex u16 | wLength u16, big-endian | data

Pure: splits a client's byte stream into requests, in any segmentation, and the waiting output into replies. The
format is the one used over USB, where it originated.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

DATA_LIMIT = 1492  # Data bytes after the header of one request
REPLY_LIMIT = 1400  # Bytes of one reply, and of one access to the DPRAM
LINES_LIMIT = 1024  # Bytes of lines in one WRITEBUFFER
DPRAM_BYTES = 0x1_0000  # The range of wValue
TAKEN = b"@"  # The reply to a request that returns no data
NOTHING = b"\0"  # The reply when no data is waiting

_HEADER = struct.Struct(">BBHHH")
_WRITE_REPLY = struct.Struct("<HBB")
_WRITE_FAILED = 0x80

_BUFFER = re.compile(rb"[^\x02\x06\x07\n]*(?:[\x06\n]|[\x02\x07][^\r]*\r)")
_LINE = re.compile(rb"[^\r\x06\n]*[\r\x06\n]")


class Direction(IntEnum):
    """Direction of a request's data, seen from the host."""

    DOWNLOAD = 0x40
    UPLOAD = 0xC0


class RequestCode(IntEnum):
    """What is requested of the board."""

    SENDLINE = 0xB0
    GETLINE = 0xB1
    FLUSH = 0xB3
    GETMEM = 0xB4
    SETMEM = 0xB5
    SENDCTRLCHAR = 0xB6
    SETBIT = 0xBA
    SETBITS = 0xBB
    PORT = 0xBE
    GETRESPONSE = 0xBF
    READREADY = 0xC2
    CTRL_RESPONSE = 0xC4
    GETBUFFER = 0xC5
    WRITEBUFFER = 0xC6
    WRITEERROR = 0xC7
    FWDOWNLOAD = 0xCB
    IPADDRESS = 0xE0


class MalformedRequestError(ValueError):
    """Bytes that are not a request. The start of the next one cannot be found."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """One request. `length` is wLength: of the data, or else the maximum length of the reply."""

    direction: Direction
    code: RequestCode
    value: int = 0
    index: int = 0
    length: int = 0
    data: bytes = b""

    def encode(self) -> bytes:
        """Return the request as it is sent."""
        return _HEADER.pack(self.direction, self.code, self.value, self.index, self.length) + self.data

    @property
    def reply_length(self) -> int:
        """Maximum bytes of the reply. Some clients leave the field at 0, or ask for more than possible."""
        return self.length if 0 < self.length < REPLY_LIMIT else REPLY_LIMIT

    @property
    def control_character(self) -> int:
        """The control character in wValue; some clients send it in the other byte.

        Raises MalformedRequestError: it is not one.
        """
        high, low = divmod(self.value, 0x100)
        if min(high, low) or max(high, low) >= 0x20:
            raise MalformedRequestError(f"control character {self.value:#06x}")
        return max(high, low)


@dataclass(frozen=True, slots=True)
class _Form:
    """Whether data follow the header, and the permitted wLength."""

    carries: bool
    lengths: range = range(0x1_0000)


_DOWN, _UP, _CODE = Direction.DOWNLOAD, Direction.UPLOAD, RequestCode
_TEXT = _Form(True, range(DATA_LIMIT + 1))
_MEMORY = range(1, REPLY_LIMIT + 1)
_BARE = _Form(False)

_FORMS: Mapping[tuple[int, int], _Form] = {
    (_DOWN, _CODE.SENDLINE): _TEXT,
    (_UP, _CODE.GETLINE): _BARE,
    (_DOWN, _CODE.FLUSH): _BARE,
    (_UP, _CODE.GETMEM): _Form(False, _MEMORY),
    (_DOWN, _CODE.SETMEM): _Form(True, _MEMORY),
    (_UP, _CODE.SETMEM): _Form(True, _MEMORY),
    (_DOWN, _CODE.SENDCTRLCHAR): _BARE,
    (_DOWN, _CODE.SETBIT): _Form(True, range(4, 5)),
    (_DOWN, _CODE.SETBITS): _Form(True, range(8, 9)),
    (_DOWN, _CODE.PORT): _BARE,
    (_UP, _CODE.PORT): _BARE,
    (_DOWN, _CODE.GETRESPONSE): _TEXT,
    (_UP, _CODE.READREADY): _BARE,
    (_UP, _CODE.CTRL_RESPONSE): _BARE,
    (_UP, _CODE.GETBUFFER): _BARE,
    (_DOWN, _CODE.WRITEBUFFER): _Form(True, range(LINES_LIMIT + 1)),
    (_UP, _CODE.WRITEERROR): _BARE,
    (_DOWN, _CODE.FWDOWNLOAD): _TEXT,
    (_DOWN, _CODE.IPADDRESS): _Form(True, range(4, 5)),
    (_UP, _CODE.IPADDRESS): _BARE,
}
_DIRECTIONS = {direction for direction, _ in _FORMS}
_IN_DPRAM = {_CODE.GETMEM: REPLY_LIMIT, _CODE.SETMEM: REPLY_LIMIT, _CODE.SETBIT: 4, _CODE.SETBITS: 4}
_CONTROL = (_CODE.SENDCTRLCHAR, _CODE.CTRL_RESPONSE)


def take_request(buffer: bytes | bytearray) -> tuple[Request | None, int]:
    """Return the first complete request in `buffer` and the number of bytes that it takes (0 while incomplete).

    Raises MalformedRequestError: as soon as the received bytes cannot become a request.
    """
    if buffer and buffer[0] not in _DIRECTIONS:
        raise MalformedRequestError(f"request type {buffer[0]:#04x}")
    if len(buffer) >= 2 and (buffer[0], buffer[1]) not in _FORMS:
        raise MalformedRequestError(f"request {buffer[1]:#04x} of type {buffer[0]:#04x}")
    if len(buffer) < _HEADER.size:
        return None, 0
    direction, code, value, index, length = _HEADER.unpack_from(buffer)
    form = _FORMS[direction, code]
    if length not in form.lengths:
        raise MalformedRequestError(f"request {code:#04x} with length {length}")
    if value + min(length, _IN_DPRAM.get(code, 0)) > DPRAM_BYTES:
        raise MalformedRequestError(f"request {code:#04x} beyond the DPRAM, at {value}")
    end = _HEADER.size + (length if form.carries else 0)
    if len(buffer) < end:
        return None, 0
    request = Request(
        direction=Direction(direction),
        code=RequestCode(code),
        value=value,
        index=index,
        length=length,
        data=bytes(buffer[_HEADER.size : end]),
    )
    if code in _CONTROL:
        _ = request.control_character
    return request, end


def buffer_length(waiting: bytes | bytearray, most: int, pattern: re.Pattern[bytes] = _BUFFER) -> int:
    """Return how many of the waiting bytes are one reply, 0 while its end may still come.

    It ends with ACK or LF, after a BELL or STX with the next CR, and after `most` bytes at the latest.
    """
    found = pattern.match(waiting, 0, most)
    if found:
        return found.end()
    return most if len(waiting) >= most else 0


def line_length(waiting: bytes | bytearray, most: int) -> int:
    """Return how many of the waiting bytes are one line, 0 while its end may still come."""
    return buffer_length(waiting, most, _LINE)


def write_reply(line_number: int = 0, error_number: int | None = None) -> bytes:
    """Return the reply to WRITEBUFFER: line number, low byte first, ERR number, and 0x80 if there was an error."""
    if error_number is None:
        return _WRITE_REPLY.pack(0, 0, 0)
    return _WRITE_REPLY.pack(line_number, error_number, _WRITE_FAILED)
