"""Collisions, near misses, and what can be seen at the lathe."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from console.school.training.lesson import Item
from console.session.station.commands import Approach, AskTruth, Jog, TakeJaw
from drivers.cutting.planning import Strategy, plan_cut
from drivers.lathe.snapshot import AxisName
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.collision import ClampedBlank, Collision, CollisionWatch, Track, clamp_job_blank
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.true_parameters import ideal
from drivers.simulator.plant.workshop_view import CollisionKind, WorkshopView
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.roundness import evaluate
from tests.console.floor import open_floor
from tests.drivers.conftest import Bench, JobMaker, TrueBenchMaker
from tests.school.test_debrief import JOB, Pupil, marks_of, part_lesson
from tests.school.test_lessons import homes

CYCLE_MS = 0.4427083730697632
PART = ClampedBlank(radius_mm=26.0, bore_mm=23.5, deepest_mm=24.8725, free_end_mm=170.0)
JAW_FACE_MM, JAW_OUTER_MM = 200.0, 70.0
TURNING = 1000 / 60_000 * CYCLE_MS
"""Turns in a servo cycle at 1000 rpm."""


def seen(
    radius_mm: float | list[float],
    z_mm: float | list[float],
    turning: float = TURNING,
    surface_mm: float = 26.0,
    part: ClampedBlank | None = PART,
) -> tuple[Collision, ...]:
    """What is found on a way of some samples, in blocks of eleven from time 0."""
    watch = CollisionWatch(JAW_FACE_MM, JAW_OUTER_MM)
    if part:
        watch.clamp(part, lambda turns, z: surface_mm)
    count = max(len(way) if isinstance(way, list) else 1 for way in (radius_mm, z_mm))
    count = max(count, 33)
    radii = radius_mm if isinstance(radius_mm, list) else [radius_mm] * count
    places = z_mm if isinstance(z_mm, list) else [z_mm] * count
    for start in range(0, count, 11):
        end = min(start + 11, count)
        watch.look(
            Track(
                radius_mm=radii[start:end],
                turns=[turning * n for n in range(start, end)],
                z_mm=places[start:end],
                end_ms=end * CYCLE_MS,
                cycle_ms=CYCLE_MS,
            )
        )
    return watch.found


def kinds(found: tuple[Collision, ...]) -> list[str]:
    return [collision.kind.value for collision in found]


@pytest.mark.parametrize(("gap_mm", "crashes"), [(0.01, False), (-0.04, False), (-0.06, True)])
def test_a_tip_pressed_into_a_standing_part_is_a_crash_and_a_touch_is_none(gap_mm: float, crashes: bool) -> None:
    assert kinds(seen(26.0 + gap_mm, 180.0, turning=0.0)) == (["standing_part"] if crashes else [])


def test_a_cut_at_a_feed_and_what_is_over_the_part_are_no_crash() -> None:
    assert seen(25.9, 180.0, turning=0.0, surface_mm=25.9) == ()
    # 0.1275 mm deep at 0.05 mm a turn, into the end face from the free end on.
    z_mm = (169.9 + np.arange(2000) * TURNING * 0.05).tolist()
    assert seen(25.8725, z_mm) == ()
    z_mm = (169.5 + np.arange(300) * 0.1).tolist()
    assert seen(26.5, z_mm) == ()
    assert seen(25.9, z_mm, surface_mm=25.9) == ()


def test_a_rapid_into_the_part_and_a_cut_too_deep_are_crashes() -> None:
    """10 mm/s at 1000 rpm are 0.6 mm a turn, 30 mm/s 1.8."""
    for speed_mm_per_s, found in ((10.0, []), (30.0, ["end_face"])):
        z_mm = (169.5 + np.arange(300) * CYCLE_MS / 1000 * speed_mm_per_s).tolist()
        assert kinds(seen(25.8725, z_mm)) == found
    radius_mm = (26.0 - np.arange(330) * 0.01).tolist()
    deep = seen(radius_mm, 180.0)
    # 0.01 mm in 0.0074 turns are more than 1 mm a turn.
    assert kinds(deep) == ["infeed", "too_deep", "through_wall"]
    assert [round(collision.radius_mm, 2) for collision in deep] == [25.82, 24.87, 23.49]


@pytest.mark.parametrize(("speed_mm_per_s", "crashes"), [(15.0, False), (18.0, True)])
def test_a_tool_that_goes_in_by_more_than_it_takes_a_turn_is_a_crash(speed_mm_per_s: float, crashes: bool) -> None:
    """1000 rpm are 16.7 turns a second, and so many mm/s at 1 mm a turn; 0.5 mm deep."""
    depth_mm = np.minimum(np.arange(330) * CYCLE_MS / 1000.0 * speed_mm_per_s, 0.5)
    assert kinds(seen((26.0 - depth_mm).tolist(), 180.0)) == (["infeed"] if crashes else [])


def test_however_fast_the_tool_goes_in_to_its_cut_is_no_crash(experiment: JobMaker) -> None:
    """As the printed program does, and as lobes do each turn: 0.1275 mm is the cut, 0.05 mm is a touch."""
    part = clamp_job_blank(experiment(1), JAW_FACE_MM)
    for depth_mm, found in ((0.17, []), (0.19, ["infeed"])):
        radius_mm = [26.0] * 11 + [26.0 - depth_mm] * 33
        assert kinds(seen(radius_mm, 180.0, part=part)) == found


@pytest.mark.parametrize(("surface_mm", "crashes"), [(26.0, True), (25.9, False)])
def test_a_spindle_that_turns_backwards_in_the_part_is_a_crash(surface_mm: float, crashes: bool) -> None:
    found = seen([26.5] * 11 + [25.9] * 22, 180.0, turning=-TURNING, surface_mm=surface_mm)
    assert kinds(found) == (["reverse"] if crashes else [])


def test_it_is_said_where_and_when_it_began_and_once() -> None:
    """Also just before the index: the remainder of -1e-20 is 1.0."""
    (found,) = seen(25.0, 180.0, turning=-1e-20)
    assert found.angle_deg < 360.0
    radius_mm = [27.0] * 20 + [25.0] * 300 + [27.0] * 50 + [25.0] * 50
    (found,) = seen(radius_mm, 180.0, turning=1e-6)
    assert (found.kind, found.radius_mm, found.z_mm) == (CollisionKind.STANDING_PART, 25.0, 180.0)
    assert found.time_ms == pytest.approx(21 * CYCLE_MS)
    assert found.angle_deg == pytest.approx(360 * 20e-6)


@pytest.mark.parametrize(
    ("radius_mm", "z_mm", "crashes"),
    [(70.0, 200.01, True), (26.5, 200.01, True), (70.1, 205.0, False), (26.5, 200.0, False)],
)
@pytest.mark.parametrize("part", [PART, None])
def test_the_tip_may_not_be_where_the_jaws_turn(
    radius_mm: float, z_mm: float, crashes: bool, part: ClampedBlank | None
) -> None:
    assert kinds(seen(radius_mm, z_mm, part=part)) == (["jaws"] if crashes else [])


@pytest.mark.parametrize("z_mm", [169.9, 200.1])
def test_beside_the_part_there_is_nothing_to_run_into(z_mm: float) -> None:
    watch_out_for_jaws = {"jaws"} if z_mm > JAW_FACE_MM else set()
    assert set(kinds(seen(20.0, z_mm, turning=0.0))) == watch_out_for_jaws


def test_another_blank_has_met_nothing(machine: MachineProfile, experiment: JobMaker) -> None:
    watch = CollisionWatch(JAW_FACE_MM, JAW_OUTER_MM)
    watch.clamp(PART, lambda turns, z: 26.0)
    track = Track(radius_mm=[20.0], turns=[0.0], z_mm=[180.0], end_ms=1.0, cycle_ms=CYCLE_MS)
    watch.look(track)
    assert len(watch.found) > 0
    watch.clamp(PART, lambda turns, z: 26.0)
    assert watch.found == ()
    watch.release()
    watch.look(track)
    assert watch.found == ()


def homed(bench: Bench) -> Bench:
    bench.lathe.enable()
    bench.lathe.home()
    return bench


@pytest.mark.parametrize(("strategy", "number"), [*((each, 1) for each in Strategy), (Strategy.PVT, 2)])
@pytest.mark.first(1)
def test_a_planned_cut_meets_nothing(
    bench: Bench, machine: MachineProfile, experiment: JobMaker, strategy: Strategy, number: int
) -> None:
    """The first from end to end; else its end, as near to the jaws as it comes; of the second the ways."""
    job = experiment(number)
    if strategy is not Strategy.PVT or number != 1:
        job = replace(job, cut_length_mm=0.5, overhang_mm=job.overhang_mm - job.cut_length_mm + 0.5)
    homed(bench).sim.mount(job)
    plan = plan_cut(job, machine, strategy)
    bench.cut(plan)
    assert bench.sim.collisions == ()
    assert bench.sim.look().collisions == ()


def printed_program() -> list[str]:
    """Prog. 1 as it is quoted, without its comments."""
    document = Path(__file__).parents[2] / "docs/paper-program.md"
    section = document.read_text(encoding="utf-8").split("\n## The printed program\n", 1)[1]
    text = re.split(r"^```\w*\n", section, maxsplit=2, flags=re.MULTILINE)[1]
    code = [line.split(";")[0].strip() for line in text.splitlines()]
    return [line for line in code if line and line.isascii()]


def test_the_last_line_of_the_printed_program_is_a_crash(bench: Bench, experiment: JobMaker) -> None:
    """`x10000` of 0.2 um in INC is 2 mm further in, where 0.1 to 0.155 mm are cut already; the wall is 2.5 mm.

    It takes 0.2 s, and the spindle, which is not in that line, stands for most of them. The iron goes on as it is
    commanded.
    """
    homed(bench).sim.mount(experiment(1))
    bench.carriage_to(174_000.0)
    bench.lathe.jog_to(AxisName.TOOL, (76.0 - 26.0) * 5000.0)
    bench.client.download(printed_program())
    bench.client.request("&1B1R")
    bench.sim.wait(2.0)
    assert bench.sim.controller.systems[1].running
    assert kinds(bench.sim.collisions) == []
    bench.client.request("M26=1")
    bench.settle()
    assert kinds(bench.sim.collisions) == ["standing_part", "too_deep"]
    assert bench.sim.look().collisions == ("standing_part", "too_deep")
    plunge = bench.sim.collisions[-1]
    assert plunge.radius_mm == pytest.approx(24.8725, abs=0.05)
    assert plunge.z_mm == pytest.approx(174.0, abs=1e-6)
    assert 0.0 <= plunge.angle_deg < 360.0
    assert 2000.0 < plunge.time_ms < bench.sim.now_s() * 1000.0
    depth_mm = (bench.number("#1P") - 250_000.0) / 5000.0
    assert 2.09 < depth_mm < 2.17


def test_a_carriage_that_is_let_past_the_jaw_faces_is_seen(bench: Bench) -> None:
    """Without its limits, I313 and the plan; the tool is 30 mm from the axis, the jaws reach to 70 mm."""
    homed(bench).client.request("I313=0")
    bench.lathe.jog_to(AxisName.TOOL, (76.0 - 30.0) * 5000.0)
    bench.carriage_to(198_000.0)
    bench.lathe.jog_to(AxisName.CARRIAGE, 201_000.0)
    (met,) = bench.sim.collisions
    assert met.kind is CollisionKind.JAWS
    assert met.z_mm == pytest.approx(200.0, abs=0.01)
    assert met.radius_mm == pytest.approx(30.0, abs=0.01)


def test_a_spindle_that_runs_out_in_its_cut_is_no_crash(
    machine: MachineProfile, experiment: JobMaker, bench_with: TrueBenchMaker
) -> None:
    """Control-K in the cut: the tool stays where it has cut."""
    bench = homed(bench_with(replace(ideal(machine), ideal_spindle=False)))
    job = replace(experiment(1), cut_length_mm=1.0)
    bench.sim.mount(job)
    plan = plan_cut(job, machine, Strategy.PVT)
    bench.begin(plan)
    bench.sim.wait(0.6 * plan.duration_s)
    assert bench.sim.look().tool_gap_mm is not None
    bench.port.receive(b"\x0b")
    bench.sim.wait(10.0)
    assert bench.sim.collisions == ()


def test_the_lathe_itself_has_met_nothing_at_first(machine: MachineProfile) -> None:
    assert SimulatedLathe(machine).collisions == ()


# Near misses: how near the tool came to the jaws, and how fast it met a part that stood.

NEAR_CYCLE_MS = 0.5


def watch() -> CollisionWatch:
    made = CollisionWatch(JAW_FACE_MM, JAW_OUTER_MM)
    made.clamp(PART, lambda turns, z_mm: 25.98)
    return made


def goes(made: CollisionWatch, *radius_mm: float, turning: float = 0.0, z_mm: float = 180.0) -> None:
    """Pass along a path as the workshop does."""
    turns = [turning * at for at in range(len(radius_mm))]
    track = Track(list(radius_mm), turns, [z_mm] * len(radius_mm), 10.0, NEAR_CYCLE_MS)
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
def test_the_distance_to_the_jaws_is_to_their_face(radius_mm: float, z_mm: float, distance_mm: float) -> None:
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
    assert made.contact_mm_per_s == pytest.approx(0.015 / (NEAR_CYCLE_MS / 1000.0))
    goes(made, 25.9)
    assert made.contact_mm_per_s == pytest.approx(30.0), "it was in contact already"
    goes(made, 26.3)
    goes(made, 25.97)
    assert made.contact_mm_per_s == pytest.approx(0.33 / (NEAR_CYCLE_MS / 1000.0)), "another contact, a faster one"


def test_a_tool_that_cuts_a_turning_part_meets_nothing_that_stands() -> None:
    made = watch()
    goes(made, 26.1, 25.95, 25.9, turning=0.008)
    goes(made, 25.9, 25.89)
    assert made.contact_mm_per_s is None


@pytest.mark.parametrize(("step_mm", "costs"), [(0.1, True), (0.005, False)])
def test_a_touch_costs_points_in_great_steps_alone(step_mm: float, costs: bool, tmp_path: Path) -> None:
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


# Looking at the chuck: what an operator sees there is the iron, whatever the controller calls zero.

COUNTS_PER_DEG = 10_000 / 360
TOOL_COUNTS_PER_MM = 5000
CARRIAGE_COUNTS_PER_MM = 1000
SETTLED_MM = 0.0021
"""A jog is done within 4 counts of 0.2 um; the slow integrator brings the rest later. What is seen is rounded."""

IN_THE_PART_MM = 174.0
"""Z in the middle of the cut of experiment 1: the part stands from 170 to 200 mm."""


def tool_at(bench: Bench, radius_mm: float, z_mm: float, home_radius_mm: float = 76.0) -> WorkshopView:
    """Jog the tool tip, carriage first, four times as fast as an operator would, and look."""
    bench.carriage_to(z_mm * CARRIAGE_COUNTS_PER_MM)
    usual = bench.lathe.machine.controller.variables["I122"]
    bench.client.request(f"I122={4 * usual}")
    bench.lathe.jog_to(AxisName.TOOL, (home_radius_mm - radius_mm) * TOOL_COUNTS_PER_MM)
    bench.client.request(f"I122={usual}")
    return bench.sim.look()


def cut(bench: Bench, job: Job, machine: MachineProfile) -> None:
    bench.cut(plan_cut(job, machine, Strategy.NONE))


def test_before_homing_the_chuck_is_as_left(machine: MachineProfile, bench_with: TrueBenchMaker) -> None:
    """The spindle was left at 0.3457 turns, 124.45 deg, and the card calls that 0."""
    bench = bench_with(replace(ideal(machine), jaw_1_deg=100.0, spindle_start_turns=0.3457))
    assert bench.number("#2P") == 0
    assert bench.sim.look() == WorkshopView(jaw_1_past_mark_deg=24.45, tool_gap_mm=None)


def test_jaw_1_meets_the_mark_at_its_true_angle(machine: MachineProfile, bench_with: TrueBenchMaker) -> None:
    bench = homed(bench_with(replace(ideal(machine), jaw_1_deg=216.54)))
    bench.lathe.jog_to(AxisName.SPINDLE, round(216.54 * COUNTS_PER_DEG))
    assert bench.sim.look().jaw_1_past_mark_deg == 0.0
    bench.lathe.jog_to(AxisName.SPINDLE, round((216.54 + 10 * 360 + 9.0) * COUNTS_PER_DEG))
    assert bench.sim.look().jaw_1_past_mark_deg == 9.0


def test_the_angle_is_the_shorter_way_round(machine: MachineProfile, bench_with: TrueBenchMaker) -> None:
    expected = {-180.0: 180.0, -90.0: -90.0, 90.0: 90.0, 180.0: 180.0, 180.36: -179.64, 270.0: -90.0, 720.0: 0.0}
    bench, seen = homed(bench_with(replace(ideal(machine), jaw_1_deg=0.0))), {}
    for spindle_deg in expected:
        bench.lathe.jog_to(AxisName.SPINDLE, round(spindle_deg * COUNTS_PER_DEG))
        seen[spindle_deg] = bench.sim.look().jaw_1_past_mark_deg
    assert seen == expected


def test_a_chuck_that_is_mounted_as_the_job_says_is_seen_there(bench: Bench, experiment: JobMaker) -> None:
    homed(bench).sim.mount(replace(experiment(1), lobe_phase_deg=36.0))
    bench.lathe.jog_to(AxisName.SPINDLE, 1000)
    assert bench.sim.look().jaw_1_past_mark_deg == 0.0


def test_the_gap_is_between_the_tip_and_the_blank(bench: Bench, experiment: JobMaker) -> None:
    homed(bench).sim.mount(experiment(1))
    assert tool_at(bench, 30.0, IN_THE_PART_MM).tool_gap_mm == pytest.approx(4.0, abs=SETTLED_MM)
    bench.lathe.jog_to(AxisName.TOOL, (76.0 - 26.0) * TOOL_COUNTS_PER_MM)
    assert bench.sim.look().tool_gap_mm == pytest.approx(0.0, abs=SETTLED_MM)
    bench.lathe.jog_to(AxisName.TOOL, (76.0 - 25.5) * TOOL_COUNTS_PER_MM)
    assert bench.sim.look().tool_gap_mm == pytest.approx(-0.5, abs=SETTLED_MM)


def test_a_gap_is_seen_only_in_front_of_the_part(bench: Bench, experiment: JobMaker) -> None:
    """30 mm in front of the jaw faces at 200 mm; the carriage is let go further than its limit of 199 mm."""
    homed(bench).sim.mount(experiment(1))
    bench.client.request("I313=0")
    seen = {z_mm: tool_at(bench, 30.0, z_mm).tool_gap_mm is not None for z_mm in (169.9, 170.1, 199.0, 200.1)}
    assert seen == {169.9: False, 170.1: True, 199.0: True, 200.1: False}


def test_without_a_part_there_is_no_gap(bench: Bench) -> None:
    assert tool_at(homed(bench), 30.0, IN_THE_PART_MM).tool_gap_mm is None


def test_a_moved_tool_is_seen(machine: MachineProfile, bench_with: TrueBenchMaker, experiment: JobMaker) -> None:
    bench = homed(bench_with(replace(ideal(machine), home_radius_mm=76.217)))
    bench.sim.mount(experiment(1))
    assert tool_at(bench, 26.5, IN_THE_PART_MM).tool_gap_mm == pytest.approx(0.717, abs=SETTLED_MM)


def test_what_is_seen_does_not_change_when_the_card_forgets_its_zeros(bench: Bench, experiment: JobMaker) -> None:
    homed(bench).sim.mount(experiment(1))
    seen = tool_at(bench, 26.3, IN_THE_PART_MM)
    bench.raw("$$$\r")
    bench.lathe.connect()
    # Killed, the tool runs out a little.
    assert bench.number("#1P") == pytest.approx(0, abs=10)
    assert bench.number("#3P") == 0
    again = bench.sim.look()
    assert again.jaw_1_past_mark_deg == seen.jaw_1_past_mark_deg
    assert again.tool_gap_mm == pytest.approx(seen.tool_gap_mm, abs=2 * SETTLED_MM)


def test_where_it_was_cut_the_gap_is_new(bench: Bench, machine: MachineProfile, experiment: JobMaker) -> None:
    """0.1 mm off, over 2 mm from the free end at 170 mm; behind that the blank still stands."""
    job = replace(experiment(1), cut_length_mm=2.0)
    homed(bench).sim.mount(job)
    cut(bench, job, machine)
    spindle_counts = bench.number("#2P")
    for z_mm in (170.3, 171.0, 171.7):
        for ahead_counts in (1234, 5678):
            bench.lathe.jog_to(AxisName.SPINDLE, spindle_counts + ahead_counts)
            assert tool_at(bench, 28.0, z_mm).tool_gap_mm == pytest.approx(2.1, abs=SETTLED_MM)
    assert tool_at(bench, 28.0, 174.0).tool_gap_mm == pytest.approx(2.0, abs=SETTLED_MM)
    bench.sim.mount(job)
    assert tool_at(bench, 28.0, 171.0).tool_gap_mm == pytest.approx(2.0, abs=SETTLED_MM)


def test_a_tool_in_a_part_that_stands_still_has_not_cut_it(bench: Bench, experiment: JobMaker) -> None:
    homed(bench).sim.mount(experiment(1))
    assert tool_at(bench, 25.8, IN_THE_PART_MM).tool_gap_mm == pytest.approx(-0.2, abs=SETTLED_MM)
    assert tool_at(bench, 27.0, IN_THE_PART_MM).tool_gap_mm == pytest.approx(1.0, abs=SETTLED_MM)


def test_a_part_is_high_where_the_jaws_really_are(
    machine: MachineProfile, bench_with: TrueBenchMaker, experiment: JobMaker
) -> None:
    bench = bench_with(replace(ideal(machine), jaw_1_deg=47.0))
    bench.sim.mount(experiment(1))
    trace = bench.sim.measure()
    result = evaluate(trace.angle_deg, trace.deviation_um, None)
    phase_deg = next(h.phase_deg for h in result.harmonics if h.n == 3)
    assert np.cos(np.radians(3 * (phase_deg - 47.0))) == pytest.approx(1)


def test_a_lathe_set_up_by_hand_is_off_in_angle_and_tip_and_has_inertia(machine: MachineProfile) -> None:
    nominal = replace(ideal(machine), ideal_spindle=False)
    angles, tips = [], []
    for seed in range(300):
        true = plant_named("mounted", machine, seed)
        assert true.jaw_1_deg is not None
        assert None not in (true.tool_ends_mm, true.carriage_ends_mm)
        found = replace(true, jaw_1_deg=None, home_radius_mm=nominal.home_radius_mm)
        assert replace(found, tool_ends_mm=None, carriage_ends_mm=None, seed=0) == nominal
        angles.append(true.jaw_1_deg)
        tips.append(true.home_radius_mm - nominal.home_radius_mm)
    assert 0 <= min(angles) < 10
    assert 350 < max(angles) < 360
    assert -0.3001 < min(tips) < -0.27
    assert 0.27 < max(tips) < 0.3001
    assert all(value == round(value, 2) for value in angles)
    assert plant_named("mounted", machine, 7) == plant_named("mounted", machine, 7)
    assert plant_named("mounted", machine).jaw_1_deg is not None
