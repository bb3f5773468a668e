"""The figures of a cut from its polls: speed, tool error and following error, of the turns that count."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from console.session.cut.engine import _before
from console.session.cut.run import plan_run
from console.session.cut.telemetry import CutFigures, Telemetry, is_leaving
from console.session.stages import Stage
from drivers.cutting.planning import Strategy, plan_cut
from drivers.lathe.snapshot import AxisState, Snapshot
from profiles.store import load_job
from tests.system.lathe_sites import compact

JOB, MACHINE = load_job("lee-2001-experiment-1").job, compact("pmac")
PLAN = plan_cut(JOB, MACHINE, Strategy.PVT)
POLL_S, TURN_S, OFF_UM, LAG_UM = 0.023, 0.06, 0.4, 3.0


def cut(*, last_um: float = 0.0, first_um: float = 0.0, leaves_at: int = 0) -> tuple[CutFigures, int]:
    """A tool `OFF_UM` too deep, and so many um in the turns before the part and in the last one.

    From poll `leaves_at` on the program ends early: the tool retracts over the part. Returns the figures, and how
    many polls are of the part, but for its last turn.
    """
    setup, per_um, polls = PLAN.setup, 1.0 / MACHINE.tool.count_um, Telemetry(PLAN, MACHINE, JOB)
    end = PLAN.carriage_start + setup.carriage_counts
    first, last = end - JOB.cut_length_mm * MACHINE.carriage.counts_per_mm, end - setup.carriage_per_turn
    counted = 0
    for number in range(int(setup.turns * TURN_S / POLL_S)):
        at_s = number * POLL_S
        turn = at_s / TURN_S
        carriage = PLAN.carriage_start + turn * setup.carriage_per_turn
        counted += first <= carriage <= last
        off_um = OFF_UM + (last_um if carriage > last else 0.0) + (first_um if carriage < first else 0.0)
        if leaves_at and number >= leaves_at:
            off_um = -5.0 * (number - leaves_at + 1)
        past_mm = (carriage - setup.carriage_middle) / MACHINE.carriage.counts_per_mm
        tool = setup.surface + per_um * float(PLAN.target.at_um(360.0 * turn, past_mm) + off_um)
        places = ((tool, LAG_UM * per_um), (turn * setup.counts_per_turn, 0.0), (carriage, 0.0))
        axes = [AxisState(position=float(at), following_error=lag, flags=frozenset()) for at, lag in places]
        snapshot = Snapshot(
            asked_s=at_s,
            at_s=at_s,
            program_running=True,
            runtime_error=False,
            tool=axes[0],
            spindle=axes[1],
            carriage=axes[2],
        )
        polls.see(snapshot, holding=bool(leaves_at))
    found = polls.figures()
    assert found is not None
    return found, counted


def test_the_figures_are_those_of_the_part_without_its_last_turn() -> None:
    """A turn of 60 ms is 1000 rpm. Before the part the tool may be anywhere, and in its last turn it may leave."""
    found, counted = cut(first_um=40.0, last_um=50.0)
    assert found.samples == counted > 100
    assert found.spindle_speed_rpm == pytest.approx(1000.0, rel=1e-6)
    assert (found.tool_error_um, found.tool_error_rms_um) == pytest.approx((OFF_UM, OFF_UM), rel=1e-3)
    assert (found.following_error_um, found.following_error_rms_um) == pytest.approx((LAG_UM, LAG_UM))


def test_a_tool_that_leaves_the_part_early_ends_its_figures() -> None:
    assert cut(leaves_at=100)[0].tool_error_um == pytest.approx(OFF_UM, rel=1e-3)
    assert cut(leaves_at=100)[0].samples < cut()[0].samples


@pytest.mark.parametrize(
    ("error_um", "peak_um", "leaves"),
    [(1.9, 0.1, False), (-2.1, 0.1, True), (5.9, 3.0, False), (-6.1, 3.0, True)],
)
def test_a_tool_leaves_where_it_is_off_by_twice_what_it_was_before_and_by_2_um(
    error_um: float, peak_um: float, leaves: bool
) -> None:
    assert bool(is_leaving(error_um, np.float64(peak_um))) is leaves


@pytest.mark.parametrize(
    ("stage", "left_um_pp"), [(Stage.AIR, None), (Stage.PARTIAL, (27.5, 82.5)), (Stage.FULL, None)]
)
def test_the_half_stage_alone_tells_what_it_leaves_with_the_right_sign_and_with_the_wrong_one(
    stage: Stage, left_um_pp: tuple[float, float] | None
) -> None:
    """Of 55 um the half, or as much more."""
    told = plan_run(JOB, MACHINE, Strategy.PVT, stage=stage, simulated=True).expected
    assert (None if told is None else (told.right_um_pp, told.wrong_um_pp)) == left_um_pp


def test_a_lost_cut_may_have_gone_on_unseen_for_a_turn_and_as_long_as_the_controller_takes_to_end_it() -> None:
    """6.3 s at 1000 rpm are 105 turns."""
    lathe: Any = SimpleNamespace(ends_within_s=6.3, machine=MACHINE)
    before = _before(lathe, PLAN, touched_mm=2.5)
    assert before is not None and before.to_mm == 2.5
    assert before.unseen_mm == pytest.approx(106.0 * JOB.feed_mm_per_rev)
    assert _before(lathe, PLAN, touched_mm=0.0) is None
