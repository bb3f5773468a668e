"""Connecting a command to the controller that it is told, or to a fresh simulated one."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from console.cli.library import machine_of
from drivers.clock import Clock, RealClock
from drivers.link.address import SimulatedAddress, parse_address
from drivers.link.opening import open_link
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import Dialect
from drivers.stop import StopPath

if TYPE_CHECKING:
    from drivers.link.base import Link
    from profiles.machine import MachineProfile
    from profiles.store import LoadedMachine

SIMULATED = SimulatedAddress()


@dataclass(frozen=True, kw_only=True)
class Card:
    """A controller that answers, with what it calls itself; `stop` is the way to stop what a command moves."""

    client: PmacClient
    stop: StopPath
    clock: Clock
    machine: MachineProfile
    address: str
    simulated: bool
    version: str
    kind: str

    @property
    def dialect(self) -> Dialect:
        """The family of the controller, by what it calls itself."""
        return self.client.dialect


@contextmanager
def opened_card(options: Namespace) -> Iterator[Card]:
    """Connect, and let go again at the end.

    Raises:
        ProfileError: the machine profile.
        LinkError: it cannot be reached, or is no PMAC.
    """
    machine = machine_of(options)
    told = options.link or machine.machine.link
    address = parse_address(told) if told and not options.sim else SIMULATED
    if isinstance(address, SimulatedAddress):
        with _simulated(machine) as link:
            yield _connected(link, machine.machine, simulated=True)
        return
    link = open_link(address)
    try:
        yield _connected(link, machine.machine, simulated=False)
    finally:
        link.close()


@contextmanager
def _simulated(machine: LoadedMachine) -> Iterator[Link]:
    from drivers.simulator.process import SimulatorProcess

    process = SimulatorProcess.start(machine.path)
    try:
        link = open_link(process.address)
        try:
            yield link
        finally:
            link.close()
    finally:
        process.close()


def _connected(link: Link, machine: MachineProfile, *, simulated: bool) -> Card:
    clock = RealClock()
    client = PmacClient(link, clock)
    version, kind = client.connect()
    return Card(
        client=client,
        stop=StopPath(link),
        clock=clock,
        machine=machine,
        address=link.address,
        simulated=simulated,
        version=version,
        kind=kind,
    )
