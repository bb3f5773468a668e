"""Jaw 1 by its flanks, the touch-off by a skim cut, and typed targets: what is taken, and what refuses it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from console.session.cut.alignment import (
    Alignment,
    MountedEquipment,
    TouchOff,
    clamp_blank,
    clamping_of,
    handed_over,
    observe_poll,
    unclamp_blank,
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
    DisableDrives,
    EnableDrives,
    Forget,
    GoTo,
    Home,
    Jog,
    NoteSkim,
    TakeFlank,
    TakeJaw,
    TakeTouchOff,
)
from console.session.station.jogging import speed_problem
from console.session.station.state import Activity
from console.session.station.targets import distance_to, target_problems, target_range, travel_of
from drivers.lathe.snapshot import AxisName, Snapshot
from profiles.machine import MachineProfile
from profiles.store import load_job, load_machine
from tests.console.floor import Floor, experiment_1, known, open_floor
from tests.tui.stage import ON, look_at

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
    refused = known(spread_problem(far, expected))
    assert (refused.value, refused.limit) == ("1.60°", "<= 1.39°")
    assert spread_problem(far, None) is None
    few = known(spread_problem(near[:5], expected))
    assert few.code == "alignment.flanks_incomplete"


@pytest.fixture
def homed(tmp_path: Path) -> Floor:
    floor = open_floor(tmp_path)
    floor.do(ConfirmClamping(job=experiment_1()), EnableDrives(), Home())
    return floor


def turn_to_deg(floor: Floor, past_mark_deg: float) -> None:
    """Turn until the jaw is so far past the mark, as an indicator there would be brought to a flank."""
    for _ in range(2):
        seen = known(floor.idle().seen)
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
    jaw = known(homed.state.alignment.jaw)
    assert jaw.spread_deg == pytest.approx(0.3, abs=0.1)
    assert homed.state.alignment.flanks == ()
    # The middle of all is where the jaw meets the mark: a third of a tenth of a degree further on.
    turn_to_deg(homed, 0.0)
    snapshot = known(homed.state.snapshot)
    mark_deg = 360.0 * (snapshot.spindle.position / 10_000.0 % 1.0)
    assert (jaw.angle_deg - mark_deg + 180.0) % 360.0 - 180.0 == pytest.approx(0.03, abs=0.08)


def test_a_reading_is_dropped_by_one_key(homed: Floor) -> None:
    turn_to_deg(homed, -FLANK_DEG)
    homed.do(TakeFlank(), TakeFlank())
    assert codes(homed) == ["alignment.flanks_apart"]
    homed.do(TakeJaw())
    assert codes(homed) == ["alignment.flanks_incomplete"]
    assert len(homed.do(Forget()).alignment.flanks) == 0


READ = Alignment(homed=True, flanks=(352.0, 8.0), skim_counts=250_000.0, clamping=clamping_of(JOB, at="08:40"))
NOTHING = ((), None)


def test_readings_end_with_what_they_rest_on() -> None:
    def left(alignment: Alignment) -> tuple[object, object]:
        return alignment.flanks, alignment.skim_counts

    assert left(observe_poll(READ, drives_on=True, homed=False, at="08:50")) == NOTHING
    assert left(handed_over(READ, "08:50")) == NOTHING
    # Another number of jaws is another jaw 1; another blank has another surface.
    assert left(clamp_blank(READ, replace(JOB, jaws=2), "08:50")) == NOTHING
    assert left(clamp_blank(READ, JOB, "08:50")) == (READ.flanks, None)
    assert left(unclamp_blank(READ, "08:50")) == (READ.flanks, None)
    # One at a time, the newest first.
    assert left(without_reading(READ)) == ((352.0,), 250_000.0)
    assert left(without_reading(replace(READ, flanks=()))) == NOTHING


def test_the_skimmed_diameter_gives_the_tip_wherever_the_tool_is_by_then(homed: Floor) -> None:
    homed.do(TakeJaw(), NoteSkim())
    assert codes(homed) == ["alignment.beside_part"]
    homed.do(TakeTouchOff(radius_mm=25.97, skimmed=True))
    assert codes(homed) == ["alignment.no_skim"]
    homed.do(Approach(job=experiment_1()))
    seen = known(homed.idle().seen)
    assert seen.tool_gap_mm is not None
    homed.infeed(min(seen.tool_gap_mm, 1.0))
    seen = known(homed.idle().seen)
    assert seen.tool_gap_mm is not None
    tip_mm = 26.0 + seen.tool_gap_mm
    noted = known(homed.do(NoteSkim()).alignment.skim_counts)
    homed.do(Jog(axis=AxisName.TOOL, distance=-1.0), TakeTouchOff(radius_mm=tip_mm, skimmed=True))
    touched = homed.state.alignment.touch_off
    assert codes(homed) == [] and touched is not None and touched.skimmed
    assert touched.zero_radius_mm == pytest.approx(tip_mm + noted / 5000.0)
    assert homed.state.alignment.skim_counts is None
    # Beyond 1.5 mm of the profile it is a slip of the finger.
    homed.do(Jog(axis=AxisName.TOOL, distance=1.0), NoteSkim(), TakeTouchOff(radius_mm=tip_mm + 2.0, skimmed=True))
    assert codes(homed) == ["alignment.touch_off_far"]


Z, C = AxisName.CARRIAGE, AxisName.SPINDLE
CLAMPED = Alignment(clamping=clamping_of(JOB, at="08:40"))
TOUCHED = replace(CLAMPED, touch_off=TouchOff(zero_radius_mm=76.0, diameter_mm=52.0, at="08:45"))


@pytest.fixture(scope="module")
def machine() -> MachineProfile:
    return load_machine("lee-2001-lathe").machine


def at(radius_mm: float, z_mm: float, spindle_counts: float = 0.0) -> Snapshot:
    """The machine with its tip at a radius: the zero is at 76 mm, 5000 counts/mm towards the work."""
    tool = 5000.0 * (76.0 - radius_mm)
    return look_at(ON, tool=tool, spindle=spindle_counts, carriage=1000.0 * z_mm)


def codes_of_target(*given: object) -> list[str]:
    return [problem.code for problem in target_problems(*given)]  # type: ignore[arg-type]


def test_z_ends_before_the_jaws_and_c_at_a_turn(machine: MachineProfile) -> None:
    # Jaw faces at 200 mm, and what the profile keeps clear of them; the lower end is that of the travel.
    low, high = target_range(machine, Z)
    assert (low, high) == (machine.carriage.travel_min_mm, 200.0 - machine.carriage.jaw_clearance_mm)
    assert target_range(machine, C) == (0.0, 360.0)
    away = at(60.0, 10.0)
    assert codes_of_target(away, machine, TOUCHED, Z, high + 0.001) == ["machine.target_out_of_range"]
    assert codes_of_target(away, machine, TOUCHED, Z, low - 0.001) == ["machine.target_out_of_range"]
    assert codes_of_target(away, machine, TOUCHED, C, 360.0) == ["machine.target_out_of_range"]
    assert codes_of_target(away, machine, TOUCHED, C, -0.01) == ["machine.target_out_of_range"]
    assert codes_of_target(away, machine, TOUCHED, Z, high) == []


@pytest.mark.parametrize(
    ("radius_mm", "z_mm", "axis", "target", "refused"),
    [
        (26.5, 10.0, Z, 165.0, False),  # to 5 mm before the face of the part, which is at 170 mm
        (26.5, 10.0, Z, 175.0, False),  # over it, clear by half a millimetre
        (26.1, 10.0, Z, 175.0, True),  # into it
        (25.0, 175.0, Z, 100.0, True),  # in it: it is jogged out first
        (26.1, 175.0, C, 90.0, True),
        (26.5, 175.0, C, 90.0, False),
        (25.0, 100.0, C, 90.0, False),  # beside it
    ],
)
def test_a_tool_at_the_part_is_jogged_away_first(
    machine: MachineProfile, radius_mm: float, z_mm: float, axis: AxisName, target: float, refused: bool
) -> None:
    expected = ["machine.tool_in_the_way"] if refused else []
    assert codes_of_target(at(radius_mm, z_mm), machine, TOUCHED, axis, target) == expected


def test_before_the_touch_off_the_tip_may_be_nearer_than_it_seems(machine: MachineProfile) -> None:
    # Clear by 0.5 mm, of which 1.5 are not known; it has to be clear by 0.2.
    (problem,) = target_problems(at(26.5, 10.0), machine, CLAMPED, Z, 175.0)
    assert (problem.code, problem.limit) == ("machine.tool_in_the_way", "1.7 mm")
    assert codes_of_target(at(28.0, 10.0), machine, CLAMPED, Z, 175.0) == []
    (problem,) = target_problems(
        at(26.5, 10.0), machine, replace(TOUCHED, on=MountedEquipment(tool="another")), Z, 175.0
    )
    assert (problem.code, problem.limit) == ("machine.tool_in_the_way", "1.7 mm"), (
        "the touch-off is another tool's"
    )


def test_while_nobody_knows_what_is_clamped_the_carriage_goes_away_alone(machine: MachineProfile) -> None:
    assert codes_of_target(at(60.0, 50.0), machine, Alignment(), Z, 51.0) == ["machine.nothing_clamped_known"]
    assert codes_of_target(at(60.0, 50.0), machine, Alignment(), Z, 10.0) == []


@pytest.mark.parametrize(
    ("counts", "target", "distance"),
    [(0.0, 90.0, 90.0), (0.0, 270.0, -90.0), (10_350.0, 0.0, -12.6), (-2500.0, 350.0, 80.0)],
)
def test_c_goes_the_shorter_way(machine: MachineProfile, counts: float, target: float, distance: float) -> None:
    assert distance_to(at(60.0, 0.0, counts), machine, C, target) == pytest.approx(distance)


def test_the_travel_bar_is_between_the_soft_limits(machine: MachineProfile) -> None:
    # I113 = 375000, I114 = -10000 counts of 0.2 um: -2 to 75 mm.
    travel = travel_of(at(26.0, 0.0), machine, AxisName.TOOL)
    assert (travel.low_mm, travel.high_mm, travel.at_mm) == (-2.0, 75.0, 50.0)
    assert travel.to_limit_mm == pytest.approx(25.0)
    assert travel.fraction == pytest.approx(52.0 / 77.0)
    assert travel_of(at(26.0, 0.0), machine, C).fraction is None


def test_what_is_faster_than_set_up_allows_is_refused_and_not_slowed_down(machine: MachineProfile) -> None:
    # 100 rpm and 10 mm/s by the profile; 2 m/min are allowed.
    assert speed_problem(machine, C, 180.0) is None
    assert speed_problem(machine, Z, 100.0) is None
    variables = {**machine.controller.variables, "I322": 40.0}
    fast = replace(machine, controller=replace(machine.controller, variables=variables))
    found = known(speed_problem(fast, Z, 100.0))
    assert (found.value, found.limit) == ("40.0 mm/s", "<= 33.3 mm/s")
    assert speed_problem(fast, Z, 0.1) is None
    assert codes_of_target(at(60.0, 10.0), fast, TOUCHED, Z, 100.0) == ["machine.setup_speed"]


def test_the_machine_goes_where_it_was_asked_to(tmp_path: Path) -> None:
    floor = open_floor(tmp_path)
    floor.do(EnableDrives())
    assert [each.code for each in floor.do(GoTo(axis=C, target=90.0)).refusals] == ["alignment.not_homed"]
    floor.do(Home())
    ends: list[float] = []
    floor.looks.append(lambda _: ends.append(floor.state.ends_s or 0.0))
    before_s = floor.sim.now_s()
    state = floor.do(GoTo(axis=C, target=90.0))
    assert (state.refusals, state.jogs, state.activity) == ((), 1, Activity.READY)
    assert state.snapshot is not None
    assert state.snapshot.spindle.position / (10_000.0 / 360.0) == pytest.approx(90.0, abs=0.05)
    # It took as long as was shown while it moved, and some moments to settle.
    assert 0.0 <= floor.sim.now_s() - max(ends) < 0.3 < max(ends) - before_s
    back = floor.do(GoTo(axis=Z, target=-1.0))
    assert back.snapshot is not None and back.jogs == 2
    assert back.snapshot.carriage.position == pytest.approx(-1000.0, abs=2.0)
    refused = floor.do(GoTo(axis=Z, target=10.0))
    assert [each.code for each in refused.refusals] == ["machine.nothing_clamped_known"]
    assert [each.code for each in floor.do(GoTo(axis=AxisName.TOOL, target=1.0)).refusals] == [
        "machine.no_target_axis"
    ]
    assert floor.do(Jog(axis=Z, distance=0.1)).jogs == 3
    floor.do(DisableDrives())
    assert [each.code for each in floor.do(GoTo(axis=C, target=0.0)).refusals] == ["alignment.drives_off"]


def test_the_first_homing_ends_within_the_time_that_was_told(tmp_path: Path) -> None:
    floor = open_floor(tmp_path)
    told: list[float | None] = []
    floor.do(EnableDrives())
    floor.looks.append(lambda _: told.append(floor.state.ends_s if floor.state.ends_at_most else None))
    floor.do(Home())
    latest_s = known(told[len(told) // 2])
    assert floor.context.clock.now_s() <= latest_s
