"""How much faster than real time the simulated controller runs three axes in closed loop.

Every axis is the tool's linear motor under its PID, so that no row is cheaper because of an ideal axis. The
baseline is the three bare loops, without a controller round them.

    python -m benchmarks.simulation_speed
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from benchmarks.measure import extent, print_table, seconds
from drivers.cutting.planning import CutPlan, plan_cut
from drivers.cutting.strategy import Strategy
from drivers.pmac.axes import read_definitions
from drivers.pmac.dialect import Dialect
from drivers.pmac.gathering.gather import gather_settings
from drivers.pmac.gathering.gather_client import motor_channel
from drivers.pmac.heartbeat.plc import Policy, set_up_lines
from drivers.pmac.heartbeat.watchdog import GuardedActivity, watchdog_timer
from drivers.pmac.language.text import format_number
from drivers.pmac.reserved import ACTIVITY
from drivers.pmac.settings import settings_with
from drivers.simulator.card.controller import SimulatedController
from drivers.simulator.card.jog_motion import HomeSensor
from drivers.simulator.card.registers import CardMemory
from drivers.simulator.faults.lines import Lines
from drivers.simulator.hosts.port import Port
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.axis import Axis
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.store import load_job, load_machine

RUNS = extent(5, 1)
PLAIN_S = extent(10.0, 0.5)
"""Simulated time of the rows that have no program."""

LOOP_SETTINGS = (8, 9, 11, 12, 30, 31, 32, 33, 34, 35, 63, 69)
"""Ix numbers that all three motors take from the tool."""

CAM_ENTRIES = 100
LONG_CYCLES = 8_000_000
"""A watchdog timer that does not run out."""

GATHERED = ("commanded", "actual", "following_error", "velocity")

AIM = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Rate:
    """Simulated and real time of one run, s, and the servo cycles in it."""

    simulated_s: float
    wall_s: float
    cycles: int

    @property
    def multiple(self) -> float:
        """Simulated over real time."""
        return self.simulated_s / self.wall_s

    @property
    def us_per_cycle(self) -> float:
        """Real time of one servo cycle of all three axes."""
        return 1e6 * self.wall_s / self.cycles


class Bench:
    """A controller with three PID axes and one host, advanced a background cycle at a time."""

    def __init__(self, machine: MachineProfile) -> None:
        settings = settings_with(machine.controller.variables)
        tool = machine.tool.motor
        motors = (tool, machine.spindle.motor, machine.carriage.motor)
        for motor in motors:
            settings.update({100 * motor + n: settings.get(100 * tool + n, 0.0) for n in LOOP_SETTINGS})
        axes: dict[int, tuple[Axis, HomeSensor]] = {
            motor: (SimulatedLathe(machine).tool, HomeSensor()) for motor in motors
        }
        period_ms = machine.controller.servo_period_ms
        definitions = read_definitions(machine.controller.axis_definitions)
        self.controller = SimulatedController(settings, axes, definitions, period_ms)
        self.controller.variables.memory = CardMemory(self.controller)
        self.block = max(1, round(machine.controller.background_ms / period_ms))
        self._port = Port(self.controller, Lines(now_s=lambda: 0.0))
        self.say(*(f"#{motor}J/" for motor in motors))

    @property
    def moving(self) -> bool:
        """Whether anything is commanded to move."""
        motors = self.controller.motors.values()
        return self.controller.systems[1].moving or any(motor.jogging for motor in motors)

    def say(self, *lines: str) -> None:
        """Send lines as a host does.

        Raises:
            RuntimeError: the controller refused one.
        """
        for line in lines:
            self._port.receive(line.encode("ascii") + b"\r")
            self.advance()
            reply = self._port.take_output()
            if b"\x07" in reply:
                raise RuntimeError(f"{line}: {reply!r}")

    def advance(self) -> None:
        """Run one background cycle."""
        self.controller.run_block(self.block)
        self.controller.background()
        self._port.service()

    def measure(self, goes_on: Callable[[], bool]) -> Rate:
        """Advance while `goes_on` says so.

        Raises:
            RuntimeError: an axis fell out of its loop, so that the rate means nothing.
        """
        before = self.controller.cycles

        def run() -> None:
            while goes_on():
                self.advance()

        wall_s = seconds(run)
        if not all(motor.enabled for motor in self.controller.motors.values() if motor.activated):
            raise RuntimeError("an axis fell out of its loop")
        cycles = self.controller.cycles - before
        simulated_s = cycles * self.controller.servo_period_ms / 1000.0
        return Rate(simulated_s=simulated_s, wall_s=wall_s, cycles=cycles)

    def for_a_while(self) -> Rate:
        """Measure for a fixed simulated time."""
        end_ms = self.controller.now_ms + 1000.0 * PLAIN_S
        return self.measure(lambda: self.controller.now_ms < end_ms)


def bare_loops(machine: MachineProfile) -> Rate:
    """Three PID loops that hold still, and nothing else."""
    period_s = machine.controller.servo_period_ms / 1000.0
    block = max(1, round(machine.controller.background_ms / machine.controller.servo_period_ms))
    axes = [SimulatedLathe(machine).tool for _ in range(3)]
    still = [0.0] * block
    blocks = round(PLAIN_S / period_s / block)

    def run() -> None:
        for _ in range(blocks):
            for axis in axes:
                axis.follow(list(still))  # an axis returns its last block for the same list

    wall_s = seconds(run)
    return Rate(simulated_s=blocks * block * period_s, wall_s=wall_s, cycles=blocks * block)


def at_rest(machine: MachineProfile) -> Rate:
    """The controller holds three axes."""
    return Bench(machine).for_a_while()


def jogging(machine: MachineProfile) -> Rate:
    """Three indefinite jogs."""
    bench = Bench(machine)
    bench.say("#1J+", "#2J+", "#3J+")
    return bench.for_a_while()


def led_by_a_cam(machine: MachineProfile) -> Rate:
    """The same, with the tool on a table by the angle of the spindle."""
    bench = Bench(machine)
    bench.say(*cam_lines(machine))
    bench.say("#1J+", "#2J+", "#3J+")
    return bench.for_a_while()


def gathering(machine: MachineProfile) -> Rate:
    """The same with four registers gathered in every servo cycle instead, and no cam."""
    bench = Bench(machine)
    bench.say(*gather_lines(bench.controller.dialect))
    bench.say("#1J+", "#2J+", "#3J+")
    return bench.for_a_while()


def everything(machine: MachineProfile) -> Rate:
    """The cam and the gathering at once, with the heartbeat PLC guarding a cut."""
    bench = Bench(machine)
    dialect = bench.controller.dialect
    bench.say(*set_up_lines(machine, dialect, Policy.RETRACT), f"{watchdog_timer(dialect).name}={LONG_CYCLES}")
    bench.say("I5=2", f"P{ACTIVITY}={GuardedActivity.CUT:d}")
    bench.say(*cam_lines(machine), *gather_lines(dialect))
    bench.say("#1J+", "#2J+", "#3J+")
    return bench.for_a_while()


def cam_lines(machine: MachineProfile) -> list[str]:
    """Return the lines that put the tool on a table."""
    spindle, tool = machine.spindle, machine.tool.motor
    entries = (round(1000 * math.sin(6 * math.pi * k / CAM_ENTRIES)) for k in range(1, CAM_ENTRIES + 1))
    sources = f"#{spindle.motor},#{tool},{spindle.counts_per_rev}"
    return [f"#{tool}DEFINE COMP {CAM_ENTRIES},{sources}", *map(str, entries), "I51=1"]


def gather_lines(dialect: Dialect) -> list[str]:
    """Return the lines that gather four registers in every servo cycle."""
    channels = [motor_channel(name, 1, dialect.factory, dialect) for name in GATHERED]
    settings = gather_settings([channel.source for channel in channels], 1, dialect)
    return [*(f"I{index}={value}" for index, value in settings.items()), "DEFINE GATHER", "GATHER"]


def program(machine: MachineProfile, plan: CutPlan) -> Rate:
    """A whole motion program, from R until everything stands still."""
    bench = Bench(machine)
    starts = (plan.tool_start, plan.spindle_start, plan.carriage_start)
    motors = machine.motors
    bench.say(*(f"#{motor}J={format_number(start)}" for motor, start in zip(motors, starts, strict=True)))
    while bench.moving:
        bench.advance()
    bench.say("CLOSE", *plan.program.lines, f"&1B{plan.program.number}R")
    rate = bench.measure(lambda: bench.moving)
    if bench.controller.systems[1].motion.runtime_error:
        raise RuntimeError("the program ended with a run-time error")
    return rate


def middle(run: Callable[[], Rate]) -> Rate:
    """Return the run with the median speed."""
    rates = sorted((run() for _ in range(RUNS)), key=lambda rate: rate.multiple)
    median = statistics.median_low(rate.multiple for rate in rates)
    return next(rate for rate in rates if rate.multiple == median)


def plans(machine: MachineProfile, job: Job) -> list[tuple[str, CutPlan]]:
    """Return the programs that are measured, with their names."""
    return [
        ("LINEAR, paper program, TS10", plan_cut(job, machine, Strategy.PAPER)),
        ("LINEAR, paper program, TS5", plan_cut(job, machine, Strategy.PAPER, ts_ms=5)),
        ("PVT, inverted servo", plan_cut(job, machine, Strategy.PVT)),
    ]


def main() -> None:
    """Measure and print."""
    machine = load_machine("lee-2001-lathe").machine
    job = load_job("lee-2001-experiment-1").job
    rates = [
        ("three bare loops (baseline)", middle(lambda: bare_loops(machine))),
        ("controller, at rest", middle(lambda: at_rest(machine))),
        ("controller, jogging", middle(lambda: jogging(machine))),
        ("controller, jogging, on a cam", middle(lambda: led_by_a_cam(machine))),
        ("controller, jogging, gathering", middle(lambda: gathering(machine))),
        ("the same on a cam, with PLC 20", middle(lambda: everything(machine))),
        *((name, middle(partial(program, machine, plan))) for name, plan in plans(machine, job)),
    ]
    baseline = rates[0][1]
    rows = [
        (
            name,
            f"{rate.simulated_s:.1f} s",
            f"{rate.multiple:.0f}",
            f"{rate.us_per_cycle:.2f} us",
            f"{rate.us_per_cycle / baseline.us_per_cycle:.2f}",
        )
        for name, rate in rates
    ]
    title = f"Three PID axes in closed loop, median of {RUNS}; the aim is {AIM:.0f} times real time"
    print_table(title, ("", "simulated", "x real time", "a servo cycle", "x baseline"), rows)


if __name__ == "__main__":
    main()
