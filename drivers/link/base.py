"""What a link to a controller can do, whatever carries the bytes."""

from __future__ import annotations

from typing import Protocol


class Link(Protocol):
    """A stream of bytes both ways, with a way past everything that waits.

    All methods raise `LinkError` when the link is gone. `send` and `receive` belong to one thread;
    `send_urgent` may be called from any thread and from a signal handler, and never waits for a reply.
    """

    address: str

    def send(self, data: bytes) -> None:
        """Send bytes in order."""

    def receive(self, timeout_s: float) -> bytes:
        """Return what has come, waiting at most `timeout_s` of machine time; empty when nothing came."""

    def send_urgent(self, data: bytes) -> None:
        """Send a stop now, behind no more than what is already being sent."""

    def close(self) -> None:
        """Let go of the link. The machine is not told anything."""
