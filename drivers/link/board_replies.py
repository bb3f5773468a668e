"""Match the replies of a controller's Ethernet board to requests: bytes in, text for the host out.

The board keeps the controller's output in one queue, and each request fetches the next piece of it: up to an ACK
or LF, with a BELL or STX up to the next CR, 1400 bytes at most, one NUL if there is nothing. Pieces are counted by
the requests, answers by their ends. So the answer to a stop is distinguished from that to the line before it,
however the network splits the bytes, and wherever in a long answer the stop came.

`asked` may be called from any thread, before the request is sent; everything else belongs to the reading thread.
"""

from __future__ import annotations

from collections import deque
from enum import Enum, auto

from drivers.pmac.ethernet import NOTHING, REPLY_LIMIT, TAKEN, buffer_length

ACK, LF, BELL = b"\x06", b"\n", b"\x07"
FLUSHED = (TAKEN[0], 0x18)  # after a flush: the manual's control-X, or what real boards send
_STOP_ANSWERS = (ACK, LF, NOTHING)


class Asked(Enum):
    """The purpose of a request."""

    LINE = auto()
    STOP = auto()
    MORE = auto()
    FLUSH = auto()


class BoardReplies:
    """Reply bookkeeping of one connection."""

    def __init__(self) -> None:
        self._asked: deque[Asked] = deque()
        self._owed: deque[Asked] = deque()
        self._pieces = 0
        self._flushes = 0
        self._piece = bytearray()
        self._passed_on = 0

    def asked(self, what: Asked) -> None:
        """Record a request, in the order of sending."""
        self._asked.append(what)

    @property
    def complete(self) -> bool:
        """Whether every request has been answered."""
        self._follow()
        return not (self._owed or self._pieces or self._flushes)

    @property
    def wants_more(self) -> bool:
        """Whether an answer continues and the rest has not been requested yet."""
        self._follow()
        return bool(self._owed) and not (self._pieces or self._flushes)

    def take(self, data: bytes) -> bytes:
        """Return the part of these bytes that is for the host."""
        self._follow()
        said = bytearray()
        while data:
            if self._flushes:
                data = self._discard(data)
            elif self._pieces:
                data = self._go_on(data, said)
            else:
                said += data  # unsolicited: the host must see it
                break
        return bytes(said)

    def _follow(self) -> None:
        while self._asked:
            what = self._asked.popleft()
            if what is Asked.FLUSH:
                self._owed.clear()
                self._pieces = 0
                self._begin_piece()
                self._flushes += 1
            else:
                self._pieces += 1
                if what is not Asked.MORE:
                    self._owed.append(what)

    def _discard(self, data: bytes) -> bytes:
        """Drop output from before the flush."""
        for place, byte in enumerate(data):
            if byte in FLUSHED:
                self._flushes -= 1
                return data[place + 1 :]
        return b""

    def _go_on(self, data: bytes, said: bytearray) -> bytes:
        """Append to the current piece; return the bytes after it."""
        self._piece += data
        nothing = self._piece.startswith(NOTHING)
        length = len(NOTHING) if nothing else buffer_length(self._piece, REPLY_LIMIT)
        end = length or len(self._piece)
        piece, rest = bytes(self._piece[:end]), bytes(self._piece[end:])
        of_stop = bool(self._owed) and self._owed[0] is Asked.STOP
        if not of_stop:
            said += piece[self._passed_on :]
            self._passed_on = end
        if length:
            self._end_piece(piece, said, of_stop=of_stop)
        return rest

    def _end_piece(self, piece: bytes, said: bytearray, *, of_stop: bool) -> None:
        self._pieces -= 1
        self._begin_piece()
        if of_stop and piece not in _STOP_ANSWERS:
            said += NOTHING  # not the answer to a stop: the host must resynchronise
        # A piece that ends with the CR after an STX is a message; a full one, or one without an end, continues.
        ended = piece == NOTHING or piece.endswith((ACK, LF)) or BELL in piece
        if ended and self._owed:
            self._owed.popleft()

    def _begin_piece(self) -> None:
        self._piece.clear()
        self._passed_on = 0
