"""Cuts on a simulated lathe that another host disturbs: is any part called good that is not what was planned?

One console side makes part after part, headless, with its lease and as the owner, in simulated time. Another host
with a connection of its own sends what is in `hostile_lines` and leaves it so, or changes for a while a value of
`held_deeds`: for a moment, a part of the feed, the whole of it until shortly before its end, by a slow drift, or
two that compensate each other, from any step on. Strategies, families and lengths take turns. Good is what
`cut_part` returns with the verdict as planned. It is judged by the part itself, against the part of the same lathe
that nobody disturbs, at three sections, by depth all along, by its length, and by what the tool has run into. The
last line says how many parts were called good that are not, and which deed it was; the exit code is 1 if there is
any.

    python -m benchmarks.hostile_host [--cuts N | --hours H] [--seed S] [--plant NAME] [--undisturbed N]
                                      [--workers N] [--list FILE]

Hours are of simulated cutting. With the same seed the same is done. `--undisturbed` makes cuts beside them while
another host only looks: none may be called disturbed.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache, lru_cache
from itertools import count, islice
from multiprocessing import get_context
from pathlib import Path
from random import Random

import numpy as np
from numpy.typing import NDArray

from benchmarks.held_deeds import DRIFT_STEPS, Change, Changes, Length, changes_of
from benchmarks.hostile_lines import DEEDS
from benchmarks.measure import extent, print_table
from console.session.cut.cut_verdict import CutJudgement
from console.session.cut.engine import CutContext, PartStep
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
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.true_parameters import ideal
from drivers.simulator.plant.workshop import SECTIONS, SimulatedWorkshop
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import ProblemError
from profiles.store import load_job
from tests.system.lathe_sites import compact

CUT_MM = 1.5
JOB = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=CUT_MM)
KINDS = tuple((family, strategy) for strategy in Strategy for family in DIALECTS)

TOLERANCE_UM = 1.0
"""What a part may be off from the undisturbed one: all round its sections, and in depth all along."""

LENGTH_MM = 0.02
"""What its length may be off."""

PLACE_MM = 0.05
"""Length of a place in which the depth is compared: a turn."""

MOMENT_S = (0.1, 0.4)
PUT_BACK_S = (0.0, 0.15)  # before the end of the feed
EARLY = (PartStep.LOAD, PartStep.CHECK, PartStep.ALIGN, PartStep.ARM)
EARLY_S = 0.3
BESIDE = 0.15  # share of the changes that are made at another step than the cut

GOOD = "called good"
LASTING = "left so"
TURNS = (*Length, LASTING)
FULL_CUTS, SHORT_CUTS = 600, 200


class Witness(SimulatedWorkshop):
    """What the tool really did to the part: how deep, place by place along it, how far, and when."""

    deepest_mm: dict[int, float]
    job: Job | None = None
    in_part_s: tuple[float, float] = (0.0, 0.0)

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
            self.in_part_s = self.in_part_s[0] if self.deepest_mm else end_ms / 1000.0, end_ms / 1000.0
            self.deepest_mm[place] = min(radius_mm, self.deepest_mm.get(place, radius_mm))

    def surfaces_um(self) -> NDArray[np.float64]:
        """Return the released part at its sections, as it is and not as a gauge shows it."""
        part = self._part or self._released
        assert part is not None
        self._settle()
        return np.array([part.released_um(n, self._nominal_radius_mm)[1] for n in range(len(SECTIONS))])


class WitnessedLathe(SimulatedLathe):
    """A simulated lathe with somebody who sees what is cut, and another host on a connection of its own."""

    def __init__(self, machine: MachineProfile, plant: str = "ideal", seed: int = 0) -> None:
        true = ideal(machine) if plant == "ideal" else plant_named(plant, machine, seed)
        super().__init__(machine, true)
        self._floor = self.witness = Witness(machine, true, self._drives)
        self.enemy: Port = self.connect()
        self.due: list[tuple[float, bytes]] = []
        self.done, self.begun_s = 0, 0.0

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Sent:
    """A line that is sent so many seconds behind the beginning of a step."""

    step: PartStep
    after_s: float
    line: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Attack:
    """What another host sends in one cut; `name` and `length` are those of the table."""

    name: str
    length: str
    sent: tuple[Sent, ...]


@dataclass(frozen=True, kw_only=True)
class Truth:
    """The part as it is, and when it was made, s behind the beginning of `PartStep.CUT`."""

    sections_um: NDArray[np.float64]
    deepest_mm: dict[int, float]
    collisions: tuple[str, ...]
    in_part_s: tuple[float, float]

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Made:
    """What became of one cut: `GOOD`, another verdict, or the code of what ended it; and the cutting time.

    `differs` is by what a part is not the planned one where the cut ended with a verdict.
    """

    outcome: str
    cutting_s: float
    disturbed: bool
    differs: str = ""
    number: int = 0
    who: str = ""
    name: str = ""
    length: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """Cuts that are made: on which plant, from which seed."""

    seed: int
    plant: str = "ideal"

    def attack(self, number: int) -> Attack:
        """Draw what is done in the cut of a number: kinds, lengths and changes take turns."""
        kind, turn = number % len(KINDS), number // len(KINDS)
        length, drawn = TURNS[turn % len(TURNS)], turn // len(TURNS)
        chance = Random(f"{self.seed}/{number}")
        planned = undisturbed(*KINDS[kind])
        if length == LASTING:
            return lasting(chance, planned)
        cards = deck(*KINDS[kind], Length(length), self.seed)
        return held(cards[drawn % len(cards)], Length(length), chance, planned)

    def cut(self, number: int) -> Made:
        """Make the part of a number, disturbed as the seed says."""
        attack, kind = self.attack(number), KINDS[number % len(KINDS)]
        made, sim = make(*kind, attack, number, self.plant)
        if made.outcome == GOOD or made.outcome in tuple(CutJudgement):
            planned = undisturbed(*kind, self.plant, 0 if self.plant == "ideal" else number)
            made = replace(made, differs=truth_of(sim).differs(planned))
        when = ", ".join(f"{each.step} + {each.after_s:.2f} s" for each in (attack.sent[0], attack.sent[-1]))
        who = f"cut {number}, {kind[0]} {kind[1]}: {attack.name}; {attack.length}; {when}"
        return replace(made, number=number, who=who, name=attack.name, length=attack.length)

    def look_on(self, number: int) -> Made:
        """Make the part of a number while another host only looks, at random moments."""
        kind, chance = KINDS[number % len(KINDS)], Random(f"{self.seed}/{number}")
        end_s = plan_of(*kind).duration_s
        at_s = sorted(chance.uniform(0.0, end_s) for _ in range(LOOKS))
        sent = tuple(Sent(step=PartStep.CUT, after_s=each, line=chance.choice(LOOKING)) for each in at_s)
        made, _ = make(*kind, Attack(name="", length="", sent=sent), number, self.plant)
        return replace(made, number=number, who=f"undisturbed cut {number}, {kind[0]} {kind[1]}")


LOOKS = 12
LOOKING = ("#1P", "#2P", "#3V", "I130", "P11", "M169", "&1?", "#1?", "???", "LIST PROG1", "P11..20", "#1->")


def lathe_at(sim: SimulatedLathe, machine: MachineProfile, seed: int | None = None) -> Lathe:
    """Return the side of the console, with its heartbeat; with a `seed` it can claim the machine."""
    link = MemoryLink(sim.connect(), sim)
    client = PmacClient(link, sim)
    heartbeat = Heartbeat(client, sim, machine)
    ownership = None if seed is None else Ownership(client, Random(seed))
    return Lathe(client, machine, sim, StopPath(link), heartbeat=heartbeat, ownership=ownership)


@cache
def plan_of(family: str, strategy: Strategy) -> CutPlan:
    machine = compact(family)
    sim = SimulatedLathe(machine)
    client = PmacClient(MemoryLink(sim.connect(), sim), sim)
    return plan_cut(JOB, machine, strategy, watchdog=Heartbeat(client, sim, machine).condition)


@cache
def changes(family: str, strategy: Strategy) -> Changes:
    """Return what can be changed in a cut."""
    return changes_of(compact(family), plan_of(family, strategy))


@cache
def deck(family: str, strategy: Strategy, length: Length, seed: int) -> list[tuple[Change, ...]]:
    """Return the changes of one length in the order of a seed."""
    return changes(family, strategy).deck(length, Random(f"{seed}/{family}/{strategy}/{length}"))


def make(
    family: str, strategy: Strategy, attack: Attack | None, seed: int, plant: str = "ideal"
) -> tuple[Made, WitnessedLathe]:
    """Make one part on a lathe of its own."""
    machine, plan = compact(family), plan_of(family, strategy)
    sim = WitnessedLathe(machine, plant, seed)
    lathe = lathe_at(sim, machine, seed)
    begun_s = [0.0]

    def tell(step: PartStep, _: str) -> None:
        if step is PartStep.CUT:
            begun_s[0] = sim.now_s()
        sent = [] if attack is None else [each for each in attack.sent if each.step is step]
        sim.due += [(sim.now_s() + each.after_s, said(each.line, machine, plan)) for each in sent]
        sim.due.sort(key=lambda one: one[0])

    lathe.connect()
    lathe.claim()
    try:
        done = cut_part(CutContext(lathe=lathe, workshop=sim), JOB, plan, tell)
        judgement = done.figures.verdict.judgement
        outcome = GOOD if judgement is CutJudgement.AS_PLANNED else judgement.value
    except ProblemError as error:
        outcome = error.problems[0].code
    sim.begun_s = begun_s[0]
    cutting_s = sim.now_s() - begun_s[0] if begun_s[0] else 0.0
    return Made(outcome=outcome, cutting_s=cutting_s, disturbed=sim.done > 0), sim


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
    begin_s, end_s = (each - sim.begun_s for each in sim.witness.in_part_s)
    return Truth(
        sections_um=sim.witness.surfaces_um(),
        deepest_mm=dict(sim.witness.deepest_mm),
        collisions=tuple(each.kind.value for each in sim.collisions),
        in_part_s=(begin_s, end_s),
    )


@lru_cache(2 * len(KINDS))
def undisturbed(family: str, strategy: Strategy, plant: str = "ideal", seed: int = 0) -> Truth:
    """Return the part that is made when nobody disturbs.

    Raises:
        RuntimeError: that is not called good, or at worst the tool's own error.
    """
    made, sim = make(family, strategy, None, seed, plant)
    if made.outcome != GOOD and (plant == "ideal" or made.outcome not in tuple(CutJudgement)):
        raise RuntimeError(f"{family} {strategy} {plant} {seed} undisturbed: {made.outcome}")
    return truth_of(sim)


def held(change: tuple[Change, ...], length: Length, chance: Random, planned: Truth) -> Attack:
    """Draw when a change is made and put back: most behind the check before the start, some at any step."""
    begin_s, end_s = planned.in_part_s
    last_s = end_s - chance.uniform(*PUT_BACK_S)
    first_s, step, back = chance.uniform(0.0, begin_s), PartStep.CUT, PartStep.CUT
    if length is Length.MOMENT:
        first_s = chance.uniform(0.0, end_s + 2.0 * MOMENT_S[1])
        last_s = first_s + chance.uniform(*MOMENT_S)
        back = step = chance.choice((*EARLY, PartStep.RETRACT)) if chance.random() < BESIDE else PartStep.CUT
    elif length is Length.PART:
        first_s = chance.uniform(begin_s, begin_s + 0.7 * (end_s - begin_s))
        last_s = first_s + chance.uniform(0.2, 0.6) * (end_s - begin_s)
    elif chance.random() < BESIDE:
        step, first_s = chance.choice(EARLY), chance.uniform(0.0, EARLY_S)
    shares = [each / DRIFT_STEPS for each in range(DRIFT_STEPS + 1)] if length is Length.DRIFT else [0.0, 1.0]
    at_s = np.linspace(first_s, last_s, len(shares))[: len(shares) - 1]
    sent = [
        Sent(step=step, after_s=float(when), line=each.line(before, share))
        for when, before, share in zip(at_s, shares, shares[1:], strict=False)
        for each in change
    ]
    sent += [Sent(step=back, after_s=last_s, line=each.line(1.0, 0.0)) for each in change]
    return Attack(name=" & ".join(each.told for each in change), length=length, sent=tuple(sent))


def lasting(chance: Random, planned: Truth) -> Attack:
    """Draw one of the lines of `hostile_lines` and its moment, most in the cut."""
    deed = chance.choice(DEEDS)
    step, after_s = PartStep.CUT, chance.uniform(0.0, planned.in_part_s[1] + 1.0)
    if chance.random() < BESIDE:
        step, after_s = chance.choice(EARLY), chance.uniform(0.0, EARLY_S)
    sent = [Sent(step=step, after_s=after_s, line=deed.first)]
    if deed.later:
        sent.append(Sent(step=step, after_s=after_s + chance.uniform(*MOMENT_S), line=deed.later))
    return Attack(name=deed.name, length=LASTING, sent=tuple(sent))


@dataclass
class Tally:
    """All cuts so far, by the length of what was changed."""

    outcomes: dict[str, Counter[str]] = field(default_factory=dict)
    wrong: list[Made] = field(default_factory=list)
    told: int = 0
    cutting_s: float = 0.0

    def take(self, made: Made) -> None:
        """Add a cut; say at once of one that is called good and is not as planned."""
        said = self.outcomes.setdefault(made.length, Counter())
        late = "" if made.disturbed else "came too late"
        known = made.outcome if made.outcome in (GOOD, *CutJudgement) else "stopped or refused"
        said[late or (f"{known}, WRONG" if made.differs else known)] += 1
        self.cutting_s += made.cutting_s
        self.told += made.outcome == CutJudgement.TOOL_ERROR and bool(made.differs)
        if made.outcome == GOOD and made.differs:
            self.wrong.append(made)
            print(f"NOT AS PLANNED: {made.who}: {made.differs}", flush=True)

    @property
    def cuts(self) -> int:
        """How many there were."""
        return sum(sum(each.values()) for each in self.outcomes.values())

    def rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows: what became of the cuts of each length."""
        columns = sorted({each for said in self.outcomes.values() for each in said})
        rows = [[length, *(str(said[each]) for each in columns)] for length, said in self.outcomes.items()]
        return ["changed for", *columns], rows


