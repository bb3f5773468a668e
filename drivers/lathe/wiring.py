"""What the parts of one lathe share: controller, clock, stop path, polling and commands."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.clock import Clock
from drivers.controller import Controller
from drivers.cutting.tables import Tables
from drivers.lathe.commands import Sending
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.ownership import Ownership
from drivers.lathe.polling import Poller
from drivers.lathe.stop import StopPath
from profiles.machine import MachineProfile


@dataclass(frozen=True, slots=True, kw_only=True)
class Wiring:
    """One controller, and everything sent to it or read from it."""

    client: Controller
    machine: MachineProfile
    clock: Clock
    stop: StopPath
    heartbeat: Heartbeat | None
    ownership: Ownership | None
    poller: Poller
    sending: Sending
    tables: Tables
