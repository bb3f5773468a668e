"""Connection of a command to the addressed controller, or to a new simulated one."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from console.cli.library import is_real, link_address, profile_of
from console.cli.output import tell
from console.text.catalogue import Catalogue
from drivers.clock import Clock, RealClock
from drivers.lathe.stop import StopPath
from drivers.link.address import SimulatedAddress
from drivers.link.opening import open_link
from drivers.link.tracing import Tracing
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import Dialect

if TYPE_CHECKING:
    from drivers.link.base import Link
    from profiles.machine import MachineProfile
    from profiles.store import LoadedMachine


@dataclass(frozen=True, kw_only=True)
class Card:
    """A connected controller with its identification; `stop` stops what a command moves."""

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
        """Family of the controller, by its identification."""
        return self.client.dialect


@contextmanager
def opened_card(options: Namespace, text: Catalogue) -> Iterator[Card]:
    """Connect, with a trace if requested, and close the connection at the end.

    Raises:
        ProfileError: the machine profile.
        LinkError: it cannot be reached, or is no PMAC.
        DriverError: `link.trace_unwritable`; nothing was opened.
    """
    machine = profile_of(options)
    address = link_address(options, machine)
    title = f"{options.command} {machine.machine.name}"
    tracing = Tracing(None if options.trace is None else Path(options.trace), title)
    try:
        opening = _simulated(machine) if isinstance(address, SimulatedAddress) else closing(open_link(address))
        with opening as link:
            yield _connected(link, machine.machine, tracing, simulated=not is_real(address))
    finally:
        tell(tracing.problems, text)


@contextmanager
def _simulated(machine: LoadedMachine) -> Iterator[Link]:
    from drivers.simulator.hosts.process import SimulatorProcess

    process = SimulatorProcess.start(machine.path)
    try:
        with closing(open_link(process.address)) as link:
            yield link
    finally:
        process.close()


def _connected(link: Link, machine: MachineProfile, tracing: Tracing, *, simulated: bool) -> Card:
    clock = RealClock()
    link = tracing.of(link, clock.now_s)
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
