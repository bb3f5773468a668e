"""A link that passes everything on to another one: the base of those that hear, trace or replace it."""

from __future__ import annotations

from drivers.link.base import Link, StopWay


class PassingLink:
    """Passes everything on to `link`."""

    def __init__(self, link: Link) -> None:
        self.address = link.address
        self._link = link

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
        self._link.send(data)

    def send_urgent(self, data: bytes) -> None:
        """Send a stop now."""
        self._link.send_urgent(data)

    def receive(self, timeout_s: float) -> bytes:
        """Return the bytes received, waiting at most `timeout_s`."""
        return self._link.receive(timeout_s)

    def close(self) -> None:
        """Close the link."""
        self._link.close()
