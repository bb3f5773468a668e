"""The whole dialogue of a job, as `console run --trace` writes it, against a kept one that a person can read.

GOLDENS=write pytest tests/console/test_transcripts.py

writes the texts anew (see `tests.golden_text`).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from functools import cache
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
from profiles.roundness import evaluate
from profiles.store import load_job
from tests.console.folding import exchanges, folded
from tests.golden_text import compare, writing
from tests.system.lathe_sites import compact

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
    machine, lines = compact(family), Lines()
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
    trace = transcript(family, strategy)[1].trace
    assert trace is not None
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
