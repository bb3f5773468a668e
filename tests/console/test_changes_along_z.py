"""What another host changes of a path that itself changes along Z: its axial constants, its table of angle x Z.

A chuck holds a shell, whose lobe is less towards its free end. Lines come on a connection of their own; a single
entry of a table is changed as a memory write does, which no command of the language does alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.hostile_host import Truth, WitnessedLathe, lathe_at, truth_of
from console.session.cut.cut_verdict import CutJudgement
from console.session.cut.engine import CutContext, PartStep
from console.session.cut.run import cut_part
from console.text.catalogue import load
from drivers.cutting.planning import CutPlan, plan_cut
from drivers.cutting.strategy import Strategy
from drivers.lathe.heartbeat import cut_condition
from drivers.pmac.compensation.table import PARTS_PER_COUNT
from profiles.problem import Problem, ProblemError
from profiles.store import load_job
from tests.system.lathe_sites import compact

MACHINE = compact("pmac")
JOB = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=3.0)
SEGMENTS = [Strategy.PVT, Strategy.TIMEBASE]
BEFORE_THE_START = [PartStep.CHECK, PartStep.ALIGN, PartStep.ARM]
EARLY, LATE = 0.1, 0.9  # fractions of the time in the part
BACK = 1.001  # behind the feed, and before the end of the program

Deed = Callable[[WitnessedLathe], None]


class SharedLathe(WitnessedLathe):
    """A lathe to which another host does something at its times."""

    deeds: list[tuple[float, Deed]]

    def wait(self, seconds: float) -> None:
        end_s = self.now_s() + seconds
        while self.deeds and self.deeds[0][0] <= end_s:
            at_s, do = self.deeds.pop(0)
            super().wait(max(at_s - self.now_s(), 0.0))
            do(self)
        super().wait(max(end_s - self.now_s(), 0.0))


def sent(line: str) -> Deed:
    def do(sim: WitnessedLathe) -> None:
        sim.enemy.receive(f"{line}\r".encode())
        assert b"\x07" not in sim.enemy.take_output()

    return do


def added(um: float, rows: slice, columns: slice) -> Deed:
    """Add to entries of the table of the tool."""

    def do(sim: WitnessedLathe) -> None:
        memory, motor = sim.controller.tables, MACHINE.tool.motor
        table = memory.tables[motor]
        grid: NDArray[np.int_] = np.array([0, *table.entries]).reshape(shape_of_table())
        grid[rows, columns] += round(um * PARTS_PER_COUNT / MACHINE.tool.count_um)
        changed = table.definition.fill_table(grid.ravel()[1:].tolist())
        memory.tables, memory.revision = {**memory.tables, motor: changed}, memory.revision + 1

    return do


@cache
def plan(strategy: Strategy) -> CutPlan:
    return plan_cut(JOB, MACHINE, strategy, watchdog=cut_condition(MACHINE))


def shape_of_table() -> tuple[int, int]:
    definition = plan(Strategy.CAM).program.tables[0].definition
    assert definition.rows
    return definition.rows + 1, definition.columns + 1


def cut(
    strategy: Strategy, deeds: list[tuple[float, Deed]], step: PartStep = PartStep.CUT
) -> tuple[tuple[Problem, ...], CutJudgement | None, SharedLathe]:
    """Cut a part with deeds at seconds behind the beginning of a step; a judgement where it ended with one."""
    sim = SharedLathe(MACHINE)
    sim.deeds = []
    lathe = lathe_at(sim, MACHINE)

    def tell(begun: PartStep, _: str) -> None:
        if begun is PartStep.CUT:
            sim.begun_s = sim.now_s()
        if begun is step:
            sim.deeds = [(sim.now_s() + after_s, do) for after_s, do in deeds]

    lathe.connect()
    try:
        verdict = cut_part(CutContext(lathe=lathe, workshop=sim), JOB, plan(strategy), tell).figures.verdict
    except ProblemError as error:
        return tuple(error.problems), None, sim
    assert not sim.deeds, "the cut was over before"
    return verdict.problems, verdict.judgement, sim


@cache
def undisturbed(strategy: Strategy) -> Truth:
    problems, judgement, sim = cut(strategy, [])
    assert (problems, judgement) == ((), CutJudgement.AS_PLANNED)
    return truth_of(sim)


def at_s(strategy: Strategy, fraction: float) -> float:
    begin_s, end_s = undisturbed(strategy).in_part_s
    return begin_s + fraction * (end_s - begin_s)


@pytest.mark.parametrize("step", BEFORE_THE_START)
@pytest.mark.parametrize(("strategy", "name"), [(Strategy.PVT, "P83"), (Strategy.TIMEBASE, "P89")])
def test_an_axial_constant_that_is_changed_before_the_start_is_named_and_nothing_is_cut(
    strategy: Strategy, step: PartStep, name: str
) -> None:
    """P83 is the slope of the lobe, over the lobe; P89 that of the mean, counts of 0.2 um."""
    problems, _, sim = cut(strategy, [(0.001, sent(f"{name}={name}*1.02"))], step)
    assert [(each.code, each.key) for each in problems] == [("controller.constant_differs", name)]
    assert name in load("en").problem(problems[0])
    assert sim.witness.deepest_mm == {}


@pytest.mark.parametrize(
    ("line", "when"),
    [
        ("P83=P83*1.02", EARLY),
        ("P83=P83*1.02", LATE),
        ("P89=P89+1", EARLY),
        ("P89=P89+1", LATE),
        ("P81=P81*1.01", EARLY),
        ("P82=P82+0.01", LATE),
    ],
)
@pytest.mark.parametrize("strategy", SEGMENTS)
def test_an_axial_constant_that_is_changed_in_the_cut_is_named(strategy: Strategy, line: str, when: float) -> None:
    problems, _, _ = cut(strategy, [(at_s(strategy, when), sent(line))])
    assert (problems[0].code, problems[0].key) == ("cut.constant_differs", line[:3])


@pytest.mark.parametrize("line", ["P59=2", "P79=150", "P80=5"])
@pytest.mark.parametrize("strategy", SEGMENTS)
def test_what_each_segment_computes_anew_cannot_be_overwritten(strategy: Strategy, line: str) -> None:
    """The place of a segment, its factor and its mean: none is in a move before the next one computes it."""
    fractions = (-0.1, EARLY, 0.5, LATE)
    problems, judgement, sim = cut(strategy, [(at_s(strategy, each), sent(line)) for each in fractions])
    assert (problems, judgement) == ((), CutJudgement.AS_PLANNED)
    assert truth_of(sim).differs(undisturbed(strategy)) == ""


ALL = slice(None)
FAR, HERE = slice(-2, -1), slice(3, 4)  # rows behind the cut, and next to it: they are 3.1 mm apart
ENTRIES = {
    "an entry far away": (FAR, slice(70, 71)),
    "an entry": (HERE, slice(70, 71)),
    "a row": (HERE, ALL),
    "a column": (ALL, slice(70, 71)),
}


def first_of(rows: slice, columns: slice) -> int:
    """The number of the first entry that is changed; the origin is none."""
    height, width = shape_of_table()
    (first, *_) = (
        row * width + column for row in range(height)[rows] for column in range(width)[columns] if row or column
    )
    return first


@pytest.mark.parametrize("name", ENTRIES)
@pytest.mark.parametrize(
    ("step", "after"),
    [(PartStep.ARM, None), (PartStep.CUT, EARLY), (PartStep.CUT, LATE)],
)
def test_an_entry_of_the_table_that_is_another_one_is_named(
    step: PartStep, after: float | None, name: str
) -> None:
    """By 2 um, at any Z. A table in use is not read: it is after the cut, which is then not the planned one."""
    after_s = 0.001 if after is None else at_s(Strategy.CAM, after)
    problems, _, sim = cut(Strategy.CAM, [(after_s, added(2.0, *ENTRIES[name]))], step)
    code, key = "controller.table_differs", f"entry {first_of(*ENTRIES[name])}"
    assert (code, key) in [(each.code, each.key) for each in problems]
    assert (sim.witness.deepest_mm == {}) is (after is None)


def put_back(rows: slice, columns: slice, um: float, begin_s: float, end_s: float) -> list[tuple[float, Deed]]:
    return [(begin_s, added(um, rows, columns)), (end_s, added(-um, rows, columns))]


@pytest.mark.parametrize(
    ("rows", "columns", "um"),
    [
        (HERE, ALL, 2.0),
        (ALL, slice(70, 75), 1.0),  # 13 degrees of the spindle
        (ALL, slice(70, 71), 20.0),
        (ALL, slice(130, 131), 20.0),  # within the range of the table: a poll alone meets it
    ],
)
def test_what_is_changed_in_the_table_for_the_whole_feed_and_put_back_is_a_disturbance(
    rows: slice, columns: slice, um: float
) -> None:
    deeds = put_back(rows, columns, um, at_s(Strategy.CAM, -0.05), at_s(Strategy.CAM, BACK))
    problems, judgement, sim = cut(Strategy.CAM, deeds)
    assert sim.deeds == [] and judgement is None
    assert {each.code for each in problems} & {"cut.off_path", "cut.command_off_plan", "cut.witness_compensation"}


def each_column(rows: slice, um: float) -> list[list[tuple[float, Deed]]]:
    """Every ninth column of a turn by itself, from before the feed until it is over."""
    feed_s = at_s(Strategy.CAM, -0.05), at_s(Strategy.CAM, BACK)
    return [put_back(rows, slice(column, column + 1), um, *feed_s) for column in range(3, 141, 9)]


def each_moment(um: float) -> list[list[tuple[float, Deed]]]:
    """All of the table at once, for less than the time between two polls."""
    begins_s = [at_s(Strategy.CAM, fraction) for fraction in np.linspace(0.04, 0.92, 16)]
    return [put_back(ALL, ALL, um, begin_s, begin_s + 0.012) for begin_s in begins_s]


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    ("drawn", "unseen", "left_um"),
    [
        (lambda: each_column(ALL, 20.0), 4, 3.1),
        (lambda: each_column(ALL, 40.0), 0, 0.0),
        (lambda: each_column(HERE, 40.0), 7, 4.6),
        (lambda: each_moment(20.0), 3, 20.6),
    ],
)
def test_how_much_of_what_no_poll_meets_is_left_on_the_part(
    drawn: Callable[[], list[list[tuple[float, Deed]]]], unseen: int, left_um: float
) -> None:
    """Of 16 each: what docs/planned-cut.md says of a table that is changed and put back."""
    left = []
    for deeds in drawn():
        _, judgement, sim = cut(Strategy.CAM, deeds)
        if judgement is not None:
            off_um = truth_of(sim).sections_um - undisturbed(Strategy.CAM).sections_um
            left.append(float(np.abs(off_um).max()))
    assert len(left) <= unseen and max(left, default=0.0) <= left_um
