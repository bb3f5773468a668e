"""Near misses: how near the tool came to the jaws, and how fast it met a part that stood."""

from __future__ import annotations

from pathlib import Path

import pytest

from console.school.training.lesson import Item
from console.session.station.commands import Approach, AskTruth, Jog, TakeJaw
from drivers.lathe.snapshot import AxisName
from drivers.simulator.plant.collision import ClampedBlank, CollisionWatch, Track
from tests.console.floor import open_floor
from tests.school.test_debrief import JOB, Pupil, marks_of, part_lesson
from tests.school.test_lessons import homes

CYCLE_MS = 0.5
JAW_FACE_MM, JAW_OUTER_MM = 200.0, 70.0
PART = ClampedBlank(radius_mm=26.0, bore_mm=23.5, deepest_mm=24.8725, free_end_mm=170.0)


def watch() -> CollisionWatch:
    made = CollisionWatch(JAW_FACE_MM, JAW_OUTER_MM)
    made.clamp(PART, lambda turns, z_mm: 25.98)
    return made


def goes(made: CollisionWatch, *radius_mm: float, turning: float = 0.0, z_mm: float = 180.0) -> None:
    """Pass along a path as the workshop does."""
    turns = [turning * at for at in range(len(radius_mm))]
    track = Track(list(radius_mm), turns, [z_mm] * len(radius_mm), 10.0, CYCLE_MS)
    if made.misses(min(radius_mm), z_mm):
        made.pass_by(track)
    else:
        made.look(track)


@pytest.mark.parametrize(
    ("radius_mm", "z_mm", "distance_mm"),
    [
        (30.0, 188.0, 12.0),  # before the jaws
        (75.0, 210.0, 5.0),  # outside of them
        (73.0, 196.0, 5.0),  # off their edge: 3, 4, 5
        (30.0, 203.0, -3.0),  # in them: a collision
    ],
)
def test_the_distance_to_the_jaws_is_to_their_face_or_circumference(
    radius_mm: float, z_mm: float, distance_mm: float
) -> None:
    made = watch()
    goes(made, 76.0, z_mm=-5.0)
    goes(made, radius_mm, z_mm=z_mm)
    goes(made, 76.0, z_mm=-5.0)
    assert made.nearest_jaws_mm == pytest.approx(distance_mm)


def test_the_speed_is_that_of_the_cycle_in_which_the_tip_comes_through_the_surface() -> None:
    made = watch()
    goes(made, 26.5, 26.05, 26.0)
    assert made.contact_mm_per_s is None, "not at the surface yet"
    goes(made, 25.99, 25.975, 25.974)
    assert made.contact_mm_per_s == pytest.approx(0.015 / (CYCLE_MS / 1000.0))
    goes(made, 25.9)
    assert made.contact_mm_per_s == pytest.approx(30.0), "it was in contact already"
    goes(made, 26.3)
    goes(made, 25.97)
    assert made.contact_mm_per_s == pytest.approx(0.33 / (CYCLE_MS / 1000.0)), "another contact, a faster one"


def test_a_tool_that_cuts_a_turning_part_meets_nothing_that_stands() -> None:
    made = watch()
    goes(made, 26.1, 25.95, 25.9, turning=0.008)
    goes(made, 25.9, 25.89)
    assert made.contact_mm_per_s is None


@pytest.mark.parametrize(("step_mm", "costs"), [(0.1, True), (0.005, False)])
def test_a_touch_in_great_steps_costs_points_and_one_in_small_steps_none(
    step_mm: float, costs: bool, tmp_path: Path
) -> None:
    pupil = Pupil(open_floor(tmp_path), part_lesson())
    homes(pupil)
    pupil.floor.do(TakeJaw())
    pupil.floor.do(Approach(job=JOB))
    seen = pupil.floor.idle().seen
    assert seen is not None and seen.tool_gap_mm is not None
    pupil.floor.infeed(seen.tool_gap_mm - 0.5 * step_mm)
    pupil.floor.do(Jog(axis=AxisName.TOOL, distance=step_mm))
    assert not pupil.floor.state.refusals
    truth = pupil.floor.do(AskTruth()).truth
    assert truth is not None and truth.contact_mm_per_s is not None
    # The jaws of the compact lathe begin at 40 mm; the touch-off is before the cut, 8 mm and more away.
    assert truth.nearest_jaws_mm is not None and truth.nearest_jaws_mm > 8.0
    marks = marks_of(pupil.debriefed())
    assert marks[Item.NEAR] == 0.0 and (marks[Item.CONTACT] > 1.0) is costs
