"""A shift at a simulated lathe: the console that is opened at it, and which invariant was broken."""

from __future__ import annotations

import json
import os
import resource
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from console.session.data.run_reader import runs, story
from console.session.station.commands import (
    Acknowledge,
    Arm,
    Command,
    DisableDrives,
    EnableDrives,
    Forget,
    Home,
    Jog,
    Measure,
    Recover,
    Retract,
    Start,
    TakeControl,
)
from console.session.station.state import IDLE, Activity
from console.text.catalogue import Catalogue, load
from drivers.cutting.planning import Strategy
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from tests.compact import compact_machine
from tests.console.floor import Floor, experiment_1, floor_at


def opened_floor(records: Path, seed: int, sim: SimulatedLathe | None = None) -> Floor:
    """Connect a console; without a lathe to a new one, with chuck and tool mounted by the chance of a seed."""
    machine = compact_machine()
    sim = sim or SimulatedLathe(
        machine.machine, plant_named("mounted", machine.machine, seed, mounted_by_hand=True)
    )
    floor = floor_at(sim, records, machine, owned=True)
    floor.station.connect()
    return floor


# Plays a script at a simulated lathe with the session engine of the screens, and holds it to its invariants.
#
# No terminal, no sleep: the clock of the lathe is advanced. After each event everything must be as an operator may
# expect: nothing moves unasked, every stop is proven, every alarm has its sentence in both languages, no run is
# missing in the record, and files and threads do not grow.

CUT_MM = 0.5
LOOK_S, STILL_S = 0.3, 0.5
MOST_RUNS = 1_000_000
MOST_FILES, MOST_THREADS = 24, 12
"""More than when the shift began."""

RUN_OUT_S = 25.0
"""A killed spindle runs out, and a controller without a host ends what it does."""


SETTLES_S = 60.0
"""A stop is repeated until rest is proven, or nothing answers any more: then the machine is lost."""


class BrokenError(AssertionError):
    """An invariant does not hold."""


@dataclass(kw_only=True)
class Count:
    """How often each thing happened, and how often the shift went on after it."""

    tried: Counter[str] = field(default_factory=Counter)
    survived: Counter[str] = field(default_factory=Counter)
    alarms: Counter[str] = field(default_factory=Counter)
    runs: int = 0
    cuts: int = 0
    parts: int = 0

    def add(self, other: Count) -> None:
        """Add what another shift has counted."""
        self.tried += other.tried
        self.survived += other.survived
        self.alarms += other.alarms
        self.runs, self.cuts, self.parts = self.runs + other.runs, self.cuts + other.cuts, self.parts + other.parts


