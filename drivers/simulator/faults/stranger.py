"""Another host of the controller, unknown to the others: it sends one line, reads the reply, and disconnects."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Protocol

from drivers.errors import LinkError

if TYPE_CHECKING:
    from drivers.simulator.hosts.port import Port

_CONTROL = re.compile(r"\^[A-Z]")
"""A control character in caret notation: no line begins like that."""

_NAMES = {0x00: "NUL", 0x02: "STX", 0x06: "ACK", 0x07: "BEL", 0x0A: "LF", 0x0D: "CR"}


class Card(Protocol):
    """The controller as a host sees it."""

    def connect(self) -> Port:
        """Plug it in."""

    def attend(self, port: Port) -> None:
        """Let the controller serve it now."""

    def forget(self, port: Port) -> None:
        """Unplug it without notifying the controller."""


class Stranger:
    """A host like any other: faults of the controller, or of its lines, affect it, too.

    `told` is the outcome of its line.
    """

    def __init__(self, card: Card) -> None:
        self.told = ""
        self._card = card
        self._port: Port | None = None
        self._heard = b""

    def write(self, line: str) -> None:
        """Send a line; `^A` sends control-A, and likewise for each other letter."""
        try:
            self._port = self._card.connect()
        except LinkError:
            self.told = "the stranger cannot be connected: the cable is cut"
            return
        self._port.receive(_as_sent(line))
        self._card.attend(self._port)

    def answered(self) -> bool:
        """Whether it has finished."""
        if self._port is None:
            return True
        if self._port.lost:
            self.told = "the stranger is cut off"
            return True
        self._heard += self._port.take_said()
        if not self._port.idle:
            return False
        self.told = _in_words(self._heard)
        return True

    def leave(self) -> None:
        """Disconnect; a buffer that it has opened stays open, and an unread line is lost."""
        if self._port is not None:
            self._card.forget(self._port)
            self._port = None


def _as_sent(line: str) -> bytes:
    if _CONTROL.fullmatch(line):
        return bytes((ord(line[1]) - ord("@"),))
    return line.encode("ascii") + b"\r"


def _in_words(heard: bytes) -> str:
    """Return the reply as one line of text: `25<CR><ACK>`."""
    text = "".join(chr(code) if 0x20 <= code < 0x7F else f"<{_NAMES.get(code, f'{code:02X}')}>" for code in heard)
    number = re.search(rb"\x07(ERR\d+)?", heard)
    if number is None:
        return f"the stranger was told: {text or 'nothing'}"
    return f"the stranger was refused: {number[1].decode() if number[1] else text}"