def made_in_turn(work: Callable[[int], Made], workers: int) -> Iterator[Made]:
    """Yield what becomes of the cuts 0, 1, 2 ..., made by so many processes."""
    if workers == 1:
        yield from map(work, count())
    with get_context("fork").Pool(workers) as pool:
        for first in count(0, len(KINDS) * workers):
            yield from pool.imap(work, range(first, first + len(KINDS) * workers))


def disturbed_ones(cuts: Iterable[Made]) -> int:
    """Count what was undisturbed and called otherwise; say what it was."""
    accused = 0
    for made in cuts:
        if made.outcome not in (GOOD, CutJudgement.TOOL_ERROR, CutJudgement.NOT_PROVEN):
            accused += 1
            print(f"CALLED DISTURBED: {made.who}: {made.outcome}", flush=True)
    return accused


def upper_percent(found: int, of: int) -> float:
    """Return the upper bound of a share, 95 %, by Clopper and Pearson."""
    from scipy.stats import beta

    return 100.0 if found == of else 100.0 * float(beta.ppf(0.95, found + 1, of - found))


def main() -> int:
    """Cut, print the tables, and return 1 where a part was called good that is not what was planned."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--cuts", type=int, default=extent(FULL_CUTS, SHORT_CUTS))
    options.add_argument("--hours", type=float, help="of simulated cutting, instead of a number of cuts")
    options.add_argument("--seed", type=int, default=2001)
    options.add_argument("--plant", default="ideal", help="of the simulated lathe; the seed of each is its cut")
    options.add_argument("--undisturbed", type=int, default=0, help="cuts beside them that nobody disturbs")
    options.add_argument("--workers", type=int, default=1, help="processes")
    options.add_argument("--list", type=Path, help="a file that gets each cut as a line of JSON")
    asked = options.parse_args()
    print(f"seed {asked.seed}, {asked.plant}", flush=True)
    series, tally, began_s = Series(seed=asked.seed, plant=asked.plant), Tally(), time.monotonic()
    for made in islice(made_in_turn(series.cut, asked.workers), None if asked.hours else asked.cuts):
        tally.take(made)
        if asked.list is not None:
            with asked.list.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"seed": asked.seed, "plant": asked.plant, **asdict(made)}) + "\n")
        if asked.hours and tally.cutting_s >= 3600.0 * asked.hours:
            break
    title = f"{tally.cuts} cuts, {tally.cutting_s / 60.0:.1f} min of cutting in {time.monotonic() - began_s:.0f} s"
    print_table(title, *tally.rows())
    accused = disturbed_ones(islice(made_in_turn(series.look_on, asked.workers), asked.undisturbed))
    if asked.undisturbed:
        print(f"undisturbed and called disturbed: {accused} of {asked.undisturbed}")
    print(f"not as planned, and told as an error of the tool: {tally.told} of {tally.cuts}")
    wrong = len(tally.wrong)
    bound = f"{upper_percent(wrong, tally.cuts):.2g} % at 95 %"
    print(f"called good and not as planned: {wrong} of {tally.cuts} (at most {bound})")
    return 1 if wrong or accused else 0


if __name__ == "__main__":
    sys.exit(main())
