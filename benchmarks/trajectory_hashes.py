"""One hash for each of many scenarios on the simulated lathe: the same hashes, the same trajectories to the bit.

For changes that only make the simulation faster: run it before and after, and compare. What goes into a hash is
every servo cycle of each awake motor, the state of the motors and the P-variables at each background cycle, every
reply to the hosts, and the measured part.

    python -m benchmarks.trajectory_hashes [NAME ...]
"""

from __future__ import annotations

import hashlib
import struct
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from random import Random
from time import process_time
from typing import Any

from drivers.cutting.planning import plan_cut
from drivers.cutting.strategy import Strategy
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.gathering.gather import gather_settings
from drivers.pmac.gathering.gather_client import motor_channel
from drivers.pmac.heartbeat import watchdog
from drivers.pmac.heartbeat.plc import Policy, set_up_lines
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.reserved import ACTIVITY
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.store import load_job, load_machine

GATHERED = ("commanded", "actual", "following_error", "velocity")
FAULTS: tuple[tuple[str, dict[str, str | float]], ...] = (
    ("encoder-loss", {"motor": "tool"}),
    ("encoder-loss", {"motor": "spindle"}),
    ("encoder-loss", {"motor": "carriage"}),
    ("following-error-trip", {"motor": "tool"}),
    ("following-error-trip", {"motor": "carriage"}),
    ("index-lost", {"motor": "spindle"}),
    ("amplifier-fault", {"motor": "spindle"}),
    ("limit", {"motor": "carriage"}),
    ("spindle-ripple", {"ripple_percent": 3.0}),
    ("slow-background", {}),
)
HOST_LINES = (
    "#1?#2?#3?",
    "#1P#2P#3P#1V#2V#3V#1F#2F#3F",
    "??",
    "???",
    "&1%100",
    "&1%50",
    "&1%0",
    "&1H",
    "&1R",
    "&1S",
    "&1Q",
    "&1A",
    "#1J/",
    "#2J/",
    "#3J/",
    "#1J+",
    "#1J-",
    "#2J+",
    "#2J-",
    "#3J+",
    "#1J=1000",
    "#1J:500",
    "#3J:-2000",
    "#2J:3000",
    "#1J=",
    "#1K",
    "#2K",
    "#3K",
    "#1HM",
    "#3HM",
    "#2HMZ",
    "#1O2",
    "#3O-1",
    "#2O3",
    "&1B1R",
    "P100",
    "P200=P200+1",
    "\x01",
    "\x0b",
    "\x0f",
    "#1J^0",
    "&1PMATCH",
    "&1X=0",
    "&1Z",
    "I130=I130",
    "#1J/ #2J/ #3J/",
)

PROGRAM = (
    "CLOSE", "OPEN PROG1 CLEAR", "TA20 TS5 F5 INC", "P300=0", "WHILE(P300<20)", "X0.5 Z-0.4", "DWELL7",
    "X-0.5 Z0.4", "P300=P300+1", "M70==P300*2", "PVT20", "X0.1:2 Z0:0", "X0.1:0 Z0:0", "LINEAR", "ENDWHILE",
    "CLOSE",
)  # fmt: skip


