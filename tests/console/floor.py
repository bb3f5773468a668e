"""A station in one process with a simulated lathe, on a clock that is advanced."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from console.session.station.commands import (
    Approach,
    Arm,
    Command,
    ConfirmClamping,
    DisableDrives,
    EnableDrives,
    Home,
    Jog,
    TakeJaw,
    TakeTouchOff,
)
from console.session.station.context import StationContext
from console.session.station.jogging import STEP_TOLERANCE_MM, longest_toward_mm
from console.session.station.machine_control import MachineControl
from console.session.station.progress import CutStage
from console.session.station.state import SessionStart, StationState
from console.session.station.station import Station
from drivers.cutting.planning import Strategy
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.ownership import Ownership
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.lathe.stop import StopPath
from drivers.lathe_placement import LathePlacement
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.true_parameters import begun_at
from profiles.job import Job
from profiles.store import LoadedMachine, load_job
from tests.compact import compact_machine

T = TypeVar("T")
LOCAL_TIME = "21 Nov 10:00"
LOGGED = {"command", "refused", "telemetry", "alarm_raised", "alarm_acknowledged", "alarm_ended"}
"""Events that a thread of its own writes, some moments later than the others."""
LOOK_S = 0.5


@dataclass(kw_only=True)
class Floor:
    """`looks` are called with every look at the machine, before the station sees it."""

    sim: SimulatedLathe
    lathe: Lathe
    stop: StopPath
    link: MemoryLink
    station: Station
    context: StationContext
    looks: list[Callable[[Snapshot], None]] = field(default_factory=list)

    @property
    def state(self) -> StationState:
        return self.station.state

    def do(self, *commands: Command) -> StationState:
        """Order one thing after the other and have each carried out; it must be taken."""
        for command in commands:
            assert self.station.post(command), self.state.refusals
            self.station.step()
        return self.state

    def idle(self, seconds: float = 0.3) -> StationState:
        """Let time pass, and look as often as a console does that is not frozen."""
        for _ in range(looks := max(round(seconds / LOOK_S), 1)):
            self.sim.wait(seconds / looks)
            self.station.step()
        return self.state

    def set_up(self, job: Job) -> None:
        """Clamp, switch on and home, find jaw 1 and touch off, by what can be seen at the chuck."""
        self.do(DisableDrives())
        self.do(ConfirmClamping(job=job))
        self.do(EnableDrives())
        self.do(Home())
        for _ in range(2):
            seen = self.idle().seen
            assert seen is not None
            self.do(Jog(axis=AxisName.SPINDLE, distance=-seen.jaw_1_past_mark_deg))
        self.do(TakeJaw())
        self.do(Approach(job=job))
        self.touch()
        self.do(TakeTouchOff(radius_mm=job.radius_mm))

    def touch(self, off_mm: float = 0.0) -> None:
        """Bring the tip to the surface as the chuck shows it, or so far off it (positive: short of the part)."""
        for _ in range(2):  # the second way is what the drift of the first has left
            seen = self.idle().seen
            assert seen is not None and seen.tool_gap_mm is not None
            self.infeed(seen.tool_gap_mm - off_mm)

    def infeed(self, mm: float) -> None:
        """Jog the tool toward the part, by the longest steps that are allowed before the touch-off.

        A step that is refused, or that a fault ends, is the last one.
        """
        machine = self.context.loaded_machine.machine
        while mm > STEP_TOLERANCE_MM:
            seen = self.idle().snapshot
            if seen is None or self.state.stop is not None or self.state.refusals:
                return
            longest_mm = longest_toward_mm(seen, machine, self.state.alignment)
            step_mm = min(mm, longest_mm - 0.002)  # the tool is a few counts elsewhere at the next poll
            self.do(Jog(axis=AxisName.TOOL, distance=step_mm))
            mm -= step_mm
        self.do(Jog(axis=AxisName.TOOL, distance=mm))

    def arm(self, job: Job, strategy: Strategy = Strategy.PVT, **more: Any) -> StationState:
        return self.do(Arm(job=job, job_sha256="0" * 64, strategy=strategy, **more))

    def when(self, condition: Callable[[Snapshot], bool], act: Callable[[], None]) -> None:
        """Do something once, at the first look that fulfils a condition."""
        done: list[bool] = []

        def look(snapshot: Snapshot) -> None:
            if not done and condition(snapshot):
                done.append(True)
                act()

        self.looks.append(look)


def open_floor(
    records: Path,
    seed: int = 1,
    plant: str = "mounted",
    machine: LoadedMachine | None = None,
    turned_deg: float = 0.0,
    *,
    blind: bool = False,
    placed: LathePlacement | None = None,
    begins: SessionStart | None = None,
    owned: bool = False,
) -> Floor:
    """A station on a machine whose chuck and tool were mounted by chance; connected and verified.

    The lathe is that of the paper with everything close together, unless another is given. The chuck may be
    mounted so much further on than by that chance. A `blind` lathe shows dials, not the truth. One that is
    `placed` does not begin at power-up, and the station `begins` with what was known of it. Where it is to be
    `owned`, its control can be taken by others.
    """
    machine = machine or compact_machine()
    true = plant_named(plant, machine.machine, seed, mounted_by_hand=True)
    if turned_deg and true.jaw_1_deg is not None:
        true = replace(true, jaw_1_deg=(true.jaw_1_deg + turned_deg) % 360.0)
    true = true if placed is None else begun_at(true, placed)
    sim = SimulatedLathe(machine.machine, true, blind=blind)
    if placed is not None:
        sim.take_over(placed)
    floor = floor_at(sim, records, machine, begins=begins, owned=owned)
    assert floor.station.connect()
    return floor


def floor_at(
    sim: SimulatedLathe,
    records: Path,
    machine: LoadedMachine,
    *,
    begins: SessionStart | None = None,
    owned: bool = False,
) -> Floor:
    """A station at a lathe that is there already, not connected yet; as for `open_floor`."""
    link = MemoryLink(sim.connect(), sim)
    stop = StopPath(link)
    made: list[Floor] = []

    def seen(snapshot: Snapshot) -> None:
        for floor in made:
            for look in tuple(floor.looks):
                look(snapshot)
            floor.station.take_poll(snapshot)

    client = PmacClient(link, sim)
    guards = (Heartbeat(client, sim, machine.machine), Ownership(client)) if owned else ()
    lathe = Lathe(client, machine.machine, sim, stop, seen, *guards)
    context = StationContext(
        lathe=lathe,
        owning=MachineControl(lathe, link.address, records),
        loaded_machine=machine,
        clock=sim,
        shop=sim,
        records=records,
        local_time=lambda: LOCAL_TIME,
        client=client,
        begins=begins,
    )
    floor = Floor(sim=sim, lathe=lathe, stop=stop, link=link, station=Station(context), context=context)
    made.append(floor)
    return floor


def experiment_1(cut_length_mm: float = 1.5) -> Job:
    """The first job of the paper, with a shorter cut: what it takes to plan and to cut goes with its turns."""
    return replace(load_job("lee-2001-experiment-1").job, cut_length_mm=cut_length_mm)


_SET_UP: dict[tuple[str, int], Floor] = {}


def set_up_once(records: Path, plant: str = "mounted", seed: int = 1) -> Floor:
    """A floor set up for experiment 1 of any length, the same for all who ask: work it in a copy of the process.

    What is written in its records is taken away.
    """
    if (plant, seed) not in _SET_UP:
        _SET_UP[plant, seed] = open_floor(records, seed, plant)
        _SET_UP[plant, seed].set_up(experiment_1())
    floor = _SET_UP[plant, seed]
    shutil.rmtree(floor.context.records)
    floor.context.records.mkdir()
    return floor


def known(value: T | None) -> T:
    """Return what has to be there."""
    assert value is not None
    return value


def codes(state: StationState) -> list[str]:
    """The alarms of a state."""
    return [alarm.problem.code for alarm in state.alarms]


def refused_codes(state: StationState) -> list[str]:
    """Why the last orders were refused."""
    return [problem.code for problem in state.refusals]


def in_turn(floor: Floor, turn: float) -> bool:
    """Whether the tool is in the part, beyond this turn of the cut."""
    cut = floor.state.cut
    return cut is not None and cut.stage is CutStage.CUT and cut.turn > turn


def order(floor: Floor, *commands: Command) -> None:
    """Press keys; each must be taken."""
    for command in commands:
        assert floor.station.post(command), floor.state.refusals
