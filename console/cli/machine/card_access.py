"""Connection of a command to the addressed controller, or to a new simulated one."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from console.cli.library import data_of, link_address, profile_of
from console.cli.output import tell
from console.session.signals import Interruption
from console.session.station.machine_connection import owning_of
from console.session.station.machine_control import MachineControl
from console.text.catalogue import Catalogue
from drivers.clock import Clock, RealClock
from drivers.lathe.lathe import Lathe
from drivers.lathe.ownership import Ownership
from drivers.lathe.stop import StopPath
from drivers.link.address import SimulatedAddress
from drivers.link.base import Link
from drivers.link.opening import open_link
from drivers.link.tracing import Tracing
from drivers.pmac.client import PmacClient
from profiles.machine import MachineProfile
from profiles.store import LoadedMachine


@dataclass(frozen=True, kw_only=True)
class ConnectedController:
    """A connected controller with its identification; `stop` stops what a command moves."""

    client: PmacClient
    stop: StopPath
    clock: Clock
    machine: MachineProfile
    address: str
    simulated: bool
    version: str
    kind: str
    data: Path


def card_line(card: ConnectedController, text: Catalogue) -> str:
    """Return the line that identifies the controller."""
    mark = f"{text('sim')}  " if card.simulated else ""
    return mark + text(
        "configuration.head", machine=card.machine.name, address=card.address, kind=card.kind, version=card.version
    )


def card_fields(card: ConnectedController) -> dict[str, object]:
    """Return the machine with its controller, for JSON."""
    return {
        "machine": card.machine.name,
        "address": card.address,
        "simulated": card.simulated,
        "type": card.kind,
        "version": card.version,
    }


@contextmanager
def opened_card(options: Namespace, text: Catalogue) -> Iterator[ConnectedController]:
    """Connect, with a trace if requested (an unwritable one is refused first); close the connection at the end."""
    loaded, clock = profile_of(options), RealClock()
    address = link_address(options, loaded)
    title = f"{options.command} {loaded.machine.name}"
    tracing = Tracing(None if options.trace is None else Path(options.trace), title)
    try:
        opening = (
            _open_simulated_link(loaded) if isinstance(address, SimulatedAddress) else closing(open_link(address))
        )
        with opening as plain:
            link = tracing.trace_link(plain, clock.now_s)
            client = PmacClient(link, clock)
            version, kind = client.connect()
            yield ConnectedController(
                client=client,
                stop=StopPath(link),
                clock=clock,
                machine=loaded.machine,
                address=link.address,
                simulated=isinstance(address, SimulatedAddress),
                version=version,
                kind=kind,
                data=data_of(options),
            )
    finally:
        tell(tracing.problems, text)


@contextmanager
def _open_simulated_link(machine: LoadedMachine) -> Iterator[Link]:
    from drivers.simulator.hosts.process import SimulatorProcess

    process = SimulatorProcess.start(machine.path)
    try:
        with closing(open_link(process.address)) as link:
            yield link
    finally:
        process.close()


def owned_lathe(card: ConnectedController, ownership: Ownership) -> tuple[Lathe, MachineControl]:
    """Return the lathe at a controller, and the control of it."""
    lathe = Lathe(card.client, card.machine, card.clock, card.stop, ownership=ownership)
    return lathe, owning_of(lathe, card.address, card.data, simulated=card.simulated)


def with_control(card: ConnectedController, work: Callable[[], object]) -> None:
    """Do work with control of the machine; a signal ends the command after control is released."""
    interruption = Interruption()
    interruption.install()
    _, owning = owned_lathe(card, Ownership(card.client))
    with interruption.holding():
        try:
            owning.claim()
            work()
        finally:
            owning.release()
