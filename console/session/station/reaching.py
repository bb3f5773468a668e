"""Connection to a machine: the link to its controller, or to a simulated one, and the lathe on it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from console.session.cut.context import CutContext
from console.session.cut.interlocks import Interlock, refuse_unless
from console.session.signals import Interruption
from console.session.station.commissioned import Commissioned
from console.session.station.owning import Owning, take_lock
from drivers.clock import Clock, RealClock
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.ownership import Ownership, Standing
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StopPath
from drivers.link.address import LinkAddress, SimulatedAddress
from drivers.link.base import Link
from drivers.link.opening import open_link
from drivers.link.tracing import Tracing
from drivers.pmac.client import PmacClient
from drivers.simulator.hosts.process import SimulatorProcess
from profiles.machine import MachineProfile
from profiles.problem import ProblemError
from profiles.store import LoadedMachine


@dataclass(frozen=True, kw_only=True)
class Reached:
    """A connected machine to which nothing was sent yet. `shop` is there for a simulated one."""

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
        """Whether it is simulated."""
        return self.shop is not None


def reach(
    loaded: LoadedMachine,
    address: LinkAddress,
    data: Path,
    tracing: Tracing,
    seen: Callable[[Snapshot], None] | None = None,
) -> Reached:
    """Open the link; for a simulated machine, start it first. `data` is the folder of this user.

    Raises:
        LinkError: a code for each kind of failure; `simulator.not_started`.
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


def guard(interruption: Interruption, lathe: Lathe, now_s: Callable[[], float]) -> None:
    """Stop this machine when the command is to end, from the claim on; send nothing while it is another's.

    `now_s` is the time of the machine.
    """
    ownership = lathe.ownership
    interruption.guard(
        lathe.stop,
        now_s=now_s,
        anothers=lambda: lathe.anothers,
        changing=lambda: ownership is not None and ownership.standing is Standing.CHANGING,
    )


def machine_context(reached: Reached, commissioned: Commissioned) -> CutContext:
    """Return a connected machine for one cut; on a real one the operator clamps and measures."""
    lathe = reached.lathe

    def admit() -> None:
        """Take control, and check the commissioning, before anything is written."""
        reached.owning.claim()
        refuse_unless(Interlock(name="controller_verified", problems=lathe.verify()))
        commissioned.take_fingerprint()
        refuse_unless(Interlock(name="commissioned", problems=commissioned.problems(lathe.snapshot())))

    return CutContext(
        lathe=lathe,
        workshop=reached.shop,
        commissioned=commissioned.problems,
        admit=admit,
        sets_spindle=reached.simulated and lathe.machine.spindle.followed,
    )


def leave(lathe: Lathe, owning: Owning | None) -> bool:
    """Leave the machine with its drives off and released; False when that cannot be proven. Raises no problem.

    A machine left in doubt keeps the number of this console, so that the next one must check it.
    """
    ownership = lathe.ownership
    ours = ownership is None or ownership.standing is Standing.OWNER
    if lathe.has_moved and ours and not _switched_off(lathe):
        return False
    if owning is not None:
        owning.release()
    return True


def _switched_off(lathe: Lathe) -> bool:
    with suppress(ProblemError):
        if lathe.stop.reason is None:
            lathe.switch_off()
            return True
    lathe.stop.kill("end")
    if lathe.stop.given_up:  # the wait for rest has already timed out, and would do so again
        return False
    try:
        lathe.wait_for_rest()
    except ProblemError:
        return False
    return True
