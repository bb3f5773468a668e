"""Hear the bytes of a link as they pass, at the cost of one call each: for a recorder in another thread."""

from __future__ import annotations

from collections.abc import Callable

from drivers.errors import LinkError
from drivers.link.base import Link, StopWay

Tap = Callable[[str, bytes], object]
"""Takes a mark as in a trace (`>`, `<`, `!` a stop, `*` a failure) and bytes; returns at once, never raises."""


class TappedLink:
    """Passes everything on to `link` first, then to `tap`, perhaps from a signal handler."""

    def __init__(self, link: Link, tap: Tap) -> None:
        self.address = link.address
        self._link, self._tap = link, tap

    @property
    def checks_bytes(self) -> bool:
        """Whether what arrives is what was sent."""
        return self._link.checks_bytes

    @property
    def stop_way(self) -> StopWay:
        """Return the route that a stop would take now."""
        return self._link.stop_way

    def send(self, data: bytes) -> None:
        """Send bytes in order."""
        try:
            self._link.send(data)
        except LinkError as error:
            self._tap("*", error.problems[0].code.encode())
            raise
        self._tap(">", data)

    def send_urgent(self, data: bytes) -> None:
        """Send a stop now."""
        try:
            self._link.send_urgent(data)
        except LinkError as error:
            self._tap("*", error.problems[0].code.encode())
            raise
        self._tap("!", data)

    def receive(self, timeout_s: float) -> bytes:
        """Return the bytes received, waiting at most `timeout_s`."""
        try:
            data = self._link.receive(timeout_s)
        except LinkError as error:
            self._tap("*", error.problems[0].code.encode())
            raise
        if data:
            self._tap("<", data)
        return data

    def close(self) -> None:
        """Close the link."""
        self._link.close()
