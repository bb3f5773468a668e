"""What a link to a controller can do, whatever carries the bytes."""

from __future__ import annotations

from enum import StrEnum
from typing import Protocol

GONE = frozenset(("link.lost", "link.closed"))
"""Codes of the problems after which there is nobody to ask any more on this link."""


class StopWay(StrEnum):
    """What a stop goes through."""

    DIRECT = "direct"
    """Where everything goes, directly behind what is already being sent."""

    RESERVED = "reserved"
    """A connection of its own, so that no pending reply is in front of it."""

    LOST = "lost"
    """A connection of its own was asked for, and is gone or not answered: it goes where everything goes."""


class Link(Protocol):
    """A stream of bytes both ways, with a way past everything that waits.

    A line that ends in CR goes out, the text of its reply comes back: data lines with their CR, then ACK, or BELL
    ERRnnn CR. Control-X makes the controller forget what it was asked.

    All methods raise `LinkError` when the link is gone. `send` and `receive` belong to one thread;
    `send_urgent` may be called from any thread and from a signal handler, and never waits for a reply.
    """

    address: str

    @property
    def checks_bytes(self) -> bool:
        """Whether what arrives is what was sent, or nothing: all the way to the controller has checksums."""

    @property
    def stop_way(self) -> StopWay:
        """What a stop would go through now."""

    def send(self, data: bytes) -> None:
        """Send bytes in order."""

    def receive(self, timeout_s: float) -> bytes:
        """Return what has come, waiting at most `timeout_s` of machine time; empty when nothing came."""

    def send_urgent(self, data: bytes) -> None:
        """Send a stop, one control character, now, behind no more than what is already being sent."""

    def close(self) -> None:
        """Let go of the link. The machine is not told anything."""