class Watched(SimulatedLathe):
    """A lathe whose trajectories go into a hash."""

    def __init__(self, machine: MachineProfile, **named: Any) -> None:
        super().__init__(machine, **named)
        self.digest = hashlib.sha256()
        self.blocks = 0
        pass_along = self._floor.pass_along

        def kept(tracks: Mapping[int, Any], now_ms: float) -> None:
            for number, track in tracks.items():
                self.digest.update(struct.pack(f"<i{len(track)}d", number, *track))
            pass_along(tracks, now_ms)

        self._floor.pass_along = kept  # type: ignore[method-assign,assignment]

    def _run_block(self) -> None:
        super()._run_block()
        self.blocks += 1
        controller, note = self.controller, self.digest.update
        for number in (1, 2, 3):
            motor = controller.motors[number]
            numbers = (
                motor.desired, motor.velocity, motor.actual, motor.true_position, motor.pace, motor.correction,
                motor.superimposed, motor.counter, motor.encoder, motor.encoder_step, motor.following_error,
            )  # fmt: skip
            note(struct.pack("<11d", *map(float, numbers)))
            flags = motor.enabled, motor.in_position, motor.warning, motor.jog.stage, motor.jog.aborting
            note(repr((*flags, motor.travel, motor.home_complete, motor.fatal_error)).encode())
        if self.blocks % 16 == 0:
            note(repr([float(controller.variables.get(VariableKind.P, index)) for index in range(1024)]).encode())
            note(repr([(s.executing(), s.time_base.percent) for s in controller.systems.values()]).encode())
            note(repr(self.collisions).encode())


class Scene:
    """One lathe with one host."""

    def __init__(self, plant: str = "ideal", family: str = "pmac", **machine: Any) -> None:
        self.machine = compact(**machine)
        true = plant_named("ideal" if plant == "bare" else plant, self.machine, 7, mounted_by_hand=plant != "bare")
        self.sim = Watched(self.machine, true=true, dialect=DIALECTS[family])
        self.dialect = DIALECTS[family]
        self.port = self.sim.connect()
        self.mounted = False
        self.raw("I3=2 I6=1\r")

    def mount(self, job: Job) -> None:
        """Clamp a blank."""
        self.sim.mount(job)
        self.mounted = True

    def raw(self, text: str) -> bytes:
        """Send characters, let the controller serve them, and hash the reply."""
        self.port.receive(text.encode("latin-1"))
        while not self.port.idle or self.port.ready:
            self.sim.attend(self.port)
            if not self.port.ready:
                break
        said = self.port.take_output()
        self.sim.digest.update(said)
        return said

    def say(self, *lines: str) -> None:
        """Send lines."""
        for line in lines:
            self.raw(line + "\r")

    def wait(self, seconds: float) -> None:
        """Let time pass in uneven steps, as a host does."""
        self.sim.wait(seconds)

    def settle(self, most_s: float = 40.0) -> None:
        """Wait until nothing is commanded to move, with polls."""
        controller, end_s = self.sim.controller, self.sim.now_s() + most_s
        while self.sim.now_s() < end_s:
            self.wait(0.047)
            self.say("#1?PVF#2?PVF#3?PVF&1??")
            moving = any(s.moving or s.running for s in controller.systems.values())
            if not moving and not any(motor.jogging for motor in controller.motors.values()):
                return

    def home(self) -> None:
        """Close the loops and home."""
        self.say("#1J/", "#2J/", "#3J/", "#1HM", "#3HM", "#2HM")
        self.settle()

    def load_heartbeat(self) -> None:
        """Load PLC 20 and let it run."""
        self.say(*set_up_lines(self.machine, self.dialect, Policy.RETRACT), "I5=2")

    def gather(self, period: int = 1) -> None:
        """Gather four registers of the tool, in each servo cycle by default."""
        channels = [motor_channel(name, 1, self.dialect.factory, self.dialect) for name in GATHERED]
        settings = gather_settings([channel.source for channel in channels], period, self.dialect)
        self.say(*(f"I{index}={value}" for index, value in settings.items()), "DEFINE GATHER 3000", "GATHER")

    def cut(self, strategy: Strategy, length_mm: float = 0.3, **more: Any) -> None:
        """Clamp, home, and go to the start of a cut and through it, polling now and then."""
        job = short(length_mm)
        self.mount(job)
        plan = plan_cut(job, self.machine, strategy, **more)
        self.home()
        self.say(*plan.program.lines)
        motors = self.machine.motors
        places = plan.tool_start, plan.spindle_start, plan.carriage_start
        for motor, place in zip(motors[1:], places[1:], strict=True):
            self.say(f"#{motor}J={place}")
        self.settle()
        self.say(f"#1J={places[0]}")
        self.settle()
        if self.machine.spindle.drive != "servo":
            self.sim.set_spindle(job.spindle_speed_rpm)
            self.wait(3.0)
        self.say(f"&1B{plan.program.number}R")

    def finish(self) -> str:
        """Return the hash, with the shape of the part in it."""
        if self.mounted:
            trace = self.sim.measure()
            self.sim.digest.update(trace.deviation_um.tobytes())
        return self.sim.digest.hexdigest()[:16]