class Shift:
    """One lathe, and the consoles that work it one after the other; `now_s` is its time."""

    def __init__(self, records: Path, seed: int, count: Count) -> None:
        self.count = count
        self._records, self._job = records, experiment_1(CUT_MM)
        self._floor: Floor = opened_floor(records, seed)
        self._due: list[tuple[float, Callable[[], None]]] = []
        self._floor.looks.append(self._look)
        self._files, self._threads = len(os.listdir("/proc/self/fd")), threading.active_count()
        self._texts: tuple[Catalogue, ...] = (load("en"), load("ko"))
        self._started = self._measured = 0

    @property
    def now_s(self) -> float:
        return self._floor.sim.now_s()

    def play(self, script: Script) -> None:
        """Let everything happen. Raises BrokenError."""
        for event in script:
            self.happen(event)

    def happen(self, event: Event) -> None:
        """Let one event happen, and hold the machine to its invariants after it."""
        name = f"{event.do} {event.name}".strip()
        self.count.tried[name] += 1
        self._do(event)
        self._step(LOOK_S)
        until_s = self.now_s + SETTLES_S
        while self._floor.state.activity not in IDLE and self.now_s < until_s:
            self._step(LOOK_S)
        self._check()
        self.count.survived[name] += 1

    def close(self) -> None:
        """End the shift: the console leaves, and what it has recorded is read."""
        self._floor.station.close("quit")
        self._check_record()

    def _do(self, event: Event) -> None:
        sim, stop = self._floor.sim, self._floor.stop
        match event.do:
            case "fault":
                self._due.append((sim.now_s() + event.after_s, lambda: self._inject(event)))
            case "mend":
                self._mend()
            case "restart":
                self._restart()
            case "wait":
                self._step(event.amount)
            case "stop":
                self._due.append((sim.now_s() + event.after_s, lambda: stop.stop("key.space")))
            case "set up":
                self._set_up()
            case "work":
                self._work()
            case "cut":
                self._cut()
            case _:
                self._order(self._command(event))

    def _command(self, event: Event) -> Command:
        match event.do:
            case "jog":
                return Jog(axis=AxisName(event.axis), distance=event.amount)
            case "home":
                return Home()
            case "enable":
                self._floor.lathe.confirm_nobody_inside()
                return EnableDrives()
            case "disable":
                return DisableDrives()
            case "retract":
                return Retract()
            case "reset":
                return Recover()
            case "forget":
                return Forget()
        return Acknowledge()

    def _work(self) -> None:
        """Do what a good operator does: put right what there is, set up if needed, cut, and measure."""
        if self._floor.state.activity is Activity.LOST:
            self._restart()
        self._take_control()
        if self._floor.state.stop is not None:
            self._order(Recover())
            self._order(Retract())
        self._order(Acknowledge())
        self._cut()
        if self._floor.state.armed is None and not self._floor.state.cut_done:
            self._set_up()
            self._cut()

    def _take_control(self) -> None:
        """A console that ended without its line has left its number: whoever comes next takes the machine over."""
        if any(alarm.problem.code == "owner.held" for alarm in self._floor.state.alarms):
            self._order(TakeControl())

    def _set_up(self) -> None:
        with suppress(AssertionError):  # refused half-way: whoever does it gives up there
            self._floor.set_up(self._job)

    def _cut(self) -> None:
        self._order(Arm(job=self._job, job_sha256="0" * 64, strategy=Strategy.PVT))
        if self._floor.state.armed is None:
            return
        if self._order(Start()):
            self.count.cuts += 1
            self._started += 1
            if self._floor.state.cut_done:
                self._measured += self._order(Measure()) and not self._floor.state.refusals

    def _order(self, command: Command) -> bool:
        taken = self._floor.station.post(command)
        self._floor.station.step()
        return taken

    def _inject(self, event: Event) -> None:
        given = {"motor": event.axis} if event.axis else {}
        lasting = {"for": event.for_s} if event.for_s and event.name != "watchdog" else {}
        self._floor.sim.faults.ask(event.name, {**given, **lasting})

    def _mend(self) -> None:
        self._due.clear()
        sim = self._floor.sim
        dead = sim.faults.shut_down_s is not None
        sim.faults.clear()
        if dead:
            sim.power_cycle()

    def _restart(self) -> None:
        """Somebody quits the console, waits for rest, and starts it anew; on a line that works."""
        self._floor.station.close("quit")
        self._mend()
        self._floor.sim.wait(RUN_OUT_S)
        self._floor = opened_floor(self._records, 0, self._floor.sim)
        self._floor.looks.append(self._look)

    def _look(self, _: Snapshot) -> None:
        for due in [each for each in self._due if each[0] <= self._floor.sim.now_s()]:
            self._due.remove(due)
            due[1]()

    def _step(self, seconds: float) -> None:
        while seconds > 0.0:
            self._floor.sim.wait(min(seconds, LOOK_S))
            self._floor.station.step()
            seconds -= LOOK_S

    def _check(self) -> None:
        state = self._floor.state
        if state.activity not in IDLE:
            raise BrokenError(f"it is still {state.activity} after {SETTLES_S:g} s")
        self._check_alarms()
        if state.activity is Activity.STOPPED and (state.stop is None or state.stop.rest_s is None):
            raise BrokenError(f"a stop whose rest is not proven: {state.stop}")
        if state.activity is not Activity.LOST:
            self._check_rest()
        files, threads = len(os.listdir("/proc/self/fd")), threading.active_count()
        if files > self._files + MOST_FILES or threads > self._threads + MOST_THREADS:
            raise BrokenError(f"{files} files, {threads} threads; {self._files} and {self._threads} at first")

    def _check_rest(self) -> None:
        """Nothing moves that nobody has asked to: what a controller is commanded to, and what turns."""
        motors = self._floor.sim.controller.motors
        self._floor.sim.wait(STILL_S)
        moving = [number for number, motor in motors.items() if motor.velocity != 0.0]
        if moving:
            raise BrokenError(f"motors {moving} are in motion in {self._floor.state.activity}")

    def _check_alarms(self) -> None:
        for alarm in self._floor.state.alarms:
            self.count.alarms[alarm.problem.code] += 1
            if alarm.problem.code == "session.fault":
                raise BrokenError(f"an exception of the console: {alarm.problem}")
            for text in self._texts:
                sentence = text.problem(alarm.problem)
                if alarm.problem.code in sentence or len(sentence) < 10:
                    raise BrokenError(f"{alarm.problem.code} has no sentence: {sentence}")

    def _check_record(self) -> None:
        """Every cut that was started is in the record, with every part that was measured, and can be read."""
        kept = runs(self._records, limit=MOST_RUNS)
        stories = [story(self._records, run.run_id) for run in kept]
        if damaged := [each.damaged for each in stories if each.damaged]:
            raise BrokenError(f"what cannot be read in the record: {damaged[0]}")
        measured = sum(len(each.parts) for each in stories)
        self.count.runs += len(kept)
        self.count.parts += self._measured
        if len(kept) < self._started or measured < self._measured:
            lost = f"{self._started} cuts and {self._measured} parts, recorded {len(kept)} and {measured}"
            raise BrokenError(lost)


# One shift by itself: what happened in it, and which invariant was broken.


@dataclass(frozen=True, slots=True, kw_only=True)
class Done:
    """A shift that is over: what happened, which invariant was broken ("" for none), and what was counted."""

    seed: int
    script: Script
    said: str
    passed_s: float
    count: Count
    grown_mb: float


