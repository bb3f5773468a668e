"""A link that passes everything on to another one: the base of those that hear, trace or replace it."""

from __future__ import annotations

from contextlib import suppress

from drivers.errors import LinkError
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
        """Send a stop on the connection itself; then the links around it note it, and none of them can fail it."""
        around, link = [self], self._link
        while isinstance(link, PassingLink):
            around.append(link)
            link = link._link  # noqa: SLF001 - of the same class
        failure: LinkError | None = None
        try:
            link.send_urgent(data)
        except LinkError as error:
            failure = error
        for each in reversed(around):
            with suppress(Exception):
                each.note_urgent(data, failure)
        if failure is not None:
            raise failure

    def note_urgent(self, data: bytes, failure: LinkError | None) -> None:
        """Note a stop that was sent, or was not because of `failure`."""

    def receive(self, timeout_s: float) -> bytes:
        """Return the bytes received, waiting at most `timeout_s`."""
        return self._link.receive(timeout_s)

    def close(self) -> None:
        """Close the link."""
        self._link.close()
