"""What the parts of one lathe share: controller, clock, stop path, polling and commands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from drivers.clock import Clock
from drivers.controller import Controller
from drivers.cutting.loading import Loading
from drivers.lathe.commands import Sending
from drivers.lathe.guarded_moves import GuardedMoves
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.motion import Motion
from drivers.lathe.ownership import Ownership
from drivers.lathe.polling import Poller
from drivers.lathe.snapshot import Snapshot, SnapshotItems
from drivers.lathe.stop import StopPath
from drivers.pmac.dialect import DIALECTS
from profiles.machine import MachineProfile


@dataclass(frozen=True, slots=True, kw_only=True)
class Wiring:
    """One controller, and everything sent to it or read from it."""

    client: Controller
    machine: MachineProfile
    clock: Clock
    stop: StopPath
    heartbeat: Heartbeat | None
    looks: Poller
    sending: Sending
    moves: GuardedMoves
    motion: Motion
    loading: Loading


def wired(
    client: Controller,
    machine: MachineProfile,
    clock: Clock,
    stop: StopPath,
    seen: Callable[[Snapshot], None] | None,
    heartbeat: Heartbeat | None,
    ownership: Ownership | None,
    hold: Callable[[], None],
) -> Wiring:
    """Build the parts of a lathe, see `Lathe`; `hold` asks a running program to end early.

    Raises:
        DriverError: `safety.bad_input`, in the profile.
    """
    items = SnapshotItems(machine, DIALECTS[machine.controller.family])
    looks = Poller(client, clock, stop, items, seen=seen, heartbeat=heartbeat, ownership=ownership)
    forgo = heartbeat.forgo if heartbeat is not None else lambda: None
    sending = Sending(client, stop, looks, ownership, forgo)
    return Wiring(
        client=client,
        machine=machine,
        clock=clock,
        stop=stop,
        heartbeat=heartbeat,
        looks=looks,
        sending=sending,
        moves=GuardedMoves(sending, looks, heartbeat),
        motion=Motion(machine, looks, stop, clock, heartbeat, ownership, hold),
        loading=Loading(client, machine, clock),
    )
