"""A trim of the program: blended over a turn, put back beyond its bounds, bounded by every limit of the tool."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest

from drivers.cutting.bounds import UNTRIMMED, Trim
from drivers.cutting.live_trim import LiveTrim, trim_bounds, trimmed_path
from drivers.cutting.planning import Strategy, plan_cut
from drivers.pmac.programs.pvt import live_trim_line
from profiles.compensations.path import LobedPath, PathHarmonic, target_path
from tests.drivers.close_together import machine as machine
from tests.drivers.cut_floor import CutFloor, of_family, until

if TYPE_CHECKING:
    from profiles.machine import MachineProfile
    from tests.drivers.conftest import JobMaker


def in_part(experiment: JobMaker, machine: MachineProfile, rpm: float = 1000.0) -> CutFloor:
    job = replace(experiment(1), cut_length_mm=1.0, spindle_speed_rpm=rpm, lobe_spindle_speed_rpm=rpm)
    floor = CutFloor(job, machine, Strategy.PVT)
    floor.start()
    until(floor, lambda: floor.number("P30") >= 10.0)
    return floor


@pytest.mark.parametrize(
    ("family", "rpm"), [("pmac", 1000.0), pytest.param("turbo", 870.0, marks=pytest.mark.long)]
)
def test_a_trim_grows_over_a_turn_without_a_step(
    machine: MachineProfile, experiment: JobMaker, family: str, rpm: float
) -> None:
    """At 870 rpm a turn is no whole number of segments: what the rounding leaves comes with the next turns."""
    floor = in_part(experiment, of_family(machine, family), rpm)
    asked_at, turn_s = len(floor._recorders[1].positions), 60.0 / rpm
    floor.card.tell(live_trim_line(10.0, 0.0, 3))
    floor.card.sim.wait(5.0 * turn_s)
    assert floor.number("P55") == pytest.approx(1.1, abs=1e-6)
    floor.card.tell("M26=1")
    track = floor.finish()
    told, cycles = track.tool_told, turn_s * 1000.0 / machine.controller.servo_period_ms
    before = told[asked_at - int(4.0 * cycles) : asked_at]
    blend = told[asked_at : asked_at + int(4.0 * cycles)]
    # Twice the growth of a turn would be a step: 1.1 of the sinusoid has 1.1 of its acceleration.
    assert np.abs(np.diff(blend, 2)).max() < 1.15 * np.abs(np.diff(before, 2)).max()
    assert np.ptp(blend[-int(cycles) :]) == pytest.approx(1.1 * np.ptp(before[-int(cycles) :]), rel=0.002)


@pytest.mark.parametrize(("line", "back"), [("P53=1.2", (1.0, 0.0)), ("P53=1.05 P54=16", (1.0, 0.0))])
def test_what_is_beyond_the_bounds_is_put_back_whole(
    machine: MachineProfile, experiment: JobMaker, line: str, back: tuple[float, float]
) -> None:
    floor = in_part(experiment, machine)
    floor.card.tell(line)
    floor.card.sim.wait(0.15)
    assert tuple(floor.number(item) for item in ("P53", "P54", "P55", "P56")) == (*back, *back)


def test_a_path_is_trimmed_in_every_harmonic() -> None:
    path = LobedPath(
        mean_um=100.0,
        amplitude_um=20.0,
        lobes=3,
        phase_deg=10.0,
        overtones=(PathHarmonic(lobes=6, amplitude_um=2.0, phase_deg=5.0),),
    )
    trimmed = trimmed_path(path, Trim(gain_percent=10.0, phase_deg=0.5))
    angle = np.arange(0.0, 360.0, 7.0)
    # The mean is the depth of the cut: it stays.
    expected = 100.0 + 1.1 * (path.at_um(angle - 0.5) - 100.0)
    assert trimmed.at_um(angle) == pytest.approx(expected)
    assert trimmed_path(path, UNTRIMMED) == path


def test_no_line_asks_for_more_than_the_bounds() -> None:
    assert live_trim_line(2.0, 0.5, 3) == "P53=1.02 P54=-1.5"
    for gain, phase in ((10.1, 0.0), (0.0, -5.1), (float("nan"), 0.0)):
        with pytest.raises(ValueError):
            live_trim_line(gain, phase, 3)


def test_the_bound_is_the_last_percent_that_every_limit_allows(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    job = replace(experiment(1), cut_length_mm=1.0)
    plan = plan_cut(job, machine, Strategy.PVT)
    assert trim_bounds(plan, job, machine, 105) == (10, 5.0)
    peak = plan.checked.peak_velocity[machine.tool.motor]

    def limited_to(factor: float) -> MachineProfile:
        variables = {**machine.controller.variables, "I116": factor * peak}
        return replace(machine, controller=replace(machine.controller, variables=variables))

    assert trim_bounds(plan, job, limited_to(1.0455), 100) == (4, 5.0)
    assert trim_bounds(plan, job, limited_to(1.0955), 100) == (9, 5.0)
    assert trim_bounds(plan, job, limited_to(1.032), 100) == (3, 5.0)
    assert trim_bounds(plan, job, limited_to(1.0455), 104) == (0, 0.0)
    # 27.5 um of lobe in a cut of 29 um: 5 % more, and the tool would leave the part.
    thin = replace(job, depth_of_cut_mm=0.029)
    assert trim_bounds(plan, thin, machine, 100)[0] == 5
    for strategy in (Strategy.CAM, Strategy.PAPER, Strategy.NONE):
        assert trim_bounds(plan_cut(job, machine, strategy), job, machine, 100) == (0, 0.0)
    assert target_path(job).amplitude_um == 27.5


class Program:
    """What a program with three lobes has of its trim: asked for, and in its path."""

    def __init__(self) -> None:
        self.values = {"P53": 1.0, "P54": 0.0, "P55": 1.0, "P56": 0.0}

    def request(self, *_: object) -> list[str]:
        return []

    def numbers(self, *items: str, **_: object) -> list[float]:
        return [self.values[item] for item in items]


def trimmed_by(program: Program, trim: Trim) -> LiveTrim:
    free = SimpleNamespace(check=lambda: None, refuse_unless_owner=lambda: None)
    trimming = LiveTrim(cast(Any, program), cast(Any, free), cast(Any, free), 3, running=True)
    trimming.ask(trim)
    return trimming


@pytest.mark.parametrize(
    ("gain", "angle_deg", "told"),
    [
        (1.0, 0.0, False),  # not begun
        (1.05, -4.5, False),  # half of the way
        (1.1, -9.0, False),
        (1.11, -9.0, True),
        (0.99, -9.0, True),
        (1.05, -9.1, True),
        (1.05, 0.1, True),
    ],
)
def test_a_trim_in_the_path_that_is_not_on_the_way_to_that_asked_for_is_told(
    gain: float, angle_deg: float, told: bool
) -> None:
    """10 % and 3 degrees of the spindle later are asked for: -9 degrees of the angle of three lobes."""
    program = Program()
    trimming = trimmed_by(program, Trim(gain_percent=10.0, phase_deg=3.0))
    program.values |= {"P55": gain, "P56": angle_deg}
    assert [each.code for each in trimming.astray()] == ["cut.trim_differs"] * told


@pytest.mark.parametrize(
    ("gain", "angle_deg", "told"), [(1.1, -9.0, False), (1.09, -9.0, True), (1.1, -8.9, True)]
)
def test_a_trim_is_applied_when_it_is_in_the_path_and_told_when_another_is_asked_for(
    gain: float, angle_deg: float, told: bool
) -> None:
    program, asked = Program(), Trim(gain_percent=10.0, phase_deg=3.0)
    trimming = trimmed_by(program, asked)
    program.values |= {"P53": gain, "P54": angle_deg}
    trimming.read()
    assert (trimming.applied, trimming.problem is not None) == (UNTRIMMED, told)
    program.values |= {"P55": gain, "P56": angle_deg}
    trimming.read()
    assert (trimming.applied == asked) is not told
