"""One station over one watched machine: the one place where they are put together."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from random import Random

from console.session.data import record_file
from console.session.data.record_schema import create
from console.session.data.run_log import RunLog
from console.session.station.context import StationContext
from console.session.station.owning import Owning
from console.session.station.state import StationState
from console.session.station.station import Station
from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.ownership import Ownership
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StopPath
from drivers.pmac.client import PmacClient
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.store import load_job
from tests.compact import compact_machine as compact_machine
from tests.matrix.truth import WatchedLathe, Wiretap

RUN_OUT_S, TIMEOUT_S = 20.0, 6.0
"""A spindle at 1000 rpm runs out in 16 s, a carriage sooner, and any search for a zero is over in 5 s.

A machine that does not answer is given up then: in the first time where something may run out, in the second where
nothing does.
"""


@dataclass(kw_only=True)
class Watched:
    """A lathe behind a wire, with heartbeat and owner. `looks` are called with every look at it."""

    sim: WatchedLathe
    wire: Wiretap
    lathe: Lathe
    stop: StopPath
    looks: list[Callable[[Snapshot], None]] = field(default_factory=list)


@dataclass(kw_only=True)
class Rig(Watched):
    """A station at it; `looks` are called before the station sees one."""

    station: Station
    context: StationContext

    @property
    def state(self) -> StationState:
        return self.station.state

    def step(self, seconds: float = 0.1) -> StationState:
        """Let time pass, and let the station have its turn."""
        self.sim.wait(seconds)
        self.station.step()
        return self.state


SHORT_MM, HELD_MM = 0.5, 2.0
"""Lengths of the cut: 34 turns with the way in, 2 s; and 64 turns, where something is held for two seconds."""


@cache
def short_job(cut_length_mm: float = SHORT_MM) -> Job:
    """Experiment 1 with a short cut."""
    return replace(load_job("lee-2001-experiment-1").job, cut_length_mm=cut_length_mm)


_PLANS: dict[object, CutPlan] = {}


def planned_once(job: Job, machine: MachineProfile, strategy: Strategy, **given: object) -> CutPlan:
    """The plan of a cut; the same cut is planned once for all cells. Job and machine are always those above."""
    target = (strategy, job.cut_length_mm, *sorted(given.items()))
    if target not in _PLANS:
        _PLANS[target] = plan_cut(job, machine, strategy, **given)  # type: ignore[arg-type]
    return _PLANS[target]


def record_in_memory(folder: Path, until_s: float, *, checked: bool = False) -> sqlite3.Connection:
    """Open a record that each copy of a process has for itself."""
    path = folder / record_file.FILE_NAME
    record_file._make_file(path)
    path.with_name(f"{path.name}-wal").touch()
    database = sqlite3.connect(":memory:", isolation_level=None)
    create(database)
    record_file._check(database, path, checked=checked)
    return database


class LogNowhere(RunLog):
    """The log beside a record in memory: there is no file that its thread could write."""

    def _put(self, item: object) -> None:
        pass


def build_watched() -> Watched:
    """Put a lathe together as every host has it; nothing is connected yet."""
    machine = compact_machine().machine
    sim = WatchedLathe(machine)
    wire = Wiretap(sim.connect(), sim)
    stop, client = StopPath(wire), PmacClient(wire, sim)
    looks: list[Callable[[Snapshot], None]] = []

    def seen(snapshot: Snapshot) -> None:
        for look in tuple(looks):
            look(snapshot)

    heartbeat, ownership = Heartbeat(client, sim, machine), Ownership(client, Random(1))
    lathe = Lathe(client, machine, sim, stop, seen, heartbeat, ownership)
    return Watched(sim=sim, wire=wire, lathe=lathe, stop=stop, looks=looks)


def build_rig(records: Path) -> Rig:
    """Put lathe and station together as a screen has them, with a heartbeat; nothing is connected yet."""
    watched = build_watched()
    looks: list[Callable[[Snapshot], None]] = []
    context = StationContext(
        lathe=watched.lathe,
        owning=Owning(watched.lathe, watched.wire.address, records),
        loaded_machine=compact_machine(),
        clock=watched.sim,
        shop=None,
        records=records,
        local_time=lambda: "21 Nov 10:00",
    )
    station = Station(context)

    def seen(snapshot: Snapshot) -> None:
        for look in tuple(looks):
            look(snapshot)
        station.seen(snapshot)

    watched.looks.append(seen)
    there = {name: getattr(watched, name) for name in ("sim", "wire", "lathe", "stop")}
    return Rig(**there, looks=looks, station=station, context=context)
