"""Cuts on a simulated lathe that another host disturbs: is any part called good that is not what was planned?

One console side makes part after part, headless, with its lease and as the owner, in simulated time. Another host
with a connection of its own sends at a random moment, from the loading to the end of the cut, one of the lines of
`hostile_lines`. Strategies and families take turns. What the console calls good is judged by the part itself,
against the part of the same cut that nobody disturbs, at three sections, by depth all along, by its length, and
by what the tool has run into. The last line says how many parts were called good that are not, and which deed
it was; the exit code is 1 if there is any.

    python -m benchmarks.hostile_host [--cuts N | --hours H] [--seed S]

Hours are of simulated cutting. With the same seed the same is done.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from random import Random

import numpy as np
from numpy.typing import NDArray

from benchmarks.hostile_lines import DEEDS, Deed
from benchmarks.measure import extent, print_table
from console.session.cut.engine import CutContext, Step
from console.session.cut.run import cut_part
from drivers.cutting.planning import CutPlan, plan_cut
from drivers.cutting.strategy import Strategy
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.ownership import Ownership
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.settings import settings_with
from drivers.simulator.hosts.port import Port
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.true_parameters import ideal
from drivers.simulator.plant.workshop import SECTIONS, SimulatedWorkshop
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import ProblemError
from profiles.store import load_job
from tests.system.lathe_sites import compact

CUT_MM = 1.5
JOB = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=CUT_MM)
KINDS = (
    ("pmac", Strategy.PVT),
    ("pmac", Strategy.CAM),
    ("pmac", Strategy.TIMEBASE),
    ("turbo", Strategy.PVT),
    ("turbo", Strategy.CAM),
    ("turbo", Strategy.TIMEBASE),
)

TOLERANCE_UM = 1.0
"""What a part may be off from the undisturbed one: all round its sections, and in depth all along."""

LENGTH_MM = 0.02
"""What its length may be off."""

PLACE_MM = 0.05
"""Length of a place in which the depth is compared: a turn."""

UNDONE_WITHIN_S = (0.1, 0.4)
"""When a deed is undone that is: what is over between two polls nobody knows, see `drivers.cutting.path_seen`."""

UNDONE_UNTIL = 0.55
"""Share of the program until which such a deed is begun, so that it is over before the tool goes out."""

GOOD = "called good"


class Witness(SimulatedWorkshop):
    """What the tool really did to the part: how deep, place by place along it, and how far."""

    deepest_mm: dict[int, float]
    job: Job | None = None

    def mount(self, job: Job) -> None:
        """Clamp a new blank."""
        super().mount(job)
        self.job, self.deepest_mm = job, {}

    def pass_along(self, tracks: Mapping[int, Sequence[float]], end_ms: float) -> None:
        """Let the tool go along, and note where it was in the part."""
        super().pass_along(tracks, end_ms)
        machine, job = self._machine, self.job
        if job is None:
            return
        radius_mm = self._true.home_radius_mm - max(tracks[machine.tool.motor]) / machine.tool.counts_per_mm
        z_mm = tracks[machine.carriage.motor][-1] / machine.carriage.counts_per_mm
        if radius_mm < job.radius_mm and z_mm > self._free_end_mm:
            place = int(z_mm / PLACE_MM)
            self.deepest_mm[place] = min(radius_mm, self.deepest_mm.get(place, radius_mm))


class WitnessedLathe(SimulatedLathe):
    """A simulated lathe with somebody who sees what is cut, and another host on a connection of its own."""

    def __init__(self, machine: MachineProfile) -> None:
        super().__init__(machine)
        self._floor = self.witness = Witness(machine, ideal(machine), self._drives)
        self.enemy: Port = self.connect()
        self.due: list[tuple[float, bytes]] = []
        self.done = 0

    def wait(self, seconds: float) -> None:
        """Let time pass; what is due on the way is sent."""
        end_s = self.now_s() + seconds
        while self.due and self.due[0][0] <= end_s:
            at_s, said = self.due.pop(0)
            super().wait(max(at_s - self.now_s(), 0.0))
            self.enemy.receive(said)
            self.enemy.take_output()
            self.done += 1
        super().wait(max(end_s - self.now_s(), 0.0))


@dataclass(frozen=True, kw_only=True)
class Attack:
    """A deed, and its moment: so many seconds behind the beginning of a step."""

    deed: Deed
    step: Step
    after_s: float
    undone_after_s: float


@dataclass(frozen=True, kw_only=True)
class Truth:
    """The part, as it is when it is measured."""

    sections_um: NDArray[np.float64]
    deepest_mm: dict[int, float]
    collisions: tuple[str, ...]

    def differs(self, planned: Truth) -> str:
        """Say by what this is not the planned part, "" where it is."""
        off_um = float(np.abs(self.sections_um - planned.sections_um).max())
        both = self.deepest_mm.keys() & planned.deepest_mm.keys()
        deep_um = max(
            (1000.0 * abs(self.deepest_mm[at] - planned.deepest_mm[at]) for at in both), default=float("inf")
        )
        short_mm = PLACE_MM * len(self.deepest_mm.keys() ^ planned.deepest_mm.keys())
        told = (
            f"{off_um:.2f} um off at a section" if off_um > TOLERANCE_UM else "",
            f"{deep_um:.2f} um off in depth" if deep_um > TOLERANCE_UM else "",
            f"{short_mm:.2f} mm off in length" if short_mm > PLACE_MM + LENGTH_MM else "",
            *(each for each in self.collisions if each not in planned.collisions),
        )
        return ", ".join(each for each in told if each)


@dataclass(frozen=True, kw_only=True)
class Made:
    """What became of one cut: `GOOD` or the code of what ended it, by what it differs, and the cutting time."""

    outcome: str
    differs: str
    cutting_s: float
    disturbed: bool


@dataclass
class Tally:
    """All cuts so far."""

    outcomes: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)
    cutting_s: float = 0.0
    undisturbed: int = 0

    @property
    def cuts(self) -> int:
        """How many there were."""
        return sum(self.outcomes.values())


@cache
def plan_of(family: str, strategy: Strategy) -> CutPlan:
    machine = compact(family)
    sim = SimulatedLathe(machine)
    client = PmacClient(MemoryLink(sim.connect(), sim), sim)
    return plan_cut(JOB, machine, strategy, watchdog=Heartbeat(client, sim, machine).condition)


def make(family: str, strategy: Strategy, attack: Attack | None, seed: int) -> tuple[Made, WitnessedLathe]:
    """Make one part on a lathe of its own."""
    machine, plan = compact(family), plan_of(family, strategy)
    sim = WitnessedLathe(machine)
    link = MemoryLink(sim.connect(), sim)
    client, stop = PmacClient(link, sim), StopPath(link)
    heartbeat, ownership = Heartbeat(client, sim, machine), Ownership(client, Random(seed))
    lathe = Lathe(client, machine, sim, stop, heartbeat=heartbeat, ownership=ownership)
    begun_s = [0.0]

    def tell(step: Step, _: str) -> None:
        if step is Step.CUT:
            begun_s[0] = sim.now_s()
        if attack is not None and step is attack.step:
            first, later = (said(each, machine, plan) for each in (attack.deed.first, attack.deed.later))
            at_s = sim.now_s() + attack.after_s
            sim.due = [(at_s, first), *([(at_s + attack.undone_after_s, later)] if later else [])]

    lathe.connect()
    lathe.claim()
    shop = CutContext(lathe=lathe, workshop=sim)
    try:
        cut_part(shop, JOB, plan, tell)
        outcome = GOOD
    except ProblemError as error:
        outcome = error.problems[0].code
    cutting_s = sim.now_s() - begun_s[0] if begun_s[0] else 0.0
    return Made(outcome=outcome, differs="", cutting_s=cutting_s, disturbed=sim.done > 0), sim


def said(line: str, machine: MachineProfile, plan: CutPlan) -> bytes:
    """Return the bytes of a line of a deed."""
    if len(line) == 1 and line < " ":
        return line.encode()
    dialect, tool = DIALECTS[machine.controller.family], machine.tool.motor
    values = {
        "program": plan.program.number,
        "tool": tool,
        "gain": settings_with(machine.controller.variables, dialect)[dialect.motor_index(tool, 30)],
        "source": dialect.system_index(1, 93),
        "slew": dialect.system_index(1, 94),
    }
    return f"{line.format(**values)}\r".encode() if line else b""


def truth_of(sim: WitnessedLathe) -> Truth:
    """Take the part as it is."""
    sections = [sim.measure(share * CUT_MM).deviation_um for share in SECTIONS]
    return Truth(
        sections_um=np.array(sections),
        deepest_mm=dict(sim.witness.deepest_mm),
        collisions=tuple(each.kind.value for each in sim.collisions),
    )


@cache
def undisturbed(family: str, strategy: Strategy) -> Truth:
    """Return the part that is made when nobody disturbs.

    Raises:
        RuntimeError: that is not called good.
    """
    made, sim = make(family, strategy, None, 0)
    if made.outcome != GOOD:
        raise RuntimeError(f"{family} {strategy} undisturbed: {made.outcome}")
    return truth_of(sim)


def attack_of(chance: Random, plan: CutPlan) -> Attack:
    """Draw a deed and its moment: most in the cut, some before it, some at its end."""
    where = chance.random()
    if where < 0.12:
        step, after_s = chance.choice((Step.LOAD, Step.CHECK)), chance.uniform(0.0, 0.5)
    elif where < 0.25:
        step, after_s = Step.ALIGN, chance.uniform(0.0, 12.0)
    elif where < 0.35:
        step, after_s = Step.ARM, chance.uniform(0.0, 0.3)
    elif where < 0.85:
        step, after_s = Step.CUT, chance.uniform(0.0, plan.duration_s)
    else:
        step, after_s = Step.CUT, plan.duration_s + chance.uniform(-1.0, 0.3)
    deed = chance.choice(DEEDS)
    if deed.later and step is Step.CUT:
        after_s = chance.uniform(0.0, UNDONE_UNTIL * plan.duration_s)
    return Attack(deed=deed, step=step, after_s=after_s, undone_after_s=chance.uniform(*UNDONE_WITHIN_S))


def disturbed_cut(number: int, seed: int) -> tuple[Made, str]:
    """Make the part of a number, disturbed as the seed says; return it, and by whom."""
    family, strategy = KINDS[number % len(KINDS)]
    chance = Random(f"{seed}/{number}")
    attack = attack_of(chance, plan_of(family, strategy))
    made, sim = make(family, strategy, attack, number)
    if made.outcome == GOOD:
        made = replace(made, differs=truth_of(sim).differs(undisturbed(family, strategy)))
    who = f"{family} {strategy}: {attack.deed.name!r}, {attack.after_s:.2f} s behind {attack.step}"
    return made, who


def count(tally: Tally, number: int, seed: int) -> None:
    """Make one more part, and add it."""
    made, who = disturbed_cut(number, seed)
    tally.outcomes[made.outcome] += 1
    tally.cutting_s += made.cutting_s
    tally.undisturbed += not made.disturbed
    if made.differs:
        tally.wrong.append(f"cut {number}, {who}: {made.differs}")
        print(f"NOT AS PLANNED: {tally.wrong[-1]}", flush=True)


def main() -> int:
    """Cut, print the table, and return 1 where a part was called good that is not what was planned."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    length = options.add_mutually_exclusive_group()
    length.add_argument("--cuts", type=int, default=extent(60, 3))
    length.add_argument("--hours", type=float, help="of simulated cutting")
    options.add_argument("--seed", type=int, default=2001)
    asked = options.parse_args()
    print(f"seed {asked.seed}", flush=True)
    tally, began_s = Tally(), time.monotonic()
    while (tally.cutting_s < 3600.0 * asked.hours) if asked.hours else (tally.cuts < asked.cuts):
        count(tally, tally.cuts, asked.seed)
    rows = [(outcome, str(cuts)) for outcome, cuts in tally.outcomes.most_common()]
    title = f"{tally.cuts} cuts, {tally.cutting_s / 60.0:.1f} min of cutting in {time.monotonic() - began_s:.0f} s"
    print_table(title, ("became of them", "cuts"), rows)
    print(f"the deed came too late: {tally.undisturbed}")
    print(f"called good and not as planned: {len(tally.wrong)}")
    return 1 if tally.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
