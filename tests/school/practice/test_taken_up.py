"""A simulated lathe that is taken up where somebody left it: it stands there, aligned, and is cut on at once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from console.school.training.event import Event
from console.school.training.lesson import load_lesson
from console.session.errors import SessionError
from console.session.station.begins import Begins
from console.session.station.commands import Home, Measure, Start
from console.session.station.handlers import begin_as
from console.session.station.state import Activity
from drivers.cutting.planning import Strategy
from drivers.placed import Placed, placed_of, placed_text
from tests.console.floor import Floor, open_floor
from tests.school.test_debrief import JOB, Pupil


@pytest.fixture(scope="module")
def left(tmp_path_factory: pytest.TempPathFactory) -> Floor:
    """A lathe that somebody has set up."""
    floor = open_floor(tmp_path_factory.mktemp("left"), seed=4)
    floor.set_up(JOB)
    return floor


def taken(left: Floor, data: Path, seed: int) -> Floor:
    """Another lathe, placed as that one stands, with what was known of it."""
    state, machine = left.idle(), left.context.machine
    assert state.snapshot is not None and state.alignment.jaw is not None
    snapshot = state.snapshot
    axes = (
        snapshot.tool.position / machine.tool.counts_per_mm - 1.0,  # 1 mm off the part
        snapshot.carriage.position / machine.carriage.counts_per_mm,
        snapshot.spindle.position / machine.spindle.counts_per_rev,
    )
    jaw_1_deg, tip_mm = state.alignment.jaw.angle_deg, machine.tool.home_radius_mm
    placed = Placed(axes=axes, jaw_1_deg=jaw_1_deg, tip_radius_mm=tip_mm, job=JOB)
    sent = placed_of(placed_text(placed))
    assert sent == placed
    return open_floor(data, seed, placed=sent, begins=Begins(alignment=state.alignment, drives_on=True))


@pytest.mark.parametrize("seed", [4, 9])
def test_it_stands_where_it_was_left_with_what_was_known(seed: int, left: Floor, tmp_path: Path) -> None:
    floor = taken(left, tmp_path, seed)
    state, before = floor.idle(), left.state
    assert state.activity is Activity.READY and not state.alarms and not state.refusals
    assert state.alignment == replace(before.alignment, settings=())
    assert state.seen is not None and before.seen is not None
    assert state.seen.jaw_1_past_mark_deg == pytest.approx(before.seen.jaw_1_past_mark_deg, abs=0.05)
    assert state.seen.tool_gap_mm == pytest.approx(1.0 + (before.seen.tool_gap_mm or 0.0), abs=0.002)
    assert state.seen.collisions == ()


def test_a_part_is_cut_on_it_and_homing_again_finds_the_same_zeros(left: Floor, tmp_path: Path) -> None:
    floor = taken(left, tmp_path, 9)
    assert floor.arm(JOB, Strategy.PVT).armed is not None, floor.state.refusals
    floor.idle()
    floor.do(Start())
    measured = floor.do(Measure()).measured
    assert measured is not None and measured.result.ront_um < JOB.roundness_tolerance_um
    again = taken(left, tmp_path / "again", 9)
    again.do(Home())
    state = again.idle()
    assert state.snapshot is not None and left.state.alignment.jaw is not None
    # A zero that had been moved would show at once in what is seen of the chuck against what is reported.
    at = state.snapshot.spindle.position / again.context.machine.spindle.counts_per_rev * 360.0
    jaw_1_deg = left.state.alignment.jaw.angle_deg
    assert state.seen is not None
    off = (at - jaw_1_deg - state.seen.jaw_1_past_mark_deg + 180.0) % 360.0 - 180.0
    assert off == pytest.approx(0.0, abs=0.05)


def test_the_recorded_fault_comes_in_its_cut(left: Floor, tmp_path: Path) -> None:
    floor = taken(left, tmp_path, 9)
    event = Event(after="in_cut", wait_s=0.5, fault="following-error-trip motor=spindle")
    lesson = replace(load_lesson("drive-fails", tmp_path), steps=("in_cut", "stopped_in_cut"), events=(event,))
    pupil = Pupil(floor, lesson)
    floor.arm(replace(JOB, cut_length_mm=6.0), Strategy.PVT)
    floor.idle()
    floor.do(Start())
    assert [step for step, _ in pupil.tried.reached] == ["in_cut", "stopped_in_cut"]
    assert "machine.fault" in [alarm.problem.code for alarm in floor.state.alarms]


def test_a_machine_that_is_not_simulated_is_not_taken_up(left: Floor, tmp_path: Path) -> None:
    floor = open_floor(tmp_path)
    floor.context.shop = None
    with pytest.raises(SessionError):
        begin_as(floor.context, Begins(alignment=left.state.alignment, drives_on=True))
    assert floor.state.alignment.jaw is None and not floor.state.alignment.drives_on
