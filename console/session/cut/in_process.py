"""Simulated lathe in this process, as fast as it can be calculated: for `console run --sim` and the paper."""

from __future__ import annotations

from console.session.cut.engine import CutContext
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.stop import StopPath
from drivers.link.base import Link
from drivers.link.memory import MemoryLink
from drivers.link.tracing import Tracing
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.true_parameters import TrueParameters
from profiles.machine import MachineProfile


def simulated_context(
    machine: MachineProfile, true: TrueParameters | None = None, tracing: Tracing | None = None
) -> tuple[CutContext, SimulatedLathe]:
    """Return a new machine in its workshop; `true` is the actual hardware, None for one as its profile says."""
    simulated = SimulatedLathe(machine, true)
    link: Link = MemoryLink(simulated.connect(), simulated)
    if tracing is not None:
        link = tracing.trace_link(link, simulated.now_s)
    client = PmacClient(link, simulated)
    lathe = Lathe(client, machine, simulated, StopPath(link), heartbeat=Heartbeat(client, simulated, machine))
    return CutContext(lathe=lathe, workshop=simulated, sets_spindle=machine.spindle.followed), simulated
