"""The same lathe at the end of each link, in the one place that builds it: in memory, on a line, on a network."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass

from drivers.clock import Clock
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.ownership import Ownership
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StopPath
from drivers.link.address import SimulatedAddress, parse_address
from drivers.link.base import Link
from drivers.link.memory import MemoryLink
from drivers.link.opening import open_link
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile, machine_from_table
from profiles.store import load_machine
from tests.compact import CLOSE_TOGETHER
from tests.system.patient_card import PacedLink, served

LINKS = ("memory", "serial", "tcp", "ethernet")
MACHINES = {"pmac": "lee-2001-lathe", "turbo": "turbo-ethernet-lathe"}
"""The bundled machine of each family."""

OPTIONS = {"serial": "?baud=4000000", "tcp": "", "ethernet": ""}
"""Nobody waits for a line that is no line."""


@dataclass(frozen=True, kw_only=True)
class Site:
    """A lathe on a link; nothing was said yet. `seen` are called with every look."""

    machine: MachineProfile
    client: PmacClient
    stop: StopPath
    clock: Clock
    lathe: Lathe
    seen: list[Callable[[Snapshot], None]]


def compact_text(family: str) -> str:
    """The profile of a bundled lathe with short ways: 2 mm of tool, 9 mm of carriage."""
    text = load_machine(MACHINES[family]).path.read_text(encoding="utf-8")
    for there, here in CLOSE_TOGETHER.items():
        assert text.count(there) == 1, there
        text = text.replace(there, here)
    return text


def compact(family: str) -> MachineProfile:
    """That lathe."""
    return machine_from_table(tomllib.loads(compact_text(family)))


def build(link: Link, clock: Clock, machine: MachineProfile) -> Site:
    """Put a lathe on a link, as a console has it: with a lease and an owner."""
    seen: list[Callable[[Snapshot], None]] = []

    def tell(snapshot: Snapshot) -> None:
        for each in tuple(seen):
            each(snapshot)

    client, stop = PmacClient(link, clock), StopPath(link)
    heartbeat = Heartbeat(client, clock, machine)
    lathe = Lathe(client, machine, clock, stop, tell, heartbeat, Ownership(client))
    return Site(machine=machine, client=client, stop=stop, clock=clock, lathe=lathe, seen=seen)


@contextmanager
def opened(kind: str, family: str) -> Iterator[Site]:
    """Build a lathe on a link of a kind, to a card of a family that nobody else speaks to."""
    machine = compact(family)
    sim = SimulatedLathe(machine)
    if kind == "memory":
        yield build(MemoryLink(sim.connect(), sim), sim, machine)
        return
    with served(sim, kind) as server:
        address = parse_address(server.address + OPTIONS[kind])
        assert not isinstance(address, SimulatedAddress)
        with closing(open_link(address)) as link:
            yield build(PacedLink(link, server), server, machine)
