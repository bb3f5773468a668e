"""What must not meet at the chuck: it is said once, with the place, the angle and the time where it began."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.cutting.planning import Strategy, plan_cut
from drivers.lathe.snapshot import AxisName
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.collision import (
    Clamped,
    Collision,
    CollisionWatch,
    Track,
    clamped,
)
from drivers.simulator.plant.true_parameters import ideal
from drivers.simulator.plant.workshop_view import CollisionKind
from profiles.machine import MachineProfile
from tests.drivers.conftest import Bench, JobMaker, TrueBenchMaker

CYCLE_MS = 0.4427083730697632
PART = Clamped(radius_mm=26.0, bore_mm=23.5, deepest_mm=24.8725, free_end_mm=170.0)
JAW_FACE_MM, JAW_OUTER_MM = 200.0, 70.0
TURNING = 1000 / 60_000 * CYCLE_MS
"""Turns in a servo cycle at 1000 rpm."""


def seen(
    radius_mm: float | list[float],
    z_mm: float | list[float],
    turning: float = TURNING,
    surface_mm: float = 26.0,
    part: Clamped | None = PART,
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
def test_a_tip_pressed_into_a_part_that_stands_is_a_crash_and_a_touch_is_none(
    gap_mm: float, crashes: bool
) -> None:
    assert kinds(seen(26.0 + gap_mm, 180.0, turning=0.0)) == (["standing_part"] if crashes else [])


def test_a_tip_that_stands_in_what_it_has_cut_is_no_crash() -> None:
    assert seen(25.9, 180.0, turning=0.0, surface_mm=25.9) == ()


def test_a_cut_at_a_feed_is_no_crash() -> None:
    """0.1275 mm deep at 0.05 mm a turn, into the end face from the free end on."""
    z_mm = (169.9 + np.arange(2000) * TURNING * 0.05).tolist()
    assert seen(25.8725, z_mm) == ()


def test_a_rapid_into_the_end_face_is_a_crash() -> None:
    """10 mm/s at 1000 rpm are 0.6 mm a turn, 30 mm/s 1.8."""
    for speed_mm_per_s, found in ((10.0, []), (30.0, ["end_face"])):
        z_mm = (169.5 + np.arange(300) * CYCLE_MS / 1000 * speed_mm_per_s).tolist()
        assert kinds(seen(25.8725, z_mm)) == found


def test_a_rapid_over_the_part_or_in_what_is_cut_is_none() -> None:
    z_mm = (169.5 + np.arange(300) * 0.1).tolist()
    assert seen(26.5, z_mm) == ()
    assert seen(25.9, z_mm, surface_mm=25.9) == ()


def test_deeper_than_the_tool_takes_and_through_the_wall_are_two_crashes() -> None:
    radius_mm = (26.0 - np.arange(330) * 0.01).tolist()
    found = seen(radius_mm, 180.0)
    # 0.01 mm in 0.0074 turns are more than 1 mm a turn.
    assert kinds(found) == ["infeed", "too_deep", "through_wall"]
    assert [round(collision.radius_mm, 2) for collision in found] == [25.82, 24.87, 23.49]


@pytest.mark.parametrize(("speed_mm_per_s", "crashes"), [(15.0, False), (18.0, True)])
def test_a_tool_that_goes_in_by_more_than_it_takes_a_turn_is_a_crash(speed_mm_per_s: float, crashes: bool) -> None:
    """1000 rpm are 16.7 turns a second, and so many mm/s at 1 mm a turn; 0.5 mm deep."""
    depth_mm = np.minimum(np.arange(330) * CYCLE_MS / 1000.0 * speed_mm_per_s, 0.5)
    assert kinds(seen((26.0 - depth_mm).tolist(), 180.0)) == (["infeed"] if crashes else [])


def test_however_fast_the_tool_goes_in_to_its_cut_is_no_crash(experiment: JobMaker) -> None:
    """As the printed program does, and as lobes do each turn: 0.1275 mm is the cut, 0.05 mm is a touch."""
    part = clamped(experiment(1), JAW_FACE_MM)
    for depth_mm, found in ((0.17, []), (0.19, ["infeed"])):
        radius_mm = [26.0] * 11 + [26.0 - depth_mm] * 33
        assert kinds(seen(radius_mm, 180.0, part=part)) == found


@pytest.mark.parametrize(("surface_mm", "crashes"), [(26.0, True), (25.9, False)])
def test_a_spindle_that_turns_backwards_in_the_part_is_a_crash(surface_mm: float, crashes: bool) -> None:
    found = seen([26.5] * 11 + [25.9] * 22, 180.0, turning=-TURNING, surface_mm=surface_mm)
    assert kinds(found) == (["reverse"] if crashes else [])


def test_an_angle_is_less_than_a_turn() -> None:
    """Also just before the index: the remainder of -1e-20 is 1.0."""
    (found,) = seen(25.0, 180.0, turning=-1e-20)
    assert found.angle_deg < 360.0


@pytest.mark.parametrize(
    ("radius_mm", "z_mm", "crashes"),
    [(70.0, 200.01, True), (26.5, 200.01, True), (70.1, 205.0, False), (26.5, 200.0, False)],
)
@pytest.mark.parametrize("part", [PART, None])
def test_the_tip_may_not_be_where_the_jaws_turn(
    radius_mm: float, z_mm: float, crashes: bool, part: Clamped | None
) -> None:
    assert kinds(seen(radius_mm, z_mm, part=part)) == (["jaws"] if crashes else [])


@pytest.mark.parametrize("z_mm", [169.9, 200.1])
def test_beside_the_part_there_is_nothing_to_run_into(z_mm: float) -> None:
    watch_out_for_jaws = {"jaws"} if z_mm > JAW_FACE_MM else set()
    assert set(kinds(seen(20.0, z_mm, turning=0.0))) == watch_out_for_jaws


def test_it_is_said_where_and_when_it_began_and_once() -> None:
    radius_mm = [27.0] * 20 + [25.0] * 300 + [27.0] * 50 + [25.0] * 50
    (found,) = seen(radius_mm, 180.0, turning=1e-6)
    assert (found.kind, found.radius_mm, found.z_mm) == (CollisionKind.STANDING_PART, 25.0, 180.0)
    assert found.time_ms == pytest.approx(21 * CYCLE_MS)
    assert found.angle_deg == pytest.approx(360 * 20e-6)


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
