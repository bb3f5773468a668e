"""A link inside one process: a null modem whose other end runs in simulated time.

Waiting for bytes advances the simulation, so that nothing ever sleeps and every run is repeatable.
"""

from __future__ import annotations

from typing import Protocol

from drivers.link.base import StopWay

LOOK_S = 0.001
"""Simulated time between two polls: well below the background cycle in which the other end answers."""


class Peer(Protocol):
    """The other end of the null modem."""

    def receive(self, data: bytes) -> None:
        """Accept bytes."""

    def take_output(self) -> bytes:
        """Return the bytes sent since the last call."""


class SimulatedTime(Protocol):
    """A clock that is advanced, never slept."""

    def now_s(self) -> float:
        """Return the simulated time."""

    def wait(self, seconds: float) -> None:
        """Advance the clock."""


class MemoryLink:
    """Byte stream to and from a simulated controller."""

    address = "memory"
    stop_way = StopWay.DIRECT
    checks_bytes = True

    def __init__(self, peer: Peer, time: SimulatedTime) -> None:
        self._peer = peer
        self._time = time

    def send(self, data: bytes) -> None:
        """Hand bytes to the simulated controller."""
        self._peer.receive(data)

    def send_urgent(self, data: bytes) -> None:
        """Hand over a stop; the controller reads it in its next background cycle."""
        self._peer.receive(data)

    def receive(self, timeout_s: float) -> bytes:
        """Advance simulated time until bytes arrive, or by `timeout_s`."""
        deadline = self._time.now_s() + timeout_s
        while not (data := self._peer.take_output()):
            left = deadline - self._time.now_s()
            if left <= 0.0:
                break
            self._time.wait(min(left, LOOK_S))
        return data

    def close(self) -> None:
        """Do nothing: there is nothing to close."""
