"""Jaw 1 by its flanks and the touch-off by a skim cut: what is taken, how sure it is, what refuses it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from console.session.cut.alignment import (
    Alignment,
    clamped,
    clamping_of,
    handed_over,
    observed,
    unclamped,
    without_reading,
)
from console.session.cut.jaw_by_indicator import (
    allowed_spread_deg,
    mean_deg,
    reading_problem,
    results_deg,
    spread_deg,
    spread_problem,
)
from console.session.station.commands import (
    Approach,
    ConfirmClamping,
    EnableDrives,
    Forget,
    Home,
    Jog,
    NoteSkim,
    TakeFlank,
    TakeJaw,
    TakeTouchOff,
)
from drivers.lathe.snapshot import AxisName
from profiles.store import load_job
from tests.console.floor import Floor, experiment_1, open_floor

JOB = load_job("lee-2001-experiment-1").job
FLANK_DEG = 8.0
"""Half of what a jaw is wide, as an angle."""


def test_the_middle_of_two_flanks_is_found_across_the_index_too() -> None:
    assert results_deg((352.0, 12.0, 12.2, 352.2)) == pytest.approx((2.0, 2.2))
    assert mean_deg((359.9, 0.2, 0.2)) == pytest.approx(0.1)
    assert spread_deg((359.9, 0.2, 0.2)) == pytest.approx(0.3)
    assert results_deg((10.0, 20.0, 30.0)) == (15.0,)


@pytest.mark.parametrize(
    ("apart_deg", "jaws", "fits"), [(0.3, 3, False), (16.0, 3, True), (61.0, 3, False), (61.0, 2, True)]
)
def test_the_second_reading_is_at_the_other_flank_of_the_same_jaw(apart_deg: float, jaws: int, fits: bool) -> None:
    assert (reading_problem((355.0,), (355.0 + apart_deg) % 360.0, jaws) is None) is fits


def test_the_part_says_how_far_apart_the_results_may_be() -> None:
    # 2 / N asin(R / 4 A) with R = 0.8 of 5 um and a lobe of 55 um peak to peak, three jaws: 1.39 degrees.
    expected = math.degrees(2.0 / 3.0 * math.asin(0.8 * 5.0 / (4.0 * 27.5)))
    assert allowed_spread_deg(JOB) == pytest.approx(expected)
    near, far = (0.0, 16.0, 0.5, 16.5, 1.0, 17.0), (0.0, 16.0, 0.5, 16.5, 1.6, 17.6)
    assert spread_problem(near, expected) is None
    refused = spread_problem(far, expected)
    assert refused is not None and (refused.value, refused.limit) == ("1.60°", "<= 1.39°")
    assert spread_problem(far, None) is None
    few = spread_problem(near[:5], expected)
    assert few is not None and few.code == "alignment.flanks_incomplete"


@pytest.fixture
def homed(tmp_path: Path) -> Floor:
    floor = open_floor(tmp_path)
    floor.do(ConfirmClamping(job=experiment_1()))
    floor.do(EnableDrives())
    floor.do(Home())
    return floor


def turn_to_deg(floor: Floor, past_mark_deg: float) -> None:
    """Turn until the jaw is so far past the mark, as an indicator there would be brought to a flank."""
    for _ in range(2):
        seen = floor.idle().seen
        assert seen is not None
        floor.do(Jog(axis=AxisName.SPINDLE, distance=past_mark_deg - seen.jaw_1_past_mark_deg))


def codes(floor: Floor) -> list[str]:
    return [problem.code for problem in floor.state.refusals]


def test_three_times_both_flanks_give_jaw_1_and_its_spread(homed: Floor) -> None:
    for off_deg in (0.0, 0.2, -0.1):
        for flank_deg in (-FLANK_DEG, FLANK_DEG):
            turn_to_deg(homed, flank_deg + off_deg)
            homed.do(TakeFlank())
            assert codes(homed) == []
    homed.do(TakeFlank())
    assert codes(homed) == ["alignment.flanks_complete"]
    homed.do(TakeJaw(most_spread_deg=0.1))
    assert codes(homed) == ["alignment.spread_too_large"]
    homed.do(TakeJaw(most_spread_deg=1.39))
    jaw = homed.state.alignment.jaw
    assert jaw is not None and jaw.spread_deg == pytest.approx(0.3, abs=0.1)
    assert homed.state.alignment.flanks == ()
    # The middle of all is where the jaw meets the mark: a third of a tenth of a degree further on.
    turn_to_deg(homed, 0.0)
    snapshot = homed.state.snapshot
    assert snapshot is not None
    mark_deg = 360.0 * (snapshot.spindle.position / 10_000.0 % 1.0)
    assert (jaw.angle_deg - mark_deg + 180.0) % 360.0 - 180.0 == pytest.approx(0.03, abs=0.08)


def test_a_reading_is_dropped_by_one_key(homed: Floor) -> None:
    turn_to_deg(homed, -FLANK_DEG)
    homed.do(TakeFlank())
    homed.do(TakeFlank())
    assert codes(homed) == ["alignment.flanks_apart"]
    homed.do(TakeJaw())
    assert codes(homed) == ["alignment.flanks_incomplete"]
    assert len(homed.do(Forget()).alignment.flanks) == 0


READ = Alignment(homed=True, flanks=(352.0, 8.0), skim_counts=250_000.0, clamping=clamping_of(JOB, at="08:40"))
NOTHING = ((), None)


def test_readings_end_with_what_they_rest_on() -> None:
    def left(alignment: Alignment) -> tuple[object, object]:
        return alignment.flanks, alignment.skim_counts

    assert left(observed(READ, drives_on=True, homed=False, at="08:50")) == NOTHING
    assert left(handed_over(READ, "08:50")) == NOTHING
    # Another number of jaws is another jaw 1; another blank has another surface.
    assert left(clamped(READ, replace(JOB, jaws=2), "08:50")) == NOTHING
    assert left(clamped(READ, JOB, "08:50")) == (READ.flanks, None)
    assert left(unclamped(READ, "08:50")) == (READ.flanks, None)
    # One at a time, the newest first.
    assert left(without_reading(READ)) == ((352.0,), 250_000.0)
    assert left(without_reading(replace(READ, flanks=()))) == NOTHING


def test_the_skimmed_diameter_gives_the_tip_wherever_the_tool_is_by_then(homed: Floor) -> None:
    homed.do(TakeJaw())
    homed.do(NoteSkim())
    assert codes(homed) == ["alignment.beside_part"]
    homed.do(TakeTouchOff(radius_mm=25.97, skimmed=True))
    assert codes(homed) == ["alignment.no_skim"]
    homed.do(Approach(job=experiment_1()))
    seen = homed.idle().seen
    assert seen is not None and seen.tool_gap_mm is not None
    homed.infeed(min(seen.tool_gap_mm, 1.0))
    seen = homed.idle().seen
    assert seen is not None and seen.tool_gap_mm is not None
    tip_mm = 26.0 + seen.tool_gap_mm
    noted = homed.do(NoteSkim()).alignment.skim_counts
    assert noted is not None
    homed.do(Jog(axis=AxisName.TOOL, distance=-1.0))
    homed.do(TakeTouchOff(radius_mm=tip_mm, skimmed=True))
    touched = homed.state.alignment.touch_off
    assert codes(homed) == [] and touched is not None and touched.skimmed
    assert touched.zero_radius_mm == pytest.approx(tip_mm + noted / 5000.0)
    assert homed.state.alignment.skim_counts is None
    # Beyond 1.5 mm of the profile it is a slip of the finger.
    homed.do(Jog(axis=AxisName.TOOL, distance=1.0))
    homed.do(NoteSkim())
    homed.do(TakeTouchOff(radius_mm=tip_mm + 2.0, skimmed=True))
    assert codes(homed) == ["alignment.touch_off_far"]
