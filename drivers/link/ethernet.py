"""A link to the Ethernet board of a controller: converts lines to requests, and replies back to a dialogue."""

from __future__ import annotations

import re
import threading
import time
from collections import deque
from enum import Enum, auto

from drivers.errors import LinkError, LinkTimeoutError
from drivers.link.address import EthernetAddress
from drivers.link.base import StopWay
from drivers.link.connection import Connection
from drivers.pmac.ethernet import NOTHING, REPLY_LIMIT, TAKEN, Direction, Request, RequestCode, buffer_length
from profiles.problem import Problem

REPLY_WAIT_S = 2.0  # for the previous reply: the board mixes up the replies to two lines at a time
LEAST_WAIT_S = 0.3  # the same where its reader did not wait any longer: in motion a stop waits for the outcome
QUIET_S = 0.1  # a shorter reading is no wait for a reply
OPENING_S = 2.0  # for the first answer; a network accepts connections that no board serves
ANSWER_S = 1.0  # how long the board may take to answer a stop; after that the stop may not have been received
URGENT_WAIT_S = 0.02  # of a stop, for another thread that is handing over a request
FLUSH = b"\x18"

_PARTS = re.compile(rb"[\r\n\x18]|[^\r\n\x18]+")
_GET_BUFFER = Request(direction=Direction.UPLOAD, code=RequestCode.GETBUFFER, length=REPLY_LIMIT)
_FLUSH = Request(direction=Direction.DOWNLOAD, code=RequestCode.FLUSH)
_READY = Request(direction=Direction.UPLOAD, code=RequestCode.READREADY, length=2)
ACK, LF, BELL = b"\x06", b"\n", b"\x07"
FLUSHED = (TAKEN[0], 0x18)  # after a flush: the manual's control-X, or what real boards send
_STOP_ANSWERS = (ACK, LF, NOTHING)


class StopConnection:
    """Carries nothing but stops, so that none queues after a pending reply.

    Used from any thread and from signal handlers: when two of them read at the same time, one answer serves both.
    """

    def __init__(self, connection: Connection) -> None:
        """Ask the board, without side effects, whether there is anything to read, and wait for its answer.

        Raises LinkError: `link.no_answer`, the board does not serve it; `link.lost`, `link.closed`.
        """
        self._connection, self._alive = connection, True
        self._asked_s: float | None = None
        try:
            connection.write_whole(_READY.encode())
            if not connection.receive(OPENING_S):
                raise LinkError(Problem(code="link.no_answer", value=f"{OPENING_S:g} s"))
        except LinkError:
            connection.close()
            raise

    @property
    def works(self) -> bool:
        """Whether the connection is open and every stop was answered in time."""
        asked_s = self._asked_s
        return self._alive and (asked_s is None or time.monotonic() - asked_s <= ANSWER_S)

    def send(self, frame: bytes) -> bool:
        """Send a stop; return whether that suffices: it was sent, and nothing suggests that it is not received."""
        self.look()
        will_do = self._alive and self._asked_s is None
        if self._alive:
            self._asked_s = self._asked_s or time.monotonic()
            try:
                self._connection.write_whole(frame)
            except LinkError:
                self._alive = will_do = False
        return will_do

    def look(self) -> None:
        """Read the board's answers and detect a lost connection."""
        try:
            while self._alive and self._connection.receive():
                self._asked_s = None
        except LinkError:
            self._alive = False

    def close(self) -> None:
        """Close the connection."""
        self._alive = False
        self._connection.close()


class RequestPurpose(Enum):
    """The purpose of a request."""

    LINE = auto()
    STOP = auto()
    MORE = auto()
    FLUSH = auto()


class BoardReplies:
    """Match the replies of the board to the requests of one connection: bytes in, text for the host out.

    The board keeps the controller's output in one queue, and each request fetches the next piece of it: up to an
    ACK or LF, with a BELL or STX up to the next CR, 1400 bytes at most, one NUL if there is nothing. Pieces are
    counted by the requests, answers by their ends. So the answer to a stop is distinguished from that to the line
    before it, however the network splits the bytes, and wherever in a long answer the stop came.

    `record_request` may be called from any thread, before the request is sent; the rest belongs to the reading
    thread.
    """

    def __init__(self) -> None:
        self._asked: deque[RequestPurpose] = deque()
        self._owed: deque[RequestPurpose] = deque()
        self._pieces = 0
        self._flushes = 0
        self._piece = bytearray()
        self._passed_on = 0

    def record_request(self, what: RequestPurpose) -> None:
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
            if what is RequestPurpose.FLUSH:
                self._owed.clear()
                self._pieces = 0
                self._begin_piece()
                self._flushes += 1
            else:
                self._pieces += 1
                if what is not RequestPurpose.MORE:
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
        of_stop = bool(self._owed) and self._owed[0] is RequestPurpose.STOP
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


