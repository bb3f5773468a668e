"""One host connection of the simulated card: the line discipline, the handshake and the error messages."""

from __future__ import annotations

import re

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.simulator.commands import execute
from drivers.simulator.context import Context
from drivers.simulator.controller import Controller

ACK, BELL, LF, CR = b"\x06", b"\x07", b"\n", b"\r"
CONTROL_A, BACKSPACE, CONTROL_K, CONTROL_X = b"\x01", b"\x08", b"\x0b", b"\x18"

LINE_LIMIT = 255
"""Characters of one command line."""

LINES_PER_CYCLE = 4
"""Lines of one host that are executed in one background cycle: nobody can keep the card from the others."""

ANSWER_PER_CYCLE = 4096
"""Bytes of answers after which no further line of that host is begun in the same cycle."""

INBOX_LIMIT = 65_536
"""Bytes that may wait to be executed; whoever brings them is to hold back the rest."""

_AT_ONCE = re.compile(b"([\x01\x0b\x18])")
_IGNORED = bytes(byte for byte in range(0x20) if byte not in b"\t\x08\r")


class Port:
    """Bytes in, bytes out. `service` is called once a background cycle."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._context = Context(controller)
        self._fresh = bytearray()
        self._queue = bytearray()
        self._line = bytearray()
        self._overlong = False
        self._outbox = bytearray()

    @property
    def crowded(self) -> bool:
        """Whether more waits to be executed than there should."""
        return len(self._fresh) + len(self._queue) >= INBOX_LIMIT

    def receive(self, data: bytes) -> None:
        """Take bytes from the host."""
        self._fresh += data

    def take_output(self) -> bytes:
        """Return, and forget, what is to be sent to the host."""
        data = bytes(self._outbox)
        self._outbox.clear()
        return data

    def disconnect(self) -> None:
        """The host is gone: a buffer that it left open is closed, so that others can work."""
        if self._context.fills_buffer:
            self._controller.open_buffer = None

    def obey(self) -> None:
        """Act on the control characters that have come, past every line that waits; keep the rest for later."""
        if not self._fresh:
            return
        for part in _AT_ONCE.split(self._fresh):
            if part == CONTROL_A:
                self._controller.abort_all()
            elif part == CONTROL_K:
                self._controller.kill_all()
            elif part == CONTROL_X:
                self._forget()
            else:
                self._queue += part
        self._fresh.clear()

    def service(self) -> None:
        """Act on control characters at once, then execute the next few lines."""
        self.obey()
        said = len(self._outbox)
        for _ in range(LINES_PER_CYCLE):
            if not self._queue or len(self._outbox) - said > ANSWER_PER_CYCLE:
                return
            end = self._queue.find(CR)
            if end < 0:
                self._assemble(bytes(self._queue))
                self._queue.clear()
                return
            self._assemble(bytes(self._queue[:end]))
            del self._queue[: end + 1]
            self._end_line()

    def _forget(self) -> None:
        """Control-X: nothing that came before it is done or answered any more."""
        self._queue.clear()
        self._line.clear()
        self._outbox.clear()
        self._overlong = False

    def _assemble(self, data: bytes) -> None:
        """Add to the line; a backspace takes its last character back, other control characters are nothing."""
        for number, text in enumerate(data.translate(None, _IGNORED).split(BACKSPACE)):
            if number and self._line:
                self._line.pop()
            room = LINE_LIMIT - len(self._line)
            self._overlong = self._overlong or len(text) > room
            self._line += text[:room]

    def _end_line(self) -> None:
        text, overlong = self._line.decode("latin-1"), self._overlong
        self._line.clear()
        self._overlong = False
        self._context.lines.clear()
        error: PmacError | None = None
        try:
            if overlong:
                raise PmacError(ErrorCode.DATA_ERROR, f"a line of more than {LINE_LIMIT} characters")
            execute(text, self._context)
        except PmacError as refused:
            error = refused
        # I3 and I6 may have been changed by this very line; the answer already follows them.
        self._answer(error)

    def _answer(self, error: PmacError | None) -> None:
        handshake = int(self._controller.variables.i(3)) & 3
        lead = LF if handshake in (1, 3) else b""
        for line in self._context.lines:
            self._outbox += lead + line.encode("ascii", "replace") + CR
        if error is not None:
            self._outbox += self._complaint(error, lead)
        elif handshake == 1:
            self._outbox += LF
        elif handshake >= 2:
            self._outbox += ACK

    def _complaint(self, error: PmacError, lead: bytes) -> bytes:
        text = b"ERR%03d" % error.code
        match int(self._controller.variables.i(6)) & 3:
            case 1:
                return BELL + lead + text + CR
            case 3:
                return BELL + CR + lead + text + CR
            case _:
                return BELL
