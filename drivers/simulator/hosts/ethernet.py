"""The Ethernet board of the simulated controller: requests in, each answered by one reply, strictly in order.

The board writes lines to a port of the controller and stores the output, in a queue for each client, until a
request fetches it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator

from drivers.pmac.ethernet import (
    DPRAM_BYTES,
    NOTHING,
    REPLY_LIMIT,
    TAKEN,
    Direction,
    MalformedRequestError,
    Request,
    RequestCode,
    buffer_length,
    line_length,
    take_request,
    write_reply,
)
from drivers.simulator.commands.status import CONTROL_X
from drivers.simulator.faults.lines import LineDirection
from drivers.simulator.hosts.connection import UNREAD_LIMIT, PlainStream
from drivers.simulator.hosts.port import INBOX_LIMIT, Port
from drivers.simulator.machine import SimulatedLathe

FACTORY_ADDRESS = bytes((192, 6, 94, 5))
BELL, CR = b"\x07", b"\r"
REQUESTS_PER_TURN = 4  # maximum requests of one client per turn: none can block the board for the others
_ERROR = re.compile(rb"ERR(\d{3})")
Steps = Generator[None, None, bytes]  # one request in steps, between which it waits; returns the reply


class Board:
    """The DPRAM and the settings of one board, shared by all its clients."""

    def __init__(self) -> None:
        self.dpram = bytearray(DPRAM_BYTES)
        self.ip_address = FACTORY_ADDRESS

    def answer(self, request: Request) -> bytes | None:
        """Return the reply, None when the request is for the controller."""
        place, data = request.value, request.data
        match request.code:
            case RequestCode.GETMEM:
                return bytes(self.dpram[place : place + request.length])
            case RequestCode.SETMEM:
                self.dpram[place : place + len(data)] = data
            case RequestCode.SETBIT if request.index:
                self._change_word(place, to_set=data)
            case RequestCode.SETBIT:
                self._change_word(place, to_keep=data)
            case RequestCode.SETBITS:
                to_clear = int.from_bytes(data[4:], "little")
                self._change_word(place, to_set=data[:4], to_keep=(~to_clear & 0xFFFF_FFFF).to_bytes(4, "little"))
            case RequestCode.IPADDRESS:
                # A new address is stored; it would take effect after the next power-up.
                self.ip_address = data if request.direction == Direction.DOWNLOAD else self.ip_address
                return self.ip_address
            case RequestCode.FWDOWNLOAD:
                pass  # firmware is accepted, but the old one keeps running
            case _:
                return None
        return TAKEN

    def _change_word(self, place: int, to_set: bytes = bytes(4), to_keep: bytes = b"\xff" * 4) -> None:
        for number, (one, kept) in enumerate(zip(to_set, to_keep, strict=True), place):
            self.dpram[number] = (self.dpram[number] | one) & kept


class EthernetSession(PlainStream):
    """The requests and the response queue of one client."""

    def __init__(self, lathe: SimulatedLathe, port: Port, board: Board) -> None:
        super().__init__(lathe, port)
        port.on_board = True
        self._way_in = LineDirection(port.lines, inward=True)
        self._way_out = LineDirection(port.lines, inward=False)
        self._board = board
        self._received = bytearray()
        self._incomplete = True
        self._held = False
        self._work: Steps | None = None
        self._queue = bytearray()
        self._last_write = write_reply()

    @property
    def crowded(self) -> bool:
        """Whether more input is pending than allowed."""
        return len(self._received) + self._way_in.waiting >= INBOX_LIMIT or self._port.crowded

    @property
    def busy(self) -> bool:
        """Whether another turn could make progress."""
        if self._port.lines.silent:
            return False
        if self._work is not None:
            return self._port.idle or self._port.ready
        return not (self._incomplete or self._held) or self._port.ready

    @property
    def idle(self) -> bool:
        """Whether every complete request has been answered; a part of one does not count."""
        if self._way_in.waiting or self._way_out.waiting:
            return False
        return self._work is None and self._incomplete and self._port.idle

    def receive(self, data: bytes) -> None:
        """Accept bytes from the client. A controller that is shut down discards them."""
        if not self._port.lines.dead:
            self._received += b"".join(self._way_in.carry((data,)))

    def turn(self) -> list[bytes]:
        """Process the requests; return what has arrived at the client, each item to be sent in one go.

        Raises MalformedRequestError: the client's input is not a request.
        """
        if self._port.lines.silent:
            return []
        self._received += b"".join(self._way_in.carry(()))
        return self._way_out.carry(self._replies())

    def _replies(self) -> list[bytes]:
        replies: list[bytes] = []
        try:
            while len(replies) < REQUESTS_PER_TURN and (reply := self._step()) is not None:
                replies.append(reply)
                if self._port.share.heavy:
                    break
        except MalformedRequestError:
            if not replies:
                raise
            # Earlier requests are answered first; the next turn raises it again.
        if self._work is None:
            self._listen()
        return replies

    def _step(self) -> bytes | None:
        """Continue the request in work, or begin the next one; return the reply when it is done."""
        if self._work is None:
            request, used = take_request(self._received)
            self._incomplete = request is None
            # With others after it, a request waits for its share as the lines of a queue do.
            self._held = used < len(self._received) and self._port.share.cycle_over
            if request is None or self._held:
                return None
            del self._received[:used]
            reply = self._board.answer(request)
            if reply is not None:
                return reply
            self._work = self._answer(request)
        try:
            next(self._work)
        except StopIteration as done:
            self._work = None
            return bytes(done.value)
        return None

    def _answer(self, request: Request) -> Steps:  # noqa: C901 - one branch a case
        match request.code:
            case RequestCode.GETRESPONSE:
                self._port.type(_line_of(request))
                return (yield from self._fetch(buffer_length, REPLY_LIMIT))
            case RequestCode.SENDLINE:
                self._port.type(_line_of(request))
            case RequestCode.GETBUFFER:
                return (yield from self._fetch_without_waiting_for_save(buffer_length, request.reply_length))
            case RequestCode.GETLINE:
                return (yield from self._fetch_without_waiting_for_save(line_length, request.reply_length))
            case RequestCode.READREADY:
                self._listen()
                return b"\1\0" if self._queue else b"\0\0"
            case RequestCode.CTRL_RESPONSE:
                yield from self._type(bytes([request.control_character]))
                return self._take(request.reply_length)
            case RequestCode.SENDCTRLCHAR:
                yield from self._type(bytes([request.control_character]))
            case RequestCode.FLUSH:
                yield from self._type(bytes([CONTROL_X]))
                self._queue.clear()
            case RequestCode.PORT if request.direction == Direction.UPLOAD:
                self._listen()
                return self._take(1)
            case RequestCode.PORT:
                yield from self._type(bytes([request.index & 0xFF]))
            case RequestCode.WRITEBUFFER:
                self._last_write = yield from self._write_buffer(request)
                return self._last_write
            case RequestCode.WRITEERROR:
                return self._last_write
            case _:
                raise NotImplementedError(request.code.name)
        return TAKEN

    def _write_buffer(self, request: Request) -> Steps:
        """Write line by line up to the first error. The replies are for the board, not for the client."""
        yield from self._type(b"")
        kept, self._queue = self._queue, bytearray()
        reply = write_reply()
        for number, line in enumerate(_lines_of(request), 1):
            yield from self._type(line + CR)
            if BELL in self._queue:
                error = _ERROR.search(self._queue)
                reply = write_reply(number, int(error[1]) if error else 0)
                break
            self._queue.clear()
        self._queue = kept
        return reply

    def _type(self, data: bytes) -> Generator[None, None, None]:
        """Pass input to the controller and wait until every line is answered."""
        self._port.type(data)
        self._listen()
        while not self._port.idle:
            yield
            self._listen()

    def _fetch(self, length: Callable[[bytearray, int], int], most: int) -> Steps:
        """Take a reply from the queue once it is complete, or once the controller has nothing more to send."""
        self._listen()
        while not (end := length(self._queue, most)) and not self._port.idle:
            yield
            self._listen()
        return self._take(end or most)

    def _fetch_without_waiting_for_save(self, length: Callable[[bytearray, int], int], most: int) -> Steps:
        """Take what there is, as `_fetch`; during a SAVE the board does not wait for the controller."""
        self._listen()
        if self._port.saving:
            return self._take(length(self._queue, most))
        return (yield from self._fetch(length, most))

    def _take(self, most: int) -> bytes:
        data = bytes(self._queue[:most])
        del self._queue[:most]
        return data or NOTHING

    def _listen(self) -> None:
        """Let the controller execute the next few lines, and store its output while there is room."""
        self._lathe.attend(self._port)
        said = self._port.take_said()
        if len(self._queue) <= UNREAD_LIMIT:
            self._queue += said


def _line_of(request: Request) -> bytes:
    """Return the line with the CR that the board adds, without the NUL that some clients send."""
    return request.data.partition(b"\0")[0] + CR


def _lines_of(request: Request) -> list[bytes]:
    """Return the lines; a NUL ends one, and may be missing after the last."""
    lines = request.data.split(b"\0")
    return lines if lines[-1] else lines[:-1]