class EthernetLink:
    """Sends one request at a time, except stops: they follow at once, as whole requests of their own.

    If the address reserves it, stops have a second connection. Use that only where the board has been seen to obey
    on it.
    """

    checks_bytes = True

    def __init__(self, address: EthernetAddress) -> None:
        """Connect; errors as for `Connection`, and `link.no_stop_connection`: the second one was refused."""
        self.address = str(address)
        self._replies = BoardReplies()
        # Re-entrant: a signal handler may interrupt the very thread that holds it, and must not block.
        self._requests = threading.RLock()
        self._line = b""
        self._asked_last = ""
        self._said = b""
        self._patience_s: float | None = None  # of whoever has read since the last line; None where nobody has
        self._connection = Connection(address.host, address.port, self.address)
        self._stops = self._reserve(address) if address.reserves_stop else None

    @property
    def stop_way(self) -> StopWay:
        """Return the route that a stop would take now; `LOST` is detected from received data and from timeouts."""
        if self._stops is None:
            return StopWay.DIRECT
        return StopWay.RESERVED if self._stops.works else StopWay.LOST

    def send(self, data: bytes) -> None:
        """Send lines that end in CR, each after the previous reply; control-X flushes at once.

        Raises:
            LinkTimeoutError: `link.silent`, the previous line was not answered; this one was not sent.
            LinkError: `link.lost`, `link.closed`.
        """
        for part in _PARTS.findall(data):
            if part == b"\r":
                line, self._line = self._line, b""
                self._await_replies()
                self._patience_s = None
                self._asked_last = line.decode("latin-1")
                self._request(_get_response(line), RequestPurpose.LINE)
            elif part == FLUSH:
                self._line = b""
                self._asked_last = "^X"
                self._request(_FLUSH, RequestPurpose.FLUSH)
            elif part != b"\n":
                self._line += part

    def send_urgent(self, data: bytes) -> None:
        """Send a stop on its own connection, or after the request in flight. Raises LinkError: `link.lost`."""
        stop = _get_response(data)
        if self._stops is None or not self._stops.send(stop.encode()):
            self._request(stop, RequestPurpose.STOP)

    def receive(self, timeout_s: float) -> bytes:
        """Return the reply text within `timeout_s`. Raises LinkError: `link.lost`, `link.closed`."""
        if timeout_s > QUIET_S:
            self._patience_s = max(timeout_s, self._patience_s or 0.0)
        deadline = time.monotonic() + timeout_s
        while not self._said:
            left_s = deadline - time.monotonic()
            self._read(left_s)
            if left_s <= 0.0:
                break
        said, self._said = self._said, b""
        return said

    def close(self) -> None:
        """Close the connections."""
        self._connection.close()
        if self._stops is not None:
            self._stops.close()

    def _reserve(self, address: EthernetAddress) -> StopConnection:
        try:
            return StopConnection(Connection(address.host, address.port, self.address))
        except LinkError as error:
            self._connection.close()
            reason = error.problems[0]
            value = reason.value or reason.code
            problem = Problem(code="link.no_stop_connection", where=self.address, value=value)
            raise LinkError(problem) from error

    def _await_replies(self) -> None:
        """Wait for the replies of what was sent, no longer than their reader was ready to wait for them."""
        patience_s = REPLY_WAIT_S if self._patience_s is None else max(self._patience_s, LEAST_WAIT_S)
        wait_s = min(patience_s, REPLY_WAIT_S)
        deadline = time.monotonic() + wait_s
        while not self._replies.complete:
            left_s = deadline - time.monotonic()
            if left_s <= 0.0:
                limit = f"{wait_s:g} s"
                raise LinkTimeoutError(
                    Problem(code="link.silent", where=self.address, key=self._asked_last, value=limit)
                )
            self._read(left_s)

    def _read(self, timeout_s: float) -> None:
        if self._stops is not None:
            self._stops.look()
        self._said += self._replies.take(self._connection.receive(timeout_s))
        if self._replies.wants_more:
            self._request(_GET_BUFFER, RequestPurpose.MORE)

    def _request(self, request: Request, what: RequestPurpose) -> None:
        """Send a whole request. Requests are recorded in the order of sending."""
        held = self._requests.acquire(timeout=URGENT_WAIT_S)
        try:
            self._replies.record_request(what)
            self._connection.write_whole(request.encode())
        finally:
            if held:
                self._requests.release()


def _get_response(data: bytes) -> Request:
    return Request(direction=Direction.DOWNLOAD, code=RequestCode.GETRESPONSE, length=len(data), data=data)
