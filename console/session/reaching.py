"""Reaching a machine: the link to its controller, or to a simulated one of its own, and the lathe on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from console.session.console_lock import take_lock
from console.session.owning import Owning
from drivers.clock import Clock, RealClock
from drivers.heartbeat import Heartbeat
from drivers.lathe import Lathe
from drivers.link.address import LinkAddress, SimulatedAddress
from drivers.link.base import Link
from drivers.link.opening import open_link
from drivers.link.tracing import Tracing
from drivers.ownership import Ownership
from drivers.pmac.client import PmacClient
from drivers.simulator.process import SimulatorProcess
from drivers.snapshot import Snapshot
from drivers.stop import StopPath
from profiles.machine import MachineProfile
from profiles.store import LoadedMachine


@dataclass(frozen=True, kw_only=True)
class Reached:
    """A machine that can be spoken to; nothing was said yet. `shop` is there for a simulated one."""

    client: PmacClient
    lathe: Lathe
    heartbeat: Heartbeat
    stop: StopPath
    owning: Owning
    clock: Clock
    address: str
    shop: SimulatorProcess | None
    close: Callable[[], None] = field(repr=False)

    @property
    def simulated(self) -> bool:
        """Whether no iron is behind it."""
        return self.shop is not None


def reach(
    loaded: LoadedMachine,
    address: LinkAddress,
    data: Path,
    tracing: Tracing,
    seen: Callable[[Snapshot], None] | None = None,
) -> Reached:
    """Open the link; of a simulated machine, start it first. `data` is the folder of this user.

    Raises:
        LinkError: each way to fail with a code of its own; `simulator.not_started`.
        DriverError: `safety.bad_input`.
    """
    if not isinstance(address, SimulatedAddress):
        return _on(open_link(address), loaded.machine, data, tracing, seen, None)
    process = SimulatorProcess.start(
        loaded.path, seed=address.seed, plant=address.plant, clamping_sd_percent=address.clamping_sd_percent
    )
    try:
        return _on(open_link(process.address), loaded.machine, data, tracing, seen, process)
    except BaseException:
        process.close()
        raise


def _on(
    link: Link,
    machine: MachineProfile,
    data: Path,
    tracing: Tracing,
    seen: Callable[[Snapshot], None] | None,
    process: SimulatorProcess | None,
) -> Reached:
    clock = RealClock()

    def close() -> None:
        link.close()
        if process is not None:
            process.close()

    traced = tracing.of(link, clock.now_s)
    stop, client = StopPath(traced), PmacClient(traced, clock)
    ownership = Ownership(client)
    heartbeat = Heartbeat(client, clock, machine, owner_seen=ownership.see)
    try:
        lathe = Lathe(client, machine, clock, stop, seen, heartbeat, ownership)
    except BaseException:
        link.close()
        raise
    lock = None if process is not None else (lambda: take_lock(data, link.address))
    return Reached(
        client=client,
        lathe=lathe,
        heartbeat=heartbeat,
        stop=stop,
        owning=Owning(lathe, link.address, data, lock),
        clock=clock,
        address=link.address,
        shop=process,
        close=close,
    )
