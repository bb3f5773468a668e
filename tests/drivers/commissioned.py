"""A card with what commissions it, and one whose line keeps what was sent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random

import pytest

from drivers.commissioning.check import Check
from drivers.commissioning.proofs.bench import ProofRig
from drivers.commissioning.verification import Verification, verify
from drivers.identification.identify import origin_of, take_up
from drivers.identification.result import ResponseOrigin
from drivers.identification.rig import Rig
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.ownership import Ownership
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import DIALECTS, Dialect
from drivers.pmac.language.syntax import VariableKind
from drivers.simulator.hosts.port import Port
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.true_parameters import TrueParameters
from profiles.findings import Severity
from profiles.machine import MachineProfile
from tests.drivers.conftest import beside_home
from tests.drivers.families import of_family as of_family


@dataclass(kw_only=True)
class HeardPort:
    """The card's end of the line; it keeps what is said to the card."""

    port: Port
    heard: bytes = b""

    def receive(self, data: bytes) -> None:
        self.heard += data
        self.port.receive(data)

    def take_output(self) -> bytes:
        return self.port.take_output()


@dataclass(frozen=True)
class Watched:
    """The clock of a host; after each wait it does something more."""

    sim: SimulatedLathe
    after: Callable[[], None]

    def now_s(self) -> float:
        return self.sim.now_s()

    def wait(self, seconds: float) -> None:
        self.sim.wait(seconds)
        self.after()


@dataclass(kw_only=True)
class Commissioned:
    """One card of a machine, connected."""

    machine: MachineProfile
    sim: SimulatedLathe
    line: HeardPort
    link: MemoryLink
    client: PmacClient
    stop: StopPath = field(init=False)

    def __post_init__(self) -> None:
        self.stop = StopPath(self.link)

    @property
    def dialect(self) -> Dialect:
        return self.client.dialect

    @property
    def lines(self) -> list[str]:
        """What was said since the connection stood, line by line."""
        return self.line.heard.decode("latin-1").split("\r")[:-1]

    def tell(self, *lines: str) -> None:
        for each in lines:
            self.client.request(each, lines=0)

    def factory(self) -> None:
        """Make the card what it was when it left the factory, and connect again."""
        self.client.send("$$$***")
        self.sim.wait(0.1)
        self.client.connect()
        self.line.heard = b""

    def update_firmware(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Let the card say that it has another version."""
        query = self.client.query

        def newer(*items: str, timeout_s: float = 2.0, again: bool = False) -> tuple[str, ...]:
            found = query(*items, timeout_s=timeout_s, again=again)
            return tuple("9.99" if item == "VERSION" else text for item, text in zip(items, found, strict=True))

        monkeypatch.setattr(self.client, "query", newer)

    def bench(self) -> ProofRig:
        """What the proofs work with."""
        judged = self.verify().judged
        return ProofRig(client=self.client, stop=self.stop, clock=self.sim, judged=judged)

    def verify(self) -> Verification:
        return verify(self.client, self.machine, self.dialect)

    def findings(self) -> list[Check]:
        """What does not hold, notes apart."""
        return [check for check in self.verify().checks if check.severity in (Severity.WARNING, Severity.REFUSAL)]


def commissioned(machine: MachineProfile, watch: Callable[[SimulatedLathe], None] | None = None) -> Commissioned:
    sim = SimulatedLathe(machine, dialect=DIALECTS[machine.controller.family])
    if watch is not None:
        watch(sim)
    line = HeardPort(port=sim.connect())
    link = MemoryLink(line, sim)
    client = PmacClient(link, sim)
    client.connect()
    line.heard = b""
    return Commissioned(machine=machine, sim=sim, line=line, link=link, client=client)


# A simulated card at the end of a link that keeps what was sent, and a client that is connected to it.


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


@dataclass(kw_only=True)
class HostClock:
    """The clock of a host that is held up by `for_s` when `at_s` has come, once."""

    sim: SimulatedLathe
    at_s: float = float("inf")
    for_s: float = 0.0

    def now_s(self) -> float:
        return self.sim.now_s()

    def wait(self, seconds: float) -> None:
        if self.sim.now_s() >= self.at_s:
            self.at_s = float("inf")
            seconds += self.for_s
        self.sim.wait(seconds)


@dataclass(kw_only=True)
class Stand:
    """One machine and its host, connected, with the drives off."""

    sim: SimulatedLathe
    line: HeardPort
    clock: HostClock
    stop: StopPath
    rig: Rig
    version: str
    kind: str

    @property
    def origin(self) -> ResponseOrigin:
        return origin_of(self.rig, version=self.version, kind=self.kind, simulated=True)

    @property
    def lines(self) -> list[str]:
        """What was said since somebody last forgot it, line by line."""
        return self.line.heard.decode("latin-1").split("\r")[:-1]

    @property
    def drives_on(self) -> bool:
        return any(motor.amplifier_enabled for motor in self.sim.controller.motors.values())

    def tell(self, *lines: str) -> None:
        for each in lines:
            self.rig.client.request(each, lines=0)


def stand(machine: MachineProfile, true: TrueParameters | None = None) -> Stand:
    sim = SimulatedLathe(machine, beside_home(machine, true))
    line = HeardPort(port=sim.connect())
    link, clock = MemoryLink(line, sim), HostClock(sim=sim)
    client, stop = PmacClient(link, clock), StopPath(link)
    ownership = Ownership(client, Random(1))
    heartbeat = Heartbeat(client, clock, machine, owner_seen=ownership.see)
    lathe = Lathe(client, machine, clock, stop, heartbeat=heartbeat, ownership=ownership)
    version, kind = lathe.connect()
    lathe.claim()
    line.heard = b""
    rig = Rig(client=client, lathe=lathe, clock=clock)
    return Stand(sim=sim, line=line, clock=clock, stop=stop, rig=rig, version=version, kind=kind)


def ready(machine: MachineProfile, true: TrueParameters | None = None) -> Stand:
    """Return one with its drives on and its zeros found."""
    made = stand(machine, true)
    made.rig.lathe.verify()
    take_up(made.rig)
    made.line.heard = b""
    return made
