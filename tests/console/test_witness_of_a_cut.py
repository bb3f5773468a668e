"""What is changed and restored between two polls is seen by a PLC of the controller, which runs in each cycle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from benchmarks.hostile_host import JOB, WitnessedLathe, lathe_at, plan_of
from console.session.cut.cut_verdict import CutJudgement, CutVerdict
from console.session.cut.engine import CutContext, Step
from console.session.cut.run import cut_part
from drivers.cutting.planning import plan_cut
from drivers.cutting.strategy import Strategy
from drivers.lathe.lathe import Lathe
from drivers.lathe.polling import Poller
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.program_constants import assigned
from drivers.pmac.witness import CONSTANTS, Witness, WitnessReport
from profiles.problem import Problem, ProblemError
from tests.system.lathe_sites import compact

BRIEF_S = 0.012  # two background cycles; polls are 29 ms apart


@dataclass(kw_only=True)
class Cut:
    """A cut of a family, in which another host sends lines at moments of the program."""

    family: str = "pmac"
    strategy: Strategy = Strategy.PVT
    deeds: list[tuple[float, str]] = field(default_factory=list)
    before: Callable[[WitnessedLathe], None] = lambda _: None

    def made(self) -> CutVerdict | tuple[Problem, ...]:
        machine, plan = compact(self.family), plan_of(self.family, self.strategy)
        sim = WitnessedLathe(machine)
        lathe = lathe_at(sim, machine)

        def tell(step: Step, _: str) -> None:
            if step is Step.ARM:
                self.before(sim)
            if step is Step.CUT:
                sim.due = [(sim.now_s() + after_s, f"{line}\r".encode()) for after_s, line in self.deeds]

        lathe.connect()
        try:
            return cut_part(CutContext(lathe=lathe, workshop=sim), JOB, plan, tell).figures.verdict
        except ProblemError as error:
            return tuple(error.problems)


@pytest.mark.parametrize("strategy", list(Strategy))
def test_no_program_writes_a_constant_that_is_witnessed(strategy: Strategy) -> None:
    """Nor one that this console may trim while it cuts."""
    witnessed = {f"P{number}" for number in CONSTANTS}
    for trimmed in {False, strategy.traits.trims}:
        program = plan_cut(JOB, compact("pmac"), strategy, trimmed=trimmed).program
        assert not witnessed & assigned(program)


@pytest.fixture
def nobody_reads_beside(monkeypatch: pytest.MonkeyPatch) -> None:
    """By chance a reading may fall into the moment."""
    monkeypatch.setattr(Poller, "read_beside", lambda _: None)


BRIEF = {
    "gain": ("I130=I130/2", "I130=I130*2", "cut.witness_changed", "I130"),
    "scale": ("I108=I108+1", "I108=I108-1", "cut.witness_changed", "I108"),
    "encoder": ("I103=I103+1", "I103=I103-1", "cut.witness_changed", "I103"),
    "servo period": ("I10=I10+37137", "I10=I10-37137", "cut.witness_changed", "I10"),
    "constant": ("P22=P22+1", "P22=P22-1", "cut.witness_constant", "P11 … P621"),
    "bias": ("M500->{bias} M500=M500+9216", "M500=M500-9216", "cut.witness_bias", "tool"),  # 3 counts
    "correction": ("M500->{comp} M500=M500+9216", "M500=M500-9216", "cut.witness_compensation", "tool"),
}
REGISTERS = {"pmac": {"bias": "D:$813", "comp": "D:$46"}, "turbo": {"bias": "D:$CC", "comp": "D:$90"}}


@pytest.mark.parametrize("name", BRIEF)
@pytest.mark.parametrize("family", ["pmac", "turbo"])
@pytest.mark.usefixtures("nobody_reads_beside")
def test_what_lasts_for_two_cycles_is_seen(family: str, name: str) -> None:
    first, later, code, key = BRIEF[name]
    at_s = 0.5 * plan_of(family, Strategy.PVT).duration_s
    deeds = [(at_s, first.format(**REGISTERS[family])), (at_s + BRIEF_S, later)]
    found = Cut(family=family, deeds=deeds).made()
    assert isinstance(found, tuple), found
    assert (found[0].code, found[0].key) == (code, key)


@pytest.mark.parametrize("strategy", list(Strategy))
@pytest.mark.parametrize("family", ["pmac", "turbo"])
def test_a_cut_that_nobody_disturbs_has_nothing_to_say(family: str, strategy: Strategy) -> None:
    found = Cut(family=family, strategy=strategy).made()
    assert isinstance(found, CutVerdict), found
    assert (found.changes, found.unwitnessed) == ((), None)
    if strategy.traits.inverts:
        assert found.judgement is CutJudgement.AS_PLANNED


@pytest.mark.parametrize(
    "lines",
    [
        ("DISABLE PLC21", "ENABLE PLC21"),
        ("OPEN PLC21 CLEAR\rP971=P971+1\rCLOSE\rENABLE PLC21", "P972=2"),
        ("P972=0", "P1=P1"),
        ("P971=P971+50", "P1=P1"),
    ],
)
def test_a_witness_that_was_stopped_or_changed_proves_nothing(lines: tuple[str, str]) -> None:
    at_s = 0.5 * plan_of("pmac", Strategy.PVT).duration_s
    found = Cut(deeds=[(at_s, lines[0]), (at_s + 0.1, lines[1])]).made()
    assert isinstance(found, CutVerdict), found
    assert found.judgement is CutJudgement.NOT_PROVEN
    assert [each.code for each in found.problems] == ["cut.witness_gap"]


@pytest.mark.parametrize(("text", "stays"), [("P900=P900+1", True), ("P971=P971+1", False)])
def test_the_program_of_somebody_else_keeps_its_number(text: str, stays: bool) -> None:
    """An older witness of ours, which begins in the same way, is replaced."""
    machine = compact("pmac")
    sim = WitnessedLathe(machine)
    link = MemoryLink(sim.connect(), sim)
    client = PmacClient(link, sim)
    Lathe(client, machine, sim, StopPath(link)).connect()
    client.download(("CLOSE", "OPEN PLC21", "CLEAR", text, "CLOSE", "ENABLE PLC21"))
    Witness(client, machine).prepare()
    listing = client.question("LIST PLC21", 1.0)
    assert (listing[0], len(listing) < 4) == (text, stays)


def test_a_controller_without_it_cuts_and_says_so() -> None:
    def delete(sim: WitnessedLathe) -> None:
        sim.enemy.receive(b"DELETE PLC21\r")
        sim.enemy.take_output()

    found = Cut(before=delete).made()
    assert isinstance(found, CutVerdict), found
    assert found.judgement is CutJudgement.AS_PLANNED
    assert [each.code for each in found.problems] == ["cut.witness_missing"]


def report(**extremes: tuple[float, float]) -> WitnessReport:
    settings = {"I130": 400.0}
    quiet = {"bias": (3.0, 3.0), "compensation": (0.0, 0.0), "following_error": (-1.0, 1.0)}
    return WitnessReport(before=settings, first=settings, extremes={**quiet, **extremes})


def test_a_following_error_between_the_polls_is_judged_by_that_of_the_polls() -> None:
    """Polled are -2 to 2 um: beyond them by more than their 4 um of height is told; after a hold nothing is."""
    within = report(following_error=(-5.9, 5.9))
    beyond = report(following_error=(-2.0, 6.1))
    assert list(within.changes(None, (-2.0, 2.0))) == []
    found = list(beyond.changes(None, (-2.0, 2.0)))
    assert [(each.code, each.value, each.limit) for each in found] == [
        ("cut.witness_following_error", "4.10 um", "4.0 um")
    ]
    assert list(beyond.changes(None, None)) == []


def test_the_correction_of_a_table_is_judged_by_its_entries() -> None:
    inside, outside = report(compensation=(-28.0, 28.0)), report(compensation=(-28.0, 28.5))
    assert list(inside.changes((-28.0, 28.0), None)) == []
    assert [each.value for each in outside.changes((-28.0, 28.0), None)] == ["0.50 um"]
