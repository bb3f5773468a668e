"""A simulated lathe that can be identified: every line that is said to it kept, and a host that may be held up."""

from __future__ import annotations

from dataclasses import dataclass
from random import Random

from drivers.identification.identify import origin_of, take_up
from drivers.identification.result import ResponseOrigin
from drivers.identification.rig import Rig
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.ownership import Ownership
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.true_parameters import TrueParameters
from profiles.machine import MachineProfile
from tests.drivers.commissioned import HeardPort
from tests.drivers.conftest import beside_home


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
