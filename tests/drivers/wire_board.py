"""A client of the Ethernet board that knows nothing but bytes."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from drivers.pmac.dialect import Dialect
from drivers.simulator.hosts.ethernet import Board, EthernetSession
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile

DOWN, UP = 0x40, 0xC0
CYCLE_S = 0.005
"""A little more than one background cycle of the bundled machine."""


@dataclass(frozen=True, kw_only=True)
class BoardWire:
    """One connection; a host of the ASCII line may stand beside it."""

    sim: SimulatedLathe
    session: EthernetSession

    def raw(self, sent: bytes, most_cycles: int = 2000) -> list[bytes]:
        """Send bytes and return the replies, each as it is sent. Time passes only where the card wants it to."""
        self.session.receive(sent)
        replies = self.session.turn()
        for _ in range(most_cycles):
            if not self.session.busy:
                if replies:
                    return replies
                self.sim.wait(CYCLE_S)
            replies += self.session.turn()
        return replies

    def ask(
        self, kind: int, code: int, data: bytes = b"", *, value: int = 0, index: int = 0, length: int = 0
    ) -> bytes:
        """Send one request, as its header is printed, and return its one reply."""
        header = struct.pack(">BBHHH", kind, code, value, index, length or len(data))
        (reply,) = self.raw(header + data)
        return reply

    def response(self, line: bytes) -> bytes:
        """GETRESPONSE."""
        return self.ask(DOWN, 0xBF, line)

    def fetched(self, most: int = 1400) -> bytes:
        """GETBUFFER."""
        return self.ask(UP, 0xC5, length=most)

    def settle(self, timeout_s: float = 60.0) -> None:
        """Let time pass until nothing moves any more."""
        end = self.sim.now_s() + timeout_s
        while self.sim.now_s() < end:
            self.sim.wait(0.02)
            controller = self.sim.controller
            if not any(motor.jogging for motor in controller.motors.values()) and not any(
                system.moving or system.running for system in controller.systems.values()
            ):
                return
        raise AssertionError(f"still moving after {timeout_s} s")


def wire_board(machine: MachineProfile, dialect: Dialect | None = None) -> BoardWire:
    """As the factory has set the handshake."""
    sim = SimulatedLathe(machine, dialect=dialect)
    sim.controller.variables.replace_i({**sim.controller.variables.settings(), 3: 1, 4: 0, 6: 3})
    return BoardWire(sim=sim, session=EthernetSession(sim, sim.connect(), Board()))
