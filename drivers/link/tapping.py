"""Hear the bytes of a link as they pass, at the cost of one call each: for a recorder in another thread."""

from __future__ import annotations

from collections.abc import Callable

from drivers.errors import LinkError
from drivers.link.base import Link
from drivers.link.passing import PassingLink

Tap = Callable[[str, bytes], object]
"""Takes a mark as in a trace (`>`, `<`, `!` a stop, `*` a failure) and bytes; returns at once, never raises."""


class TappedLink(PassingLink):
    """Passes everything on to `link` first, then to `tap`, perhaps from a signal handler."""

    def __init__(self, link: Link, tap: Tap) -> None:
        super().__init__(link)
        self._tap = tap

    def send(self, data: bytes) -> None:
        """Send bytes in order."""
        try:
            super().send(data)
        except LinkError as error:
            self._tap("*", error.problems[0].code.encode())
            raise
        self._tap(">", data)

    def send_urgent(self, data: bytes) -> None:
        """Send a stop now."""
        try:
            super().send_urgent(data)
        except LinkError as error:
            self._tap("*", error.problems[0].code.encode())
            raise
        self._tap("!", data)

    def receive(self, timeout_s: float) -> bytes:
        """Return the bytes received, waiting at most `timeout_s`."""
        try:
            data = super().receive(timeout_s)
        except LinkError as error:
            self._tap("*", error.problems[0].code.encode())
            raise
        if data:
            self._tap("<", data)
        return data
