"""What the card and the iron truly are, a station over it, and the states in which a fault may meet it."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from console.session.cut.alignment import JawAngle, TouchOff, clamping_of
from console.session.data import record_file
from console.session.data.record_schema import create
from console.session.data.run_log import RunLog
from console.session.station.commands import Arm, Command, DisableDrives, EnableDrives, Home, Jog, Start
from console.session.station.context import StationContext
from console.session.station.machine_control import MachineControl
from console.session.station.progress import CutStage
from console.session.station.state import Activity, StationState
from console.session.station.station import Station
from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.ownership import Ownership
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.simulator.card.motor import Motor
from drivers.simulator.hosts.port import Port
from drivers.simulator.machine import SimulatedLathe
from profiles.job import Job
from profiles.machine import SHELL, MachineProfile
from profiles.store import LoadedMachine, load_job
from tests.compact import compact_machine as compact_machine

MOTORS = {AxisName.TOOL: 1, AxisName.SPINDLE: 2, AxisName.CARRIAGE: 3}


class Moment(NamedTuple):  # one for each block: made three times as fast
    """The end of one block of servo cycles: iron and reported positions in counts, amplifiers, program."""

    at_s: float
    true_position: tuple[float, ...]
    told: tuple[float, ...]
    powered: tuple[bool, ...]
    running: bool


class WatchedLathe(SimulatedLathe):
    """A simulated lathe that keeps a moment for each block, and when which amplifier was switched on."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self.moments: list[Moment] = []
        self.energised: list[tuple[float, AxisName]] = []
        self._watched = [self.controller.motors[number] for number in MOTORS.values()]
        for axis, number in MOTORS.items():
            self._watch_amplifier(axis, self.controller.motors[number])

    def keep(self) -> None:
        a, b, c = self._watched
        self.moments.append(
            Moment(
                self.now_s(),
                (a.true_position, b.true_position, c.true_position),
                (a.position, b.position, c.position),
                (a.amplifier_enabled, b.amplifier_enabled, c.amplifier_enabled),
                self.controller.systems[1].running,
            )
        )

    def since(self, begun_s: float, until_s: float = float("inf")) -> list[Moment]:
        """The moments of a stretch of time, with the last one before it."""
        return list(self._reversed_since(begun_s, until_s))[::-1]

    def _reversed_since(self, begun_s: float, until_s: float) -> Iterator[Moment]:
        for moment in reversed(self.moments):
            if moment.at_s <= until_s:
                yield moment
            if moment.at_s < begun_s:
                return

    def _watch_amplifier(self, axis: AxisName, motor: Motor) -> None:
        """Between two blocks a loop may be opened and closed again."""
        enable = motor.enable

        def watched() -> None:
            if not motor.enabled:
                self.energised.append((self.now_s(), axis))
            enable()

        motor.enable = watched  # type: ignore[method-assign]

    def _run_block(self) -> None:
        super()._run_block()
        self.keep()


@dataclass(frozen=True, slots=True)
class Sent:
    """One piece of what the host has sent."""

    at_s: float
    data: bytes
    urgent: bool

    @property
    def line(self) -> str:
        return self.data.decode("latin-1").rstrip("\r")


@dataclass
class Wiretap(MemoryLink):
    """A link that keeps what goes out. `before` is called with each line, before it leaves."""

    port: Port
    sim: WatchedLathe
    sent: list[Sent] = field(default_factory=list)
    before: Callable[[Sent], None] = lambda _: None

    def __post_init__(self) -> None:
        super().__init__(self.port, self.sim)

    def send(self, data: bytes) -> None:
        self._keep(data, urgent=False)
        super().send(data)

    def send_urgent(self, data: bytes) -> None:
        self._keep(data, urgent=True)
        super().send_urgent(data)

    def _keep(self, data: bytes, *, urgent: bool) -> None:
        piece = Sent(self.sim.now_s(), data, urgent)
        self.before(piece)
        self.sent.append(piece)


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


def lathe_that_holds(*, shell: bool) -> LoadedMachine:
    """The lathe close together; a `shell` has less lobe towards its free end, else it is the same along Z."""
    loaded = compact_machine()
    as_shell = replace(loaded.machine, chuck=replace(loaded.machine.chuck, lobe_along=SHELL))
    return replace(loaded, machine=as_shell) if shell else loaded


_PLANS: dict[object, CutPlan] = {}


def planned_once(job: Job, machine: MachineProfile, strategy: Strategy, **given: object) -> CutPlan:
    """The plan of a cut; the same cut is planned once for all cells. Job and machine are always those above."""
    target = (strategy, job.cut_length_mm, machine.chuck.lobe_along, *sorted(given.items()))
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


def build_watched(*, shell: bool = False) -> Watched:
    """Put a lathe together as every host has it; nothing is connected yet."""
    machine = lathe_that_holds(shell=shell).machine
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


def build_rig(records: Path, *, shell: bool = False) -> Rig:
    """Put lathe and station together as a screen has them, with a heartbeat; nothing is connected yet."""
    watched = build_watched(shell=shell)
    looks: list[Callable[[Snapshot], None]] = []
    context = StationContext(
        lathe=watched.lathe,
        owning=MachineControl(watched.lathe, watched.wire.address, records),
        loaded_machine=lathe_that_holds(shell=shell),
        clock=watched.sim,
        shop=None,
        records=records,
        local_time=lambda: "21 Nov 10:00",
    )
    station = Station(context)

    def seen(snapshot: Snapshot) -> None:
        for look in tuple(looks):
            look(snapshot)
        station.take_poll(snapshot)

    watched.looks.append(seen)
    there = {name: getattr(watched, name) for name in ("sim", "wire", "lathe", "stop")}
    return Rig(**there, looks=looks, station=station, context=context)