def compact(drive: str = "servo") -> MachineProfile:
    """The bundled lathe with everything close together."""
    machine = load_machine("lee-2001-lathe").machine
    tool, carriage = replace(machine.tool, home_radius_mm=29.0), replace(machine.carriage, jaw_face_mm=40.0)
    machine = replace(machine, tool=tool, carriage=carriage)
    if drive == "servo":
        return machine
    spindle = replace(machine.spindle, drive=drive, ramp_rpm_per_s=500.0, slip_rpm=60.0)
    controller = replace(machine.controller, axis_definitions=("#1->X", "#3->Z"))
    return replace(machine, spindle=spindle, controller=controller)


def short(length_mm: float) -> Job:
    """A short cut of the paper's first experiment."""
    return replace(load_job("lee-2001-experiment-1").job, cut_length_mm=length_mm)


def _homing_and_jogs(plant: str, family: str) -> Scene:
    scene = Scene(plant, family)
    scene.home()
    scene.say("#1J=3000", "#3J:-4000", "#2J+")
    scene.wait(0.7)
    scene.say("#2J/", "#1J:-500", "I122=40", "#3J+")
    scene.wait(0.31)
    scene.say("#3J/", "#1K")
    scene.wait(3.0)
    scene.say("#1J/", "#1J=100^-40", "#2O4")
    scene.wait(2.0)
    scene.say("\x01")
    scene.settle()
    scene.wait(5.0)
    scene.say("\x0b")
    scene.wait(8.0)
    return scene


def _limits(plant: str) -> Scene:
    scene = Scene(plant)
    scene.home()
    scene.say("I113=2500", "I114=-300", "#1J+")
    scene.settle(3.0)
    scene.say("#1J-")
    scene.settle(3.0)
    scene.say("I113=0", "I114=0", "#1J+", "#3J+")
    scene.wait(4.0)
    scene.say("#1J-", "#3J-")
    scene.wait(4.0)
    return scene


def _cut(strategy: Strategy, plant: str, family: str = "pmac", beat: bool = False) -> Scene:
    outside = strategy in (Strategy.CAM, Strategy.TIMEBASE)
    scene = Scene(plant, family, drive="inverter" if outside and plant == "steady" else "servo")
    if beat:
        scene.load_heartbeat()
    scene.cut(strategy)
    scene.settle()
    scene.wait(1.0)
    return scene


def _held(plant: str) -> Scene:
    scene = Scene(plant)
    scene.cut(Strategy.PVT)
    scene.wait(0.613)
    scene.say("&1H")
    scene.wait(0.3)
    scene.say("&1R", "&1%50")
    scene.wait(0.21)
    scene.say("&1%120")
    scene.wait(0.3)
    scene.say("&1/")
    scene.settle()
    scene.say("&1%100", "&1R")
    scene.wait(0.4)
    scene.say("&1A")
    scene.settle()
    scene.wait(1.0)
    return scene


def _gathering(plant: str, period: int) -> Scene:
    scene = Scene(plant)
    scene.gather(period)
    scene.say("#1J/", "#2J/", "#3J/", "#1J:3000", "#2J+")
    scene.wait(0.4)
    scene.say("#1HM", "#3J:-300")
    scene.wait(0.8)
    scene.say("ENDGATHER", "LIST GATHER", "DELETE GATHER", "#2J/")
    scene.settle()
    scene.cut(Strategy.PVT)
    scene.wait(0.2)
    scene.gather(period)
    scene.settle()
    scene.say("ENDGATHER", "LIST GATHER")
    return scene


