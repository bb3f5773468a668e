"""The whole dialogue of a job against a kept one: GOLDENS=write writes it anew (see `tests.golden_text`)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from hashlib import sha256
from itertools import groupby
from pathlib import Path
from random import Random

import pytest

from console.session.cut.engine import CutContext
from console.session.cut.run import CutOutcome, cut_part
from drivers.cutting.planning import Strategy, plan_cut
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.ownership import Ownership
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.link.tracing import TracedLink
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.true_parameters import as_simulated
from profiles.roundness import evaluate
from profiles.store import load_job
from tests.console.floor import known
from tests.golden_text import compare, writing
from tests.system.lathe_sites import compact

LOOK = re.compile(r"(?P<renewal>(?:M\d+|I\d+)=\d+ )?#\d+P F \? .*")
WATCHDOG = re.compile(r"(?:M\d+|I\d+)=\d+(?: P1002)?")
_ITEM = r"(?: [IP]\d+(?:\.\.\d+|,\d+,\d+)?| RH[XY]:\$[0-9A-F]+| (?:#\d+|M\d+)-> &1)"
BESIDE = re.compile(rf"(?:M\d+|I\d+)=\d+{_ITEM}+")
"""Some of what shapes the cut that runs, read between two looks."""
ENTRIES = re.compile(r"-?\d+(?: -?\d+){15}")
LONG_ANSWER = 4
UNFOLDED = 2
"""So many looks in a row stand there as they are."""


@dataclass(frozen=True, kw_only=True)
class Exchange:
    """A line to the controller with everything that was said until the next one."""

    lines: tuple[str, ...]

    @property
    def said(self) -> str:
        """What was sent, without its time."""
        _, mark, text = self.lines[0].split(" ", 2)
        return text if mark == ">" else ""

    @property
    def waits(self) -> bool:
        """Whether somebody only looks on, or renews the watchdog timer."""
        return any(each.fullmatch(self.said) is not None for each in (LOOK, WATCHDOG, BESIDE))


def exchanges(lines: Sequence[str]) -> list[Exchange]:
    """Return the lines in groups that begin with one to the controller."""
    groups: list[list[str]] = []
    for line in lines:
        if not groups or " > " in line or " ! " in line:
            groups.append([])
        groups[-1].append(line)
    return [Exchange(lines=tuple(group)) for group in groups]


def folded(lines: Sequence[str]) -> list[str]:
    """Return the lines, of each wait the first and the last look, and at the end what identifies every byte.

    A long answer that was given before is not repeated, nor are the entries of a table: it is read back.
    """
    shown: list[str] = []
    given: set[tuple[str, ...]] = set()
    entries = 0
    for waits, group in groupby(exchanges(lines), key=lambda each: each.waits):
        if waits:
            shown += _folded(tuple(group))
            continue
        for each in group:
            entries = entries + 1 if ENTRIES.fullmatch(each.said) else 0
            shown += _once(each, given) if entries <= UNFOLDED else ()
    text = "".join(f"{line}\n" for line in lines)
    return [*shown, f"# {len(lines)} lines, sha256 {sha256(text.encode('utf-8')).hexdigest()}"]


def _once(exchange: Exchange, given: set[tuple[str, ...]]) -> Iterator[str]:
    """Give the lines of an exchange, without a long answer that was given before."""
    words = tuple(line.partition(" ")[2] for line in exchange.lines)
    if len(words) <= LONG_ANSWER or words not in given:
        given.add(words)
        yield from exchange.lines
        return
    yield exchange.lines[0]
    yield f"# {len(words) - 2} more lines, as they were answered before"
    yield exchange.lines[-1]


def _folded(group: Sequence[Exchange]) -> Iterator[str]:
    """Give the lines of exchanges that all wait, or of which none does."""
    looks = [place for place, each in enumerate(group) if LOOK.fullmatch(each.said)]
    if len(looks) <= UNFOLDED:
        yield from (line for each in group for line in each.lines)
        return
    first, last = looks[0], looks[-1]
    for each in group[: first + 1]:
        yield from each.lines
    between = group[first + 1 : last]
    renewals = sum(WATCHDOG.match(each.said) is not None for each in between)
    yield f"# {len(looks) - 2} more polls like this, the watchdog timer renewed {renewals} times"
    for each in group[last:]:
        yield from each.lines


FOLDER = Path(__file__).with_name("transcripts")
JOBS = (("pmac", Strategy.PVT), ("turbo", Strategy.CAM))
CUT_MM = 0.3
TRACE_LINE = re.compile(r"\d+\.\d{3} [><!*] \S.*")

every_job = pytest.mark.parametrize(("family", "strategy"), JOBS, ids=[f"{f}-{s}" for f, s in JOBS])


@dataclass(kw_only=True)
class Lines:
    """What a trace file is given."""

    text: list[str] = field(default_factory=list)

    def write(self, text: str, /) -> None:
        self.text += text.splitlines()


@cache
def transcript(family: str, strategy: Strategy) -> tuple[tuple[str, ...], CutOutcome]:
    """One part of a very short job, from the first byte to the last, and what became of it."""
    machine, lines = as_simulated(compact(family), None), Lines()
    job = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=CUT_MM)
    sim = SimulatedLathe(machine)
    link = TracedLink(MemoryLink(sim.connect(), sim), lines, sim.now_s)
    client, stop = PmacClient(link, sim), StopPath(link)
    ownership = Ownership(client, Random(2001))
    lathe = Lathe(client, machine, sim, stop, heartbeat=Heartbeat(client, sim, machine), ownership=ownership)
    plan = plan_cut(job, machine, strategy, watchdog=lathe.program.watchdog)
    lathe.connect()
    lathe.claim()
    shop = CutContext(lathe=lathe, workshop=sim)
    outcome = cut_part(shop, job, plan, lambda step, detail: None)
    lathe.release()
    link.close()
    return tuple(lines.text), outcome


def shown(family: str, strategy: Strategy) -> list[str]:
    lines, _ = transcript(family, strategy)
    return [f"# one part of lee-2001-experiment-1, {CUT_MM:g} mm long: {strategy}, {family}", *folded(lines)]


def golden_of(family: str, strategy: Strategy) -> Path:
    return FOLDER / f"{family}-{strategy}.txt"


@every_job
@pytest.mark.first(2)
def test_a_job_says_what_it_said_to_the_byte(family: str, strategy: Strategy, tmp_path: Path) -> None:
    whole = tmp_path / "whole.txt"
    whole.write_text("\n".join(transcript(family, strategy)[0]), encoding="utf-8")
    print(f"what is folded stands in {whole}")
    compare(shown(family, strategy), golden_of(family, strategy), write=writing())


@every_job
def test_a_transcript_can_be_read_by_a_person(family: str, strategy: Strategy) -> None:
    """Not too long, in lines of the trace format, and what a job needs stands in its order."""
    rows = golden_of(family, strategy).read_text(encoding="utf-8").splitlines()
    assert len(rows) < 3000
    assert [row for row in rows if not TRACE_LINE.fullmatch(row) and not row.startswith("# ")] == []
    steps = [
        r"\[\^X\]",
        "VERSION TYPE",
        "OPEN PROG",
        "LIST PROG",
        "OPEN PLC",
        "#1J/",
        ".*#1HM",
        r".*#1J=\d",
        r".*P1005=\d.*R",
    ]
    asked = [row.split(" > ", 1)[1] for row in rows if " > " in row]
    places = [next(n for n, line in enumerate(asked) if re.match(step, line)) for step in steps]
    assert places == sorted(places)


@every_job
def test_the_part_of_a_transcript_is_round(family: str, strategy: Strategy) -> None:
    trace = known(transcript(family, strategy)[1].trace)
    assert evaluate(trace.angle_deg, trace.deviation_um, 50.0).ront_um < 1.0


@every_job
@pytest.mark.first(1)
def test_only_waiting_is_folded_and_no_byte_is_lost_on_the_way(family: str, strategy: Strategy) -> None:
    lines = list(transcript(family, strategy)[0])
    kept = [line for line in folded(lines) if not line.startswith("# ")]
    waits = {line for each in exchanges(lines) if each.waits for line in each.lines}
    shown = {line.partition(" ")[2] for line in kept}
    assert kept == [line for line in lines if line in set(kept)]
    lines_read_back = {line.partition(" ")[2].removeprefix("< ") for line in kept}
    hidden_words = {line.partition(" ")[2] for line in lines if line not in waits} - shown
    assert {words.removeprefix("> ") for words in hidden_words} <= lines_read_back
    looks = [n for n, line in enumerate(lines) if " > " in line and "#1P F ?" in line]
    hidden = looks[len(looks) // 2] + 1
    assert folded([*lines[:hidden], lines[hidden] + "0", *lines[hidden + 1 :]])[-1] != folded(lines)[-1]


def test_there_is_no_transcript_without_its_job() -> None:
    assert {path.name for path in FOLDER.iterdir()} == {golden_of(*each).name for each in JOBS}
