"""A link inside one process: a null modem whose other end runs in simulated time.

Waiting for bytes advances the simulation, so that nothing ever sleeps and every run is repeatable.
"""

from __future__ import annotations

from typing import Protocol

from drivers.clock import Clock
from drivers.link.base import StopWay

POLL_S = 0.001  # simulated time: well below the background cycle in which the other end answers


class Peer(Protocol):
    """The other end of the null modem."""

    def receive(self, data: bytes) -> None:
        """Accept bytes."""

    def take_output(self) -> bytes:
        """Return the bytes sent since the last call."""


class MemoryLink:
    """Byte stream to and from a simulated controller."""

    address = "memory"
    stop_way = StopWay.DIRECT
    checks_bytes = True

    def __init__(self, peer: Peer, clock: Clock) -> None:
        self._peer, self._clock = peer, clock

    def send(self, data: bytes) -> None:
        """Hand bytes to the simulated controller."""
        self._peer.receive(data)

    def send_urgent(self, data: bytes) -> None:
        """Hand over a stop; the controller reads it in its next background cycle."""
        self._peer.receive(data)

    def receive(self, timeout_s: float) -> bytes:
        """Advance simulated time until bytes arrive, or by `timeout_s`."""
        deadline = self._clock.now_s() + timeout_s
        while not (data := self._peer.take_output()):
            left = deadline - self._clock.now_s()
            if left <= 0.0:
                break
            self._clock.wait(min(left, POLL_S))
        return data

    def close(self) -> None:
        """Do nothing: there is nothing to close."""
