"""One host connection of the simulated card: the line discipline, the handshake and the error messages."""

from __future__ import annotations

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.simulator.commands import execute
from drivers.simulator.context import Context
from drivers.simulator.controller import Controller

ACK, BELL, LF, CR = b"\x06", b"\x07", b"\n", b"\r"
CONTROL_A, BACKSPACE, CONTROL_K, CONTROL_X = 0x01, 0x08, 0x0B, 0x18
FIRST_PRINTABLE = 0x20

LINE_LIMIT = 255
"""Characters of one command line."""


class Port:
    """Bytes in, bytes out. `service` is called once a background cycle and does all that has come."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._context = Context(controller)
        self._inbox = bytearray()
        self._line = bytearray()
        self._overlong = False
        self._outbox = bytearray()

    def receive(self, data: bytes) -> None:
        """Take bytes from the host."""
        self._inbox += data

    def take_output(self) -> bytes:
        """Return, and forget, what is to be sent to the host."""
        data = bytes(self._outbox)
        self._outbox.clear()
        return data

    def disconnect(self) -> None:
        """The host is gone: a buffer that it left open is closed, so that others can work."""
        if self._context.fills_buffer:
            self._controller.open_buffer = None

    def service(self) -> None:
        """Act on every byte: control characters at once, lines at their end."""
        if not self._inbox:
            return
        data = bytes(self._inbox)
        self._inbox.clear()
        for byte in data:
            if byte == CR[0]:
                self._end_line()
            elif byte < FIRST_PRINTABLE and byte != 0x09:
                self._control(byte)
            elif len(self._line) < LINE_LIMIT:
                self._line.append(byte)
            else:
                self._overlong = True

    def _control(self, byte: int) -> None:
        if byte == CONTROL_A:
            self._controller.abort_all()
        elif byte == CONTROL_K:
            self._controller.kill_all()
        elif byte == CONTROL_X:
            self._line.clear()
            self._outbox.clear()
            self._overlong = False
        elif byte == BACKSPACE and self._line:
            self._line.pop()

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