def _heartbeat(family: str) -> Scene:
    scene = Scene("steady", family)
    scene.load_heartbeat()
    timer = watchdog.watchdog_timer(scene.dialect).name
    scene.cut(Strategy.PVT, 1.0)
    scene.say(f"{timer}=1000", f"P{ACTIVITY}=2")
    for _ in range(4):
        scene.wait(0.1)
        scene.say(f"{timer}=1000")
    scene.settle()
    scene.wait(2.0)
    return scene


def _random(seed: int) -> Scene:
    """Random lines, control characters and faults at random times."""
    random = Random(seed)
    scene = Scene(("ideal", "bare", "steady")[seed % 3], ("pmac", "turbo")[seed // 3 % 2])
    scene.say(*PROGRAM)
    if seed % 4 == 0:
        scene.load_heartbeat()
    if seed % 5 == 0:
        scene.mount(short(0.5))
    if seed % 2:
        scene.home()
    for _ in range(70):
        scene.wait(random.choice((0.003, 0.02, 0.1, 0.4)) * random.random())
        line = random.choice(HOST_LINES)
        scene.raw(line if line < " " else line + "\r")
        if random.random() < 0.05:
            name, given = random.choice(FAULTS)
            scene.sim.faults.inject(name, for_s=random.random(), seed=seed, **given)  # type: ignore[arg-type]
        if random.random() < 0.05:
            scene.gather(random.choice((1, 3, 20)))
        if random.random() < 0.03:
            entries = [str(round(300 * random.random())) for _ in range(8)] + ["0"]
            scene.say("#1DEFINE COMP 9,#2,#1,4000", *entries, "I51=1")
        if random.random() < 0.04:
            scene.say(
                random.choice(("I106=1 I105=I205", "I106=0", "I51=0", "I5=0", "I5=2", "#1K I100=0", "I100=1"))
            )
    scene.wait(3.0)
    return scene


def scenarios() -> Iterator[tuple[str, Callable[[], Scene]]]:
    """Yield the scenarios by name."""
    for plant in ("ideal", "bare", "steady"):
        for family in ("pmac", "turbo"):
            yield f"jogs {plant} {family}", lambda p=plant, f=family: _homing_and_jogs(p, f)  # type: ignore[misc]
        yield f"limits {plant}", lambda p=plant: _limits(p)  # type: ignore[misc]
        yield f"held {plant}", lambda p=plant: _held(p)  # type: ignore[misc]
        for period in (1, 4):
            yield f"gather {plant} {period}", lambda p=plant, n=period: _gathering(p, n)  # type: ignore[misc]
        for strategy in Strategy:
            yield f"cut {strategy} {plant}", lambda p=plant, s=strategy: _cut(s, p)  # type: ignore[misc]
    for strategy in (Strategy.CAM, Strategy.PVT):
        yield (
            f"cut {strategy} realistic turbo beat",
            lambda s=strategy: _cut(s, "steady", "turbo", beat=True),  # type: ignore[misc]
        )
    for family in ("pmac", "turbo"):
        yield f"heartbeat {family}", lambda f=family: _heartbeat(f)  # type: ignore[misc]
    for seed in range(24):
        yield f"random {seed}", lambda n=seed: _random(n)  # type: ignore[misc]


def main() -> None:
    """Print the hash of each scenario, its simulated time, and how many times as fast as real time it was."""
    asked = sys.argv[1:]
    for name, run in scenarios():
        if asked and not any(word in name for word in asked):
            continue
        begun_s = process_time()
        try:
            scene = run()
            took_s, found = process_time() - begun_s, scene.finish()
            print(f"{name:32} {found}  {scene.sim.now_s():7.2f} s  {scene.sim.now_s() / took_s:6.1f}", flush=True)
        except PmacError as failed:
            print(f"{name:32} {failed}", flush=True)


if __name__ == "__main__":
    main()