def lone_shift(seed: int, *, seconds: float, until_s: float) -> Done | None:
    """Run a shift, unless it is too late to begin."""
    if time.monotonic() > until_s:
        return None
    count, before_mb = Count(), _memory_mb()
    script, said, passed_s = one_shift(seed, seconds, count)
    grown_mb = _memory_mb() - before_mb
    return Done(seed=seed, script=script, said=said, passed_s=passed_s, count=count, grown_mb=grown_mb)


def one_shift(seed: int, seconds: float, count: Count) -> tuple[Script, str, float]:
    """Run a shift; return what happened, which invariant was broken, and the simulated time, s."""
    random, happened = Random(seed), list[Event]()
    with TemporaryDirectory() as folder:
        shift = Shift(Path(folder), seed, count)
        try:
            while shift.now_s < seconds:
                happened.append(drawn(random))
                shift.happen(happened[-1])
            shift.close()
        except Exception as error:
            return tuple(happened), _sentence(error), shift.now_s
        return tuple(happened), "", shift.now_s


def broken_by(script: Script, seed: int) -> str:
    """Play a script; return which invariant it breaks, or nothing."""
    with TemporaryDirectory() as folder:
        shift = Shift(Path(folder), seed, Count())
        try:
            shift.play(script)
            shift.close()
        except Exception as error:
            return _sentence(error)
    return ""


def _sentence(error: Exception) -> str:
    """Return the invariant that is broken; any other error of a shift breaks one, too."""
    return str(error) if isinstance(error, BrokenError) else f"{type(error).__name__}: {error}"


def _memory_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


OPERATOR = ("set up", "home", "jog", "enable", "disable", "cut", "retract", "reset", "acknowledge", "stop")
"""What an operator does; each may come at a wrong moment, and is then refused."""

FAULTS = (
    "dropped-ack",
    "extra-line",
    "nul",
    "bare-bel",
    "late-reply",
    "split-segments",
    "hang",
    "cut-cable",
    "amplifier-fault",
    "encoder-loss",
    "index-lost",
    "limit",
    "following-error-trip",
    "spindle-ripple",
    "slow-background",
    "watchdog",
)
"""Of the catalogue of the simulator; none of them moves an axis by itself."""

OF_AXES = ("amplifier-fault", "encoder-loss", "index-lost", "limit", "following-error-trip")
AXES = ("tool", "spindle", "carriage")
LATEST_S, LONGEST_S = 12.0, 6.0


@dataclass(frozen=True, kw_only=True)
class Event:
    """`do` is an act of an operator, `fault`, `mend`, `restart` or `wait`.

    A fault `name` comes `after_s` from then on, in the middle of what is done next, and lasts `for_s` or until it
    is mended; `axis` and `amount` say of what and how much.
    """

    do: str
    name: str = ""
    axis: str = ""
    amount: float = 0.0
    after_s: float = 0.0
    for_s: float = 0.0


Script = tuple[Event, ...]


def drawn(random: Random) -> Event:
    """Draw what comes next."""
    kind = random.random()
    if kind < 0.30:
        name = random.choice(FAULTS)
        return Event(
            do="fault",
            name=name,
            axis=random.choice(AXES) if name in OF_AXES else "",
            after_s=round(random.uniform(0.0, LATEST_S), 3),
            for_s=round(random.choice((0.0, random.uniform(0.05, LONGEST_S))), 3),
        )
    if kind < 0.42:
        return Event(do="mend")
    if kind < 0.46:
        return Event(do="restart")
    if kind < 0.52:
        return Event(do="wait", amount=round(random.uniform(1.0, 120.0), 1))
    if kind < 0.80:
        return Event(do="work")
    do = random.choice(OPERATOR)
    after_s = round(random.uniform(0.0, LATEST_S), 3) if do == "stop" else 0.0
    axis = random.choice(AXES) if do == "jog" else ""
    return Event(do=do, axis=axis, amount=round(random.uniform(-2.0, 2.0), 3), after_s=after_s)


def as_text(script: Script) -> str:
    """Return a script, an event a line."""
    return "".join(f"{json.dumps({k: v for k, v in asdict(each).items() if v})}\n" for each in script)


def from_text(text: str) -> Script:
    """Return the script in a text."""
    return tuple(Event(**json.loads(line)) for line in text.splitlines() if line.strip())


# Shorten a script that fails to one of which no event can be left out (greedy delta debugging).


def shrunk(script: Script, fails: Callable[[Script], bool]) -> Script:
    """Return a part of the script, in its order, that still fails, and no longer does without any of its events.

    `fails` must hold for the script as it is. Whole pieces are left out first, then ever shorter ones.
    """
    size = max(1, len(script) // 2)
    while True:
        start, shorter = 0, False
        while start < len(script):
            part = script[:start] + script[start + size :]
            if part != script and fails(part):
                script, shorter = part, True
            else:
                start += size
        if size > 1:
            size //= 2
        elif not shorter:
            return script
