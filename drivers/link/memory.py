"""A link inside one process: a null modem whose other end lives in simulated time.

Waiting for bytes advances the simulation, so that nothing ever sleeps and a run is the same each time.
"""

from __future__ import annotations

from typing import Protocol

from drivers.link.base import StopWay

LOOK_S = 0.001
"""How far the other end is advanced between two looks: well below the background cycle in which it answers."""


class Peer(Protocol):
    """The other end of the null modem."""

    def receive(self, data: bytes) -> None:
        """Take bytes."""

    def take_output(self) -> bytes:
        """Return what it has sent."""


class SimulatedTime(Protocol):
    """Time that is advanced, never slept."""

    def now_s(self) -> float:
        """Return the simulated time."""

    def wait(self, seconds: float) -> None:
        """Advance it."""


class MemoryLink:
    """Bytes to and from a simulated card."""

    address = "memory"
    stop_way = StopWay.DIRECT
    checks_bytes = True

    def __init__(self, peer: Peer, time: SimulatedTime) -> None:
        self._peer = peer
        self._time = time

    def send(self, data: bytes) -> None:
        """Hand bytes over."""
        self._peer.receive(data)

    def send_urgent(self, data: bytes) -> None:
        """Hand a stop over; the card reads it in its next background cycle."""
        self._peer.receive(data)

    def receive(self, timeout_s: float) -> bytes:
        """Advance simulated time until bytes come, or `timeout_s` of it has passed."""
        deadline = self._time.now_s() + timeout_s
        while not (data := self._peer.take_output()):
            left = deadline - self._time.now_s()
            if left <= 0.0:
                break
            self._time.wait(min(left, LOOK_S))
        return data

    def close(self) -> None:
        """Nothing to let go of."""
