"""The overrun that the screen promises, against the trajectories of the controller's own jogs."""

from __future__ import annotations

from dataclasses import replace

import pytest

from console.session.cut.alignment import Alignment, MountedEquipment, TouchOff, clamping_of
from console.session.station.durations import jog_s
from console.session.station.jogging import (
    STEPS_DEG,
    STEPS_MM,
    Steps,
    is_too_long,
    longest_in_mm,
    longest_toward_mm,
    step_problem,
    stopping_distance,
    tool_in_part,
    tool_radius_mm,
)
from drivers.lathe.lengths import settings_of
from drivers.lathe.snapshot import AxisName, AxisState, Snapshot
from drivers.pmac.trajectory.jog import JogSettings, jog_to
from drivers.pmac.trajectory.pieces import Piece, position_at, velocity_at
from profiles.machine import MachineProfile
from profiles.store import load_job, load_machine

COUNTS_PER_UNIT = {AxisName.TOOL: 5000.0, AxisName.SPINDLE: 10000.0 / 360.0, AxisName.CARRIAGE: 1000.0}
MOTORS = {AxisName.TOOL: 1, AxisName.SPINDLE: 2, AxisName.CARRIAGE: 3}
LATE_MS = 55.0
"""5 ms of the controller's background work and 50 ms of the link."""

STEPS = [(axis, rung) for axis in AxisName for rung in range(len(STEPS_MM))]


@pytest.fixture(scope="module")
def machine() -> MachineProfile:
    return load_machine("lee-2001-lathe").machine


def with_variable(machine: MachineProfile, name: str, value: float) -> MachineProfile:
    variables = {**machine.controller.variables, name: value}
    return replace(machine, controller=replace(machine.controller, variables=variables))


def trajectory(machine: MachineProfile, axis: AxisName, step: float) -> tuple[Piece, ...]:
    given, motor = machine.controller.variables, MOTORS[axis]
    settings = JogSettings(
        acceleration=given[f"I{motor}19"],
        ta_ms=given[f"I{motor}20"],
        ts_ms=given[f"I{motor}21"],
        speed=given[f"I{motor}22"],
    )
    return jog_to(0.0, step * COUNTS_PER_UNIT[axis], settings)


def at(pieces: tuple[Piece, ...], t_ms: float) -> tuple[float, float]:
    """Position and velocity in counts and ms."""
    for piece in pieces:
        if t_ms <= piece.duration_ms:
            return position_at(piece.cubics[0], t_ms), velocity_at(piece.cubics[0], t_ms)
        t_ms -= piece.duration_ms
    return position_at(pieces[-1].cubics[0], pieces[-1].duration_ms), 0.0


def farthest(machine: MachineProfile, axis: AxisName, step: float) -> float:
    """The longest way on after a stop, of presses at a thousand moments of the step, mm or degrees."""
    pieces = trajectory(machine, axis, step)
    end_ms = sum(piece.duration_ms for piece in pieces)
    rate = machine.controller.variables[f"I{MOTORS[axis]}15"]
    worst = 0.0
    for n in range(1001):
        pressed_ms = end_ms * n / 1000.0
        position, velocity = at(pieces, pressed_ms + LATE_MS)
        worst = max(worst, position + velocity**2 / (2.0 * rate) - at(pieces, pressed_ms)[0])
    return worst / COUNTS_PER_UNIT[axis]


@pytest.mark.parametrize(("axis", "rung"), STEPS)
def test_no_step_goes_further_faster_or_longer_than_is_promised(
    machine: MachineProfile, axis: AxisName, rung: int
) -> None:
    """A stop in it may go beyond the step where the abort is soft, and is told so."""
    step = Steps(mm=rung, deg=rung).step_length(axis)
    for lathe in (machine, with_variable(machine, f"I{MOTORS[axis]}15", 0.01)):
        assert farthest(lathe, axis, step) <= stopping_distance(lathe, axis, step) + 1e-9
    pieces = trajectory(machine, axis, step)
    end_ms = sum(piece.duration_ms for piece in pieces)
    fastest = max(at(pieces, end_ms * n / 500.0)[1] for n in range(501))
    settings = settings_of(machine, axis)
    assert fastest * 1000.0 <= settings.step_speed(step) * settings.counts_per_unit + 1e-6
    assert jog_s(machine, axis, -step) == pytest.approx(end_ms / 1000.0)


def test_how_far_a_step_of_the_tool_runs_on(machine: MachineProfile) -> None:
    # 10 mm/s for 55 ms, then 50 counts/ms at 40 counts/ms2: 31 counts of 0.2 um.
    assert stopping_distance(machine, AxisName.TOOL, 10.0) == pytest.approx(0.550 + 0.00625)
    short_mm = stopping_distance(machine, AxisName.TOOL, 0.01)
    assert short_mm < 0.01 and stopping_distance(machine, AxisName.TOOL, -0.01) == short_mm
    # Without an abort rate nothing is promised.
    assert stopping_distance(with_variable(machine, "I115", 0.0), AxisName.TOOL, 0.001) == float("inf")


def test_the_ladder_of_steps_and_how_long_one_may_be() -> None:
    assert [Steps(mm=2, deg=2).step_length(axis) for axis in AxisName] == [0.1, 1.0, 0.1]
    assert len(STEPS_MM) == len(STEPS_DEG)
    assert [longest_in_mm(gap_mm) for gap_mm in (None, 2.5, -0.1)] == [1.0, 2.5, 0.01]
    assert (is_too_long(1.0, 0.9996), is_too_long(1.0, 0.9990)) == (False, True), "half a micrometre is nothing"


