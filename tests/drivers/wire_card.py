"""A card with one host, and nothing between them but bytes: those of its line, or of the Ethernet board."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

from drivers.pmac.dialect import Dialect
from drivers.pmac.language.syntax import VariableKind
from drivers.simulator.card.controller import SimulatedController
from drivers.simulator.hosts.ethernet import Board, EthernetSession
from drivers.simulator.hosts.port import Port
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile

ACK, BELL, STX, LF, CR = b"\x06", b"\x07", b"\x02", b"\n", b"\r"
CYCLE_S = 0.005
"""A little more than one background cycle of the bundled machine."""


@dataclass(frozen=True, kw_only=True)
class Wire:
    """I3=2 and I6=1 unless a test sets them otherwise."""

    sim: SimulatedLathe
    port: Port

    @property
    def card(self) -> SimulatedController:
        return self.sim.controller

    def raw(self, data: str | bytes) -> bytes:
        """Send bytes and return what the card says at once; time passes only over a SAVE."""
        self.port.receive(data.encode("latin-1") if isinstance(data, str) else data)
        self._attend()
        while self.card.saving:
            self.sim.wait(CYCLE_S)
            self._attend()
        return self.port.take_output()

    def _attend(self) -> None:
        while not self.port.idle or self.port.ready:
            self.sim.attend(self.port)
            if not self.port.ready:
                break

    def ask(self, line: str) -> list[str]:
        """Return the lines of data that a line answers."""
        said = self.raw(line + "\r")
        assert said.endswith(ACK), (line, said)
        data = said[:-1].decode("ascii")
        assert not data or data.endswith("\r")
        return data.split("\r")[:-1]

    def listed(self, buffer: str) -> list[str]:
        """Return the lines of a buffer (`PROG 1`) in full, whatever I9 is, without the end of every listing."""
        form = self.card.variables.i(9)
        self.card.variables.set(VariableKind.I, 9, 3.0)
        lines = self.ask(f"LIST {buffer}")
        self.card.variables.set(VariableKind.I, 9, form)
        assert lines[-1] == "RETURN"
        return lines[:-1]

    def tell(self, *lines: str) -> None:
        """Send lines that answer nothing."""
        for line in lines:
            assert self.ask(line) == [], line

    def refusal(self, line: str) -> int:
        """Return the number of the error that a line is answered with, and with nothing else."""
        said = self.raw(line + "\r")
        assert len(said) == 8, (line, said)
        assert said.startswith(BELL + b"ERR"), (line, said)
        assert said.endswith(CR), (line, said)
        return int(said[4:7])

    def settle(self, timeout_s: float = 60.0) -> None:
        """Let time pass until nothing moves any more."""
        end = self.sim.now_s() + timeout_s
        while self.sim.now_s() < end:
            self.sim.wait(0.02)
            systems = self.card.systems.values()
            if not any(motor.jogging for motor in self.card.motors.values()) and not any(
                system.moving or system.running for system in systems
            ):
                return
        raise AssertionError(f"still moving after {timeout_s} s")


def wire(machine: MachineProfile, dialect: Dialect | None = None, saved: Path | None = None) -> Wire:
    sim = SimulatedLathe(machine, dialect=dialect, saved=saved)
    made = Wire(sim=sim, port=sim.connect())
    made.raw("I3=2 I6=1\r")
    return made


# A client of the Ethernet board that knows nothing but bytes.

DOWN, UP = 0x40, 0xC0


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
