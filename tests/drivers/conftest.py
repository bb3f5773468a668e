"""A simulated lathe on the bench: card, link, client, stop path and lathe, on one clock that is advanced."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import pytest

from drivers.cutting.planning import CutPlan
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import AxisName
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.simulator.hosts.port import Port
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.axis import Axis
from drivers.simulator.plant.true_parameters import TrueParameters, as_simulated, ideal
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.store import load_job, load_machine
from tests.drivers.wire_card import Wire, wire

JobMaker = Callable[[int], Job]


class Recorder:
    """Stands between a motor and its axis and keeps what passes, one value for each servo cycle."""

    def __init__(self, axis: Axis) -> None:
        self._axis = axis
        self.encoder_lost = self.jammed = False
        self.commands: list[float] = []
        self.positions: list[float] = []

    @property
    def origin(self) -> float:
        return self._axis.origin

    @origin.setter
    def origin(self, value: float) -> None:
        self._axis.origin = value

    def close_loop(self) -> float:
        return self._axis.close_loop()

    def rebase(self, counts: float) -> None:
        self._axis.rebase(counts)

    def follow(self, commands: Sequence[float]) -> list[float]:
        positions = self._axis.follow(commands)
        self.commands += commands
        self.positions += positions
        return positions

    def push(self, output: float, cycles: int) -> list[float]:
        positions = self._axis.push(output, cycles)
        self.commands += positions
        self.positions += positions
        return positions

    def coast(self, cycles: int) -> list[float]:
        positions = self._axis.coast(cycles)
        self.commands += positions
        self.positions += positions
        return positions


@dataclass(frozen=True, kw_only=True)
class Bench:
    """One simulated lathe with one host."""

    sim: SimulatedLathe
    port: Port
    client: PmacClient
    lathe: Lathe
    stop: StopPath

    def raw(self, data: str | bytes) -> bytes:
        """Send bytes as they are and return what comes back within two background cycles."""
        self.port.receive(data.encode("latin-1") if isinstance(data, str) else data)
        self.sim.wait(0.011)
        return self.port.take_output()

    def ask(self, line: str) -> str:
        """Return the one value that a line asks for."""
        return self.client.query(line)[0]

    def number(self, line: str) -> float:
        return float(self.ask(line))

    def program(self, *lines: str, number: int = 1) -> None:
        """Load a program and point coordinate system 1 at it."""
        self.client.download(("CLOSE", f"OPEN PROG{number}", "CLEAR", *lines, "CLOSE"))
        self.client.request(f"&1B{number}")

    def settle(self, timeout_s: float = 30.0) -> None:
        """Let time pass until nothing is commanded to move any more."""
        deadline = self.sim.now_s() + timeout_s
        while self.sim.now_s() < deadline:
            self.sim.wait(0.02)
            if self.lathe.snapshot().at_rest and not self.moving:
                return
        raise AssertionError(f"still moving after {timeout_s} s")

    def carriage_to(self, counts: float) -> None:
        """Jog the carriage ten times as fast as an operator would: nothing is told of the way."""
        usual = self.lathe.machine.controller.variables["I322"]
        self.client.request(f"I322={10 * usual}")
        self.lathe.jog_to(AxisName.CARRIAGE, counts)
        self.client.request(f"I322={usual}")

    def homed(self, job: Job) -> None:
        """Home the axes, and clamp the blank of a job."""
        self.lathe.enable()
        self.lathe.home()
        self.sim.mount(job)

    def to_start(self, plan: CutPlan) -> None:
        """Bring the axes to where a cut begins."""
        self.carriage_to(plan.carriage_start)
        self.lathe.jog_to(AxisName.SPINDLE, plan.spindle_start)
        self.lathe.jog_to(AxisName.TOOL, plan.tool_start)

    def begin(self, plan: CutPlan) -> None:
        """Load a cut, bring the axes to where it begins, and start it, as the console does it."""
        self.lathe.program.load(plan.program)
        self.lathe.jog_to(AxisName.TOOL, plan.setup.retracted)
        self.to_start(plan)
        self.lathe.program.start(plan.program.number, plan.setup.retracted)

    def cut(self, plan: CutPlan) -> None:
        """Make the whole cut."""
        self.begin(plan)
        self.lathe.program.follow(lambda snapshot: None, timeout_s=2 * plan.duration_s)

    @property
    def moving(self) -> bool:
        controller = self.sim.controller
        return any(s.moving or s.running for s in controller.systems.values()) or any(
            motor.jogging for motor in controller.motors.values()
        )

    def record(self, motor: int) -> Recorder:
        """Keep every command and position of a motor from now on."""
        target = self.sim.controller.motors[motor]
        recorder = Recorder(target.axis)
        target.axis = recorder
        return recorder

    @property
    def cycle_ms(self) -> float:
        return self.sim.controller.servo_period_ms


TrueBenchMaker = Callable[[TrueParameters], Bench]


def beside_home(machine: MachineProfile, true: TrueParameters | None = None) -> TrueParameters:
    """Return what a lathe is, with a tenth of the way to go: one that stands elsewhere on purpose stays there."""
    own = true or ideal(machine)
    usual = ideal(machine)
    if (own.tool_start_mm, own.carriage_start_mm, own.spindle_start_turns) != (
        usual.tool_start_mm,
        usual.carriage_start_mm,
        usual.spindle_start_turns,
    ):
        return own
    return replace(own, tool_start_mm=0.1, carriage_start_mm=0.2, spindle_start_turns=0.95)


def build(machine: MachineProfile, true: TrueParameters | None = None) -> Bench:
    sim = SimulatedLathe(machine, beside_home(machine, true))
    port = sim.connect()
    link = MemoryLink(port, sim)
    client = PmacClient(link, sim)
    stop = StopPath(link)
    lathe = Lathe(client, machine, sim, stop)
    return Bench(sim=sim, port=port, client=client, lathe=lathe, stop=stop)


def connected(machine: MachineProfile, setup: Iterable[str] = (), true: TrueParameters | None = None) -> Bench:
    bench = build(machine, true)
    bench.lathe.connect()
    for line in setup:
        bench.client.request(line)
    return bench


@pytest.fixture(scope="session")
def machine() -> MachineProfile:
    """Its parts have one lobe along Z, as those of the lathe `ideal`."""
    return as_simulated(load_machine("lee-2001-lathe").machine, None)


@pytest.fixture(scope="session")
def experiment() -> JobMaker:
    """The jobs of the paper by their number."""
    return lambda number: load_job(f"lee-2001-experiment-{number}").job


@pytest.fixture
def bench_with(machine: MachineProfile) -> TrueBenchMaker:
    """Connected benches whose iron is not what the profile says."""
    return lambda true: connected(machine, true=true)


@pytest.fixture
def bench(machine: MachineProfile) -> Bench:
    """Connected, drives killed, as after power-up."""
    return connected(machine)


@pytest.fixture
def closed(machine: MachineProfile) -> Bench:
    """Connected and verified, all three loops closed where the axes stand."""
    made = connected(machine)
    assert made.lathe.verify() == ()
    made.lathe.enable()
    return made


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    """A card of either family at the end of a wire."""
    dialect: Dialect = request.param
    return wire(machine, dialect)