JOG_MM = 3.0


class Situation(StrEnum):
    """What the console is doing when the fault comes."""

    OFF = "drives off"
    IDLE = "idle"
    JOGGING = "jogging"
    HOMING = "homing"
    DOWNLOADING = "downloading"
    ARMED = "armed"
    CUTTING = "cutting"
    STOPPING = "stopping"


MAY_MOVE: dict[Situation, frozenset[AxisName]] = {
    Situation.JOGGING: frozenset({AxisName.CARRIAGE}),
    Situation.HOMING: frozenset(AxisName),
    Situation.CUTTING: frozenset(AxisName),
    Situation.STOPPING: frozenset(AxisName),
}
"""What was ordered to move; in every other situation nothing was."""


MOVING = frozenset({Situation.JOGGING, Situation.HOMING, Situation.CUTTING})
"""Where something moves that nobody has stopped."""


RUNNING_OUT = frozenset({Situation.OFF, Situation.JOGGING, Situation.CUTTING, Situation.STOPPING})
"""Where an axis may run out: spindle or carriage, or what another host moves behind drives that are off."""


@dataclass(kw_only=True)
class Begun:
    """`fault` lets the fault happen, once; `at_s` is when it did. An `early` one is there before the order."""

    rig: Rig
    fault: Callable[[], None]
    early: bool = False
    strategy: Strategy = Strategy.PVT
    cut_mm: float = SHORT_MM
    at_s: float | None = None

    def happen(self) -> None:
        if self.at_s is None:
            self.at_s = self.rig.sim.now_s()
            self.fault()


def enter(situation: Situation, begun: Begun) -> None:
    """Bring the station there, have the fault happen, and let what is being carried out come to its end."""
    rig = begun.rig
    assert rig.station.connect()
    _do(rig, DisableDrives())
    if situation is not Situation.OFF:
        _switch_on(rig)
    if begun.early:
        begun.happen()
    _ENTRIES[situation](begun)
    assert begun.at_s is not None, "the fault has not happened"


def _do(rig: Rig, order: Command) -> None:
    assert rig.station.post(order), rig.state.refusals
    rig.station.step()


def _switch_on(rig: Rig) -> None:
    """Drives on, and everything known that an alignment finds out."""
    _do(rig, EnableDrives())
    for motor in rig.sim.controller.motors.values():
        motor.home_zero()
    job, machine = short_job(), compact_machine().machine
    rig.station.step()
    on = rig.state.alignment.on
    alignment = replace(
        rig.state.alignment,
        clamping=clamping_of(job, at="-"),
        jaw=JawAngle(angle_deg=90.0, jaws=job.jaws, at="-", on=on),
        touch_off=TouchOff(zero_radius_mm=machine.tool.home_radius_mm, diameter_mm=job.diameter_mm, at="-", on=on),
    )
    rig.context.tell(alignment=alignment)
    assert rig.state.activity is Activity.READY and rig.state.refusals == () and rig.state.alarms == ()


def _at_rest(begun: Begun) -> None:
    begun.happen()


def _arm(begun: Begun) -> None:
    _do(begun.rig, Arm(job=short_job(begun.cut_mm), job_sha256="0" * 64, strategy=begun.strategy))


def _armed(begun: Begun) -> None:
    _arm(begun)
    assert begun.rig.state.armed is not None, begun.rig.state.refusals
    begun.happen()


def _jogging(begun: Begun) -> None:
    _on_look(begun, lambda s: "desired_velocity_zero" not in s.carriage.flags)
    _do(begun.rig, Jog(axis=AxisName.CARRIAGE, distance=JOG_MM))


def _homing(begun: Begun) -> None:
    _on_look(begun, lambda s: "home_search" in s.tool.flags)
    _do(begun.rig, Home())


def _downloading(begun: Begun) -> None:
    def look(sent: Sent) -> None:
        if sent.line.startswith("PVT"):
            begun.happen()

    begun.rig.wire.before = look
    _arm(begun)
    begun.rig.wire.before = lambda _: None


def _cutting(begun: Begun) -> None:
    _arm(begun)
    _on_look(begun, lambda _: _in_the_part(begun.rig))
    _do(begun.rig, Start())


def _stopping(begun: Begun) -> None:
    rig = begun.rig

    def press() -> None:
        rig.stop.stop("space")
        begun.happen()

    begun_here = Begun(rig=rig, fault=press)
    _arm(begun)
    _on_look(begun_here, lambda _: _in_the_part(rig))
    _do(rig, Start())


def _in_the_part(rig: Rig) -> bool:
    cut = rig.state.cut
    return cut is not None and cut.stage is CutStage.CUT and cut.turn > 2.0


def _on_look(begun: Begun, condition: Callable[[Snapshot], bool]) -> None:
    def look(snapshot: Snapshot) -> None:
        if begun.at_s is None and condition(snapshot):
            begun.happen()

    begun.rig.looks.append(look)


_ENTRIES: dict[Situation, Callable[[Begun], None]] = {
    Situation.OFF: _at_rest,
    Situation.IDLE: _at_rest,
    Situation.JOGGING: _jogging,
    Situation.HOMING: _homing,
    Situation.DOWNLOADING: _downloading,
    Situation.ARMED: _armed,
    Situation.CUTTING: _cutting,
    Situation.STOPPING: _stopping,
}
