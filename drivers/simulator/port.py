"""One host connection of the simulated card: its line discipline, its queue and its fair share of the card."""

from __future__ import annotations

import re

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.simulator import replies
from drivers.simulator.commands.line import answers, execute
from drivers.simulator.context import Context
from drivers.simulator.control_characters import ACTIONS, control
from drivers.simulator.controller import Controller

CR = 0x0D
BACKSPACE, REPEAT, SUM, RECALL = b"\x08", b"\t", b"\x0e", b"\x19"
CONTROL_X = control("X")

LINE_LIMIT = 255
"""Characters of one command line."""

LINES_PER_TURN = 4
"""Lines of one host that are executed in one go: nobody can keep the card from the others."""

ANSWER_PER_TURN = 4096
"""Bytes of answers after which no further line of that host is begun in the same go."""

LINES_PER_CYCLE = 64
"""Lines of one host that are executed before the next background cycle, however often it has a turn."""

INBOX_LIMIT = 65_536
"""Bytes that may wait to be executed; whoever brings them is to hold back the rest."""

UNREAD_LIMIT = 65_536
"""Bytes that may wait to be read before what programs say is lost on that host."""

_AT_ONCE = re.compile(b"([" + bytes((*ACTIONS, CONTROL_X)) + b"])")
_IN_LINE = re.compile(b"([" + BACKSPACE + REPEAT + SUM + RECALL + b"])")
_KEPT = (CR, *BACKSPACE, *REPEAT, *SUM, *RECALL)
_IGNORED = bytes(byte for byte in range(0x20) if byte not in _KEPT)


class Port:
    """Bytes in, bytes out. `service` is called once a background cycle, and whenever something has come."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._context = Context(controller)
        self._fresh = bytearray()
        self._queue = bytearray()
        self._line = bytearray()
        self._last_line = b""
        self._overlong = False
        self._outbox = bytearray()
        self._cycle = -1
        self._lines_done = 0

    @property
    def crowded(self) -> bool:
        """Whether more waits to be executed than there should."""
        return len(self._fresh) + len(self._queue) >= INBOX_LIMIT

    @property
    def idle(self) -> bool:
        """Whether every line that has come is answered; half a line does not count."""
        return not self._fresh and CR not in self._queue

    @property
    def ready(self) -> bool:
        """Whether `service` would get on with something before the next background cycle."""
        return bool(self._fresh or self._queue) and self._may_go_on()

    def receive(self, data: bytes) -> None:
        """Take bytes from the host."""
        self._fresh += data

    def take_output(self) -> bytes:
        """Return, and forget, what is to be sent to the host."""
        data = bytes(self._outbox)
        self._outbox.clear()
        return data

    def announce(self, said: bytes) -> None:
        """Tell the host something that it has not asked for. It comes between two replies, or is lost."""
        if len(self._outbox) < UNREAD_LIMIT:
            self._outbox += said

    def disconnect(self) -> None:
        """The host is gone: a buffer that it left open is closed, so that others can work."""
        if self._context.fills_buffer:
            self._controller.open_buffer = None

    def obey(self) -> None:
        """Act on the control characters that have come, past every line that waits; keep the rest for later."""
        if not self._fresh:
            return
        parts = _AT_ONCE.split(self._fresh)
        self._fresh.clear()
        for number, part in enumerate(parts):
            if number % 2 == 0:
                self._queue += part.translate(None, _IGNORED)
            elif part[0] == CONTROL_X:
                self._forget()
            else:
                self._act(part[0])

    def service(self) -> None:
        """Act on control characters at once, then execute the next few lines."""
        self.obey()
        said = len(self._outbox)
        for _ in range(LINES_PER_TURN):
            if not self._queue or len(self._outbox) - said > ANSWER_PER_TURN or not self._may_go_on():
                return
            end = self._queue.find(CR)
            if end < 0:
                self._assemble(bytes(self._queue))
                self._queue.clear()
                return
            self._assemble(bytes(self._queue[:end]))
            del self._queue[: end + 1]
            self._end_line()

    def _may_go_on(self) -> bool:
        """Whether this host has a line left in this cycle. A line that comes alone is nobody's flood."""
        if self._cycle != self._controller.cycles:
            self._cycle, self._lines_done = self._controller.cycles, 0
        return self._lines_done < LINES_PER_CYCLE or self._queue.find(CR) in (-1, len(self._queue) - 1)

    def _act(self, code: int) -> None:
        how = replies.wording(self._controller.variables)
        try:
            said = ACTIONS[code](self._context)
        except PmacError as refusal:
            self._outbox += replies.refused(refusal.code, how)
            return
        if said is not None and answers(self._context):
            self._outbox += replies.data((said,), how)

    def _forget(self) -> None:
        """Control-X: nothing that came before it is done or answered any more."""
        self._queue.clear()
        self._line.clear()
        self._outbox.clear()
        self._overlong = False
        if self._controller.variables.i(63):
            self._outbox.append(CONTROL_X)

    def _assemble(self, data: bytes) -> None:
        """Add to the line; a few control characters are about the line itself."""
        for part in _IN_LINE.split(data):
            if part == BACKSPACE:
                del self._line[-1:]
            elif part == SUM:
                self._outbox.append(replies.checksum(self._line))
            elif part == RECALL:
                last = self._last_line.decode("latin-1")
                self._outbox += replies.data((last,), replies.wording(self._controller.variables))
            elif part == REPEAT and not self._line and not self._context.fills_buffer:
                self._line += self._last_line
                self._end_line()
            else:
                room = LINE_LIMIT - len(self._line)
                self._overlong = self._overlong or len(part) > room
                self._line += part[:room]

    def _end_line(self) -> None:
        line, overlong = bytes(self._line), self._overlong
        self._line.clear()
        self._overlong = False
        self._last_line = line or self._last_line
        self._lines_done += 1
        context = self._context
        context.lines.clear()
        error: PmacError | None = None
        heard = answers(context)
        try:
            if overlong:
                raise PmacError(ErrorCode.DATA_ERROR, f"a line of more than {LINE_LIMIT} characters")
            heard = execute(line.decode("latin-1"), context)
        except PmacError as refused:
            error = refused
        # I3, I4 and I6 may have been changed by this very line; the answer already follows them.
        how = replies.wording(self._controller.variables)
        self._outbox += replies.data(context.lines, how)
        if error is not None:
            self._outbox += replies.refused(error.code, how)
        elif heard:
            self._outbox += replies.accepted(line, how)
