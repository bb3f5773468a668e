"""Hear the bytes of a link as they pass, at the cost of one call each: for a recorder in another thread."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

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

    def _tell(self, mark: str, data: bytes) -> None:
        with suppress(Exception):  # what cannot be recorded is still sent, received and obeyed
            self._tap(mark, data)

    def send(self, data: bytes) -> None:
        """Send bytes in order."""
        try:
            super().send(data)
        except LinkError as error:
            self._tell("*", error.problems[0].code.encode())
            raise
        self._tell(">", data)

    def note_urgent(self, data: bytes, failure: LinkError | None) -> None:
        """Tell the tap of a stop."""
        if failure is None:
            self._tell("!", data)
        else:
            self._tell("*", failure.problems[0].code.encode())

    def receive(self, timeout_s: float) -> bytes:
        """Return the bytes received, waiting at most `timeout_s`."""
        try:
            data = super().receive(timeout_s)
        except LinkError as error:
            self._tell("*", error.problems[0].code.encode())
            raise
        if data:
            self._tell("<", data)
        return data
