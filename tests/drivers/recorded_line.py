"""A simulated card at the end of a link that keeps what was sent, and a client that is connected to it."""

from __future__ import annotations

from dataclasses import dataclass, field

from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.syntax import VariableKind
from drivers.simulator.hosts.port import Port
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile


@dataclass(kw_only=True)
class RecordedLine:
    """The far end of a link; `sent` is what the host has sent, a call an item."""

    port: Port
    sent: list[bytes] = field(default_factory=list)

    def receive(self, data: bytes) -> None:
        self.sent.append(data)
        self.port.receive(data)

    def take_output(self) -> bytes:
        return self.port.take_output()


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """One card and one client."""

    sim: SimulatedLathe
    line: RecordedLine
    client: PmacClient

    def times_sent(self, line: str) -> int:
        """How often a line went out."""
        return self.line.sent.count(line.encode() + b"\r")

    def inject(self, fault: str, *, for_s: float | None = None, **parameters: float) -> None:
        """Let the line have a fault from now on."""
        self.sim.faults.inject(fault, after_s=0.0, for_s=for_s, seed=0, **parameters)

    def value(self, index: int) -> float:
        """Return what P-variable `index` is on the card, without asking it."""
        return self.sim.controller.variables.get(VariableKind.P, index)

    def plc(self, *lines: str) -> None:
        """Let the card run a PLC once, loaded by another host."""
        other = self.sim.connect()
        text = ["I5=2", "OPEN PLC 1 CLEAR", *lines, "DISABLE PLC 1", "CLOSE", "ENABLE PLC 1"]
        for each in text:
            other.receive(each.encode() + b"\r")
            self.sim.attend(other)
        other.take_output()


def recorded(machine: MachineProfile, dialect: Dialect) -> Recorded:
    """A card whose client is connected; P1 to P3 are 25, 50 and 75."""
    sim = SimulatedLathe(machine, dialect=dialect)
    line = RecordedLine(port=sim.connect())
    client = PmacClient(MemoryLink(line, sim), sim)
    client.connect()
    client.request("P1=25 P2=50 P3=75")
    line.sent.clear()
    return Recorded(sim=sim, line=line, client=client)