def over_the_part(tool_mm: float, carriage_mm: float) -> Snapshot:
    """Return a lathe at rest and homed, its tool and carriage so far from their homes."""
    spindle = AxisState(position=0.0, following_error=0.0, flags=frozenset({"home_complete"}))
    return Snapshot(
        asked_s=0.0,
        at_s=0.0,
        tool=replace(spindle, position=tool_mm * 5000.0),
        spindle=spindle,
        carriage=replace(spindle, position=carriage_mm * 1000.0),
        program_running=False,
        runtime_error=False,
    )


def clamped_ring(diameter_mm: float = 48.0) -> Alignment:
    """Return the set-up with a ring in the chuck and no touch-off."""
    job = load_job("lee-2001-experiment-1").job
    return Alignment(
        clamping=replace(clamping_of(job, at="08:40"), diameter_mm=diameter_mm, wall_thickness_mm=3.0)
    )


BESIDE_MM, OVER_MM = 0.0, 195.0  # of the carriage: far before the face of the part, and 5 mm before the jaws


def test_the_gap_is_known_by_the_touch_off_on_the_clamped_part(machine: MachineProfile) -> None:
    look, clamped = over_the_part(50.0, OVER_MM), clamped_ring(51.0)
    touched = replace(clamped, touch_off=TouchOff(zero_radius_mm=77.5, diameter_mm=52.0, at="08:45"))
    # R 27.5 mm before a part of R 25.5 mm.
    assert longest_toward_mm(look, machine, touched) == pytest.approx(2.0)
    assert longest_toward_mm(look, machine, replace(touched, clamping=None)) == 1.0
    assert longest_toward_mm(None, machine, touched) == 1.0


@pytest.mark.parametrize(
    ("gap_mm", "longest_mm"),
    [
        (5.0, 1.0),
        (2.5, 1.0),
        (2.0, 0.5),
        (1.55, 0.1),
        (1.0, 0.1),
        (0.0, 0.1),
        (-1.4, 0.1),
        (-1.45, 0.05),
        (-1.5, 0.0),
    ],
)
def test_steps_are_short_before_the_touch_off(machine: MachineProfile, gap_mm: float, longest_mm: float) -> None:
    # Home at R 76 mm, a ring of R 24 mm: its surface is within 1.5 mm of there, as the touch-off accepts it.
    look = over_the_part(76.0 - 24.0 - gap_mm, OVER_MM)
    assert longest_toward_mm(look, machine, clamped_ring()) == pytest.approx(longest_mm)


def test_before_the_touch_off_no_steps_lead_through_the_wall_of_the_ring(machine: MachineProfile) -> None:
    tool_mm, ring = 76.0 - 24.0 - 2.0, clamped_ring()  # where the approach leaves it
    for step_mm in (1.0, 0.1, 0.01):
        while step_problem(step_mm, over_the_part(tool_mm, OVER_MM), machine, ring) is None:
            tool_mm += step_mm
    assert 76.0 - tool_mm == pytest.approx(24.0 - 1.5)
    refused = step_problem(0.001, over_the_part(tool_mm, OVER_MM), machine, ring)
    assert refused is not None and refused.code == "machine.below_surface"
    assert refused.value == "1.500 mm", "and that is how far it stands below the surface of the ring"
    too_long = step_problem(1.0, over_the_part(51.0, OVER_MM), machine, ring)
    assert too_long is not None and (too_long.code, too_long.limit) == ("machine.step_too_long", "<= 0.100 mm")


def test_beside_the_part_and_with_an_empty_chuck_a_step_is_as_long_as_ever(machine: MachineProfile) -> None:
    deep = over_the_part(60.0, BESIDE_MM)
    assert longest_toward_mm(deep, machine, clamped_ring()) == 1.0
    assert longest_toward_mm(over_the_part(60.0, OVER_MM), machine, Alignment()) == 1.0


def test_a_touch_off_of_another_tool_does_not_tell_where_this_one_is(machine: MachineProfile) -> None:
    touched = TouchOff(zero_radius_mm=77.5, diameter_mm=48.0, at="08:45")
    ring = replace(clamped_ring(), touch_off=touched, on=MountedEquipment(tool="another"))
    assert longest_toward_mm(over_the_part(51.0, OVER_MM), machine, ring) == pytest.approx(0.1)
    # 0.3 mm from the surface by the profile, and a touch-off may find it 1.5 mm elsewhere.
    near = over_the_part(51.7, OVER_MM)
    assert tool_in_part(near, machine, ring) is None
    assert (
        tool_in_part(near, machine, replace(clamped_ring(), touch_off=replace(touched, zero_radius_mm=76.0)))
        is False
    )


def test_the_tool_radius_is_that_of_the_touch_off_and_a_long_jog_has_one_ramp(machine: MachineProfile) -> None:
    assert tool_radius_mm(250_000.0, machine, Alignment()) == pytest.approx(26.0)
    touched = Alignment(touch_off=TouchOff(zero_radius_mm=76.1, diameter_mm=52.0, at="08:45"))
    assert tool_radius_mm(250_000.0, machine, touched) == pytest.approx(26.1)
    # 100 mm at 10 mm/s, and once the acceleration time of 100 ms.
    assert jog_s(machine, AxisName.CARRIAGE, 100.0) == pytest.approx(10.1)
