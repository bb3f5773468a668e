"""The interface of a link to a controller, whatever the transport."""

from __future__ import annotations

from enum import StrEnum
from typing import Protocol

from drivers.errors import DriverError

GONE = frozenset(("link.lost", "link.closed", "link.returned"))  # problems after which this link is dead


def is_gone(error: DriverError) -> bool:
    """Whether the link is dead after this error."""
    return any(problem.code in GONE for problem in error.problems)


class StopWay(StrEnum):
    """The route that a stop takes."""

    DIRECT = "direct"
    """The shared connection, directly after whatever is already being sent."""

    RESERVED = "reserved"
    """A connection of its own, so that it never queues after a pending reply."""

    LOST = "lost"
    """A connection of its own was requested but is lost or unanswered: the stop takes the shared one."""


class Link(Protocol):
    """A byte stream in both directions, with a priority path for stops.

    A line that ends in CR is sent, and its reply comes back as text: data lines with their CR, then ACK, or BELL
    ERRnnn CR. Control-X makes the controller discard pending commands and replies.

    All methods raise `LinkError` when the link is lost. `send` and `receive` belong to one thread; `send_urgent`
    may be called from any thread and from a signal handler, and never waits for a reply.
    """

    address: str

    @property
    def checks_bytes(self) -> bool:
        """Whether bytes arrive intact or not at all: checksums protect the whole way to the controller."""

    @property
    def stop_way(self) -> StopWay:
        """Return the route that a stop would take now."""

    def send(self, data: bytes) -> None:
        """Send bytes in order."""

    def receive(self, timeout_s: float) -> bytes:
        """Return the bytes received, waiting at most `timeout_s` of machine time; empty on timeout."""

    def send_urgent(self, data: bytes) -> None:
        """Send a stop, one control character, at once: only what is already being sent goes before it."""

    def close(self) -> None:
        """Close the link. Nothing is sent to the machine."""
