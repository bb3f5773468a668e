"""A cut that is held ends with a whole turn, takes the tool out without a mark, and leaves a machine at hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from profiles.compensations.path import target_path
from profiles.roundness import evaluate
from tests.drivers import families
from tests.drivers.families import ON_ONE

machine = families.close_families
"""Everything close together, in both families."""


if TYPE_CHECKING:
    from profiles.job import Job
    from profiles.machine import MachineProfile
    from tests.drivers.conftest import Bench, JobMaker

RUN_UP_S = 1.0


@dataclass(frozen=True, kw_only=True)
class Run:
    """One program that ran: its last look, and the axes at each servo cycle in counts."""

    plan: CutPlan
    last: Snapshot
    tool: np.ndarray
    spindle: np.ndarray
    spindle_command: np.ndarray
    carriage_command: np.ndarray

    @property
    def feeding(self) -> slice:
        """From the first cycle in which the carriage moves to the last one at the rate of the feed."""
        steps = np.diff(self.carriage_command)
        rate = self.plan.setup.carriage_per_turn * np.diff(self.spindle_command) / self.plan.setup.counts_per_turn
        full = np.flatnonzero(steps > 0.99 * rate)
        first = int(np.flatnonzero(steps > 0.0)[0])
        breaks = full[full > first]
        gaps = np.flatnonzero(np.diff(breaks) > 1)
        return slice(first, int(breaks[gaps[0]] if len(gaps) else breaks[-1]) + 1)

    @property
    def turns(self) -> float:
        """Turns of the spindle in that time."""
        during = self.spindle_command[self.feeding]
        return float((during[-1] - during[0]) / self.plan.setup.counts_per_turn)

    def mark_um(self, job: Job) -> float:
        """How much further into the wanted path the tool was at any angle than it was while it cut."""
        infeed_um = (self.tool - self.plan.setup.surface) * self.plan.setup.tool_count_um
        angle_deg = 360.0 * self.spindle / self.plan.setup.counts_per_turn
        excess_um = infeed_um - target_path(job).at_um(angle_deg)
        during = float(excess_um[self.feeding].max())
        assert during < 2.0, "the path itself is kept"
        return float(excess_um[self.feeding.stop :].max()) - during


def aligned(bench: Bench, job: Job, machine: MachineProfile, strategy: Strategy) -> CutPlan:
    plan = plan_cut(job, machine, strategy)
    bench.homed(job)
    bench.lathe.program.load(plan.program)
    bench.to_start(plan)
    return plan


def run(bench: Bench, plan: CutPlan, hold_s: float | None) -> Run:
    """Run the loaded program and hold it from inside the watch, `hold_s` after its start."""
    recorders = [bench.record(motor) for motor in (1, 2, 3)]
    lathe, began_s = bench.lathe, bench.sim.now_s()
    held = False

    def watch(snapshot: Snapshot) -> None:
        nonlocal held
        if hold_s is not None and not held and snapshot.at_s >= began_s + hold_s:
            held = True
            lathe.program.end_after_turn()

    lathe.program.start(plan.program.number, plan.setup.retracted)
    last = lathe.program.follow(watch, timeout_s=2 * plan.duration_s)
    tool, spindle, carriage = recorders
    return Run(
        plan=plan,
        last=last,
        tool=np.array(tool.positions),
        spindle=np.array(spindle.positions),
        spindle_command=np.array(spindle.commands),
        carriage_command=np.array(carriage.commands),
    )


def is_left_in_order(found: Run) -> bool:
    """Tool retracted within 1 um, everything at rest, homed and in closed loop."""
    out_um = (found.last.tool.position - found.plan.setup.retracted) * found.plan.setup.tool_count_um
    return abs(out_um) < 2.0 and found.last.at_rest and found.last.homed and found.last.loops_closed


@pytest.mark.first(3)
@pytest.mark.parametrize(
    ("machine", "strategy", "rpm", "hold_s"),
    [
        ("pmac", Strategy.PVT, 1000.0, 2.0),
        ("turbo", Strategy.PVT, 1000.0, 2.437),
        ("pmac", Strategy.PVT, 1234.5, 2.2),
        ("pmac", Strategy.PVT, 640.0, 2.71),
        ("turbo", Strategy.NONE, 1234.5, 2.2),
        ("pmac", Strategy.NONE, 1000.0, 2.437),
    ],
    indirect=["machine"],
)
def test_a_hold_at_any_moment_leaves_whole_turns_and_no_mark(
    bench: Bench, machine: MachineProfile, experiment: JobMaker, strategy: Strategy, rpm: float, hold_s: float
) -> None:
    job = replace(experiment(1), spindle_speed_rpm=rpm, cut_length_mm=2.0)
    found = run(bench, aligned(bench, job, machine, strategy), hold_s)
    # A segment, of which half may be missing or too much, and a servo cycle at each end.
    tolerance = (0.5 * found.plan.segment_ms + 1.0) * rpm / 60_000.0
    assert found.turns == pytest.approx(round(found.turns), abs=tolerance)
    # Ended within the turn in which it was asked, a look and two segments late.
    feed_began_s = found.feeding.start * bench.cycle_ms / 1000.0
    assert 0.0 <= found.turns * 60.0 / rpm + feed_began_s - hold_s < 60.0 / rpm + 0.06
    uncompensated = replace(job, lobe_error_um_pp=0.0)
    assert found.mark_um(job if strategy is Strategy.PVT else uncompensated) < 0.05
    assert is_left_in_order(found)


@ON_ONE
@pytest.mark.parametrize("hold_s", [4.0, 4.33])
def test_the_paper_program_is_held_at_the_end_of_a_turn_too(
    bench: Bench, machine: MachineProfile, experiment: JobMaker, hold_s: float
) -> None:
    job = replace(experiment(1), cut_length_mm=4.0)
    found = run(bench, aligned(bench, job, machine, Strategy.PAPER), hold_s)
    # The first and the last ramp of the carriage are seen a millisecond or two late.
    assert found.turns == pytest.approx(round(found.turns), abs=0.02)
    assert 1.0 <= found.turns < 40.0
    # The printed retract goes 10000 counts out, from where the zig-zag is shallowest.
    assert found.last.tool.position == pytest.approx(found.plan.setup.surface + 500 - 10_000, abs=10)
    assert found.last.at_rest
    assert found.last.homed
    assert found.last.loops_closed
    # The deepest point of the printed path, 500 and 275 counts, is that of the whole run.
    assert found.tool.max() < found.plan.setup.surface + 775 + 5


@ON_ONE
@pytest.mark.parametrize("phase_deg", [25.0, 47.0, 90.0])
@pytest.mark.first(1)
def test_a_cut_that_is_not_held_ends_with_a_whole_turn_without_a_mark(
    bench: Bench, machine: MachineProfile, experiment: JobMaker, phase_deg: float
) -> None:
    """Wherever the lobe has the tool at the end: one way of retracting must do for all of them."""
    job = replace(experiment(1), lobe_phase_deg=phase_deg, cut_length_mm=0.5)
    found = run(bench, aligned(bench, job, machine, Strategy.PVT), None)
    assert found.turns == pytest.approx(np.ceil(found.plan.setup.turns - 1e-6), abs=0.05)
    assert found.mark_um(job) < 0.05
    assert is_left_in_order(found)


@ON_ONE
def test_what_was_cut_before_a_hold_is_round(bench: Bench, machine: MachineProfile, experiment: JobMaker) -> None:
    """The measured section is in the middle; the hold comes behind it."""
    plan = aligned(bench, replace(experiment(1), cut_length_mm=3.0), machine, Strategy.PVT)
    found = run(bench, plan, 4.5)
    assert 0.6 * plan.setup.turns < found.turns < plan.setup.turns - 20
    trace = bench.sim.measure()
    assert evaluate(trace.angle_deg, trace.deviation_um, None).ront_um < 1.0


@ON_ONE
@pytest.mark.parametrize("strategy", list(Strategy))
@pytest.mark.first(2)
def test_a_hold_before_the_feed_ends_clear_of_the_part(
    bench: Bench, machine: MachineProfile, experiment: JobMaker, strategy: Strategy
) -> None:
    """The paper program has begun its first turn by then: the controller calculates one move ahead."""
    plan = aligned(bench, replace(experiment(1), cut_length_mm=0.3), machine, strategy)
    found = run(bench, plan, 0.5 * RUN_UP_S)
    turns = 1 if strategy is Strategy.PAPER else 0
    assert found.carriage_command.max() <= plan.carriage_start + turns * plan.setup.carriage_per_turn + 1e-6
    assert found.last.tool.position < plan.setup.surface - 1000
    assert found.last.at_rest


@ON_ONE
@pytest.mark.parametrize("strategy", [Strategy.PVT, Strategy.PAPER])
@pytest.mark.first(1)
def test_a_held_program_runs_from_its_beginning_the_next_time(
    bench: Bench, machine: MachineProfile, experiment: JobMaker, strategy: Strategy
) -> None:
    plan = aligned(bench, replace(experiment(1), cut_length_mm=0.5), machine, strategy)
    assert run(bench, plan, 2.4).turns < plan.setup.turns - 5
    bench.to_start(plan)
    assert run(bench, plan, None).turns == pytest.approx(np.ceil(plan.setup.turns - 1e-6), abs=0.05)


def test_a_hold_after_a_stop_and_without_a_program_moves_nothing(closed: Bench) -> None:
    before = closed.lathe.snapshot()
    closed.lathe.program.end_after_turn()
    closed.stop.stop("operator")
    closed.lathe.program.end_after_turn()
    closed.sim.wait(1.0)
    assert closed.lathe.snapshot().still(before, 5.0)
    assert closed.stop.reason == "operator"


class Forgetful(MemoryLink):
    """A link that loses the answer to what `loses` says, once."""

    loses: Callable[[bytes], bool] = staticmethod(lambda sent: False)
    _sent = b""

    def send(self, data: bytes) -> None:
        self._sent = data
        super().send(data)

    def receive(self, timeout_s: float) -> bytes:
        data = super().receive(timeout_s)
        if data and self.loses(self._sent):
            self.loses = lambda sent: False
            return b""
        return data


def test_a_hold_whose_answer_is_lost_is_sent_once_more(bench: Bench, machine: MachineProfile) -> None:
    link = Forgetful(bench.port, bench.sim)
    lathe = Lathe(PmacClient(link, bench.sim), machine, bench.sim, StopPath(link))
    lathe.connect()
    bench.client.request("M26=0")
    link.loses = lambda sent: sent.startswith(b"M26")
    lathe.program.end_after_turn()
    assert bench.number("M26") == 1
