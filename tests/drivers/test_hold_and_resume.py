"""Cuts by the spindle that are held, resumed and trimmed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.cutting.bounds import UNTRIMMED, Trim
from drivers.cutting.live_trim import LiveTrim, trim_bounds, trimmed_path
from drivers.cutting.planning import Strategy, plan_cut
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.heartbeat.plc import Policy, set_up_lines
from drivers.pmac.heartbeat.watch import Keeper
from drivers.pmac.heartbeat.watchdog import watchdog_condition
from drivers.pmac.programs.pvt import live_trim_line
from drivers.simulator.plant.true_parameters import ideal
from profiles.compensations.path import LobedPath, PathHarmonic, target_path
from profiles.job import Job
from profiles.machine import MachineProfile
from tests.drivers import families
from tests.drivers.conftest import JobMaker
from tests.drivers.cut_floor import CutFloor, Floats, Track, of_family, short, until, with_inverter

machine = families.close_machine
"""Everything close together."""


HELD_S = 0.8
HOLDING = [Strategy.PVT, Strategy.CAM, Strategy.TIMEBASE, Strategy.NONE]


@dataclass(kw_only=True)
class HeldCut:
    """A cut that was held in its middle, and for how long its program said so."""

    floor: CutFloor
    track: Track
    asked_at: int

    @property
    def job(self) -> Job:
        return self.floor.job

    @property
    def excess_um(self) -> Floats:
        """How much further in the tool is than the wanted path at the angle of the spindle."""
        infeed_um = (self.track.tool - self.floor.plan.setup.surface) * self.floor.plan.setup.tool_count_um
        wanted = self.floor.plan.target.at_um(360.0 * self.track.spindle / self.floor.plan.setup.counts_per_turn)
        return np.asarray(infeed_um - wanted, dtype=np.float64)

    @property
    def out(self) -> NDArray[np.intp]:
        """The cycles in which the tool stood out, between its first and its last turn of the cut."""
        out_um = (self.track.tool - self.floor.plan.setup.retracted) * self.floor.plan.setup.tool_count_um
        cycles = np.flatnonzero(np.abs(out_um) < 100.0)  # a table adds its lobe there, too
        on_path = np.flatnonzero(self.excess_um > -40.0)
        between: NDArray[np.intp] = cycles[(cycles > on_path[0]) & (cycles < on_path[-1])]
        return between


def ready(experiment: JobMaker, machine: MachineProfile, strategy: Strategy, rpm: float = 1000.0) -> CutFloor:
    job = replace(experiment(1), cut_length_mm=1.0, spindle_speed_rpm=rpm, lobe_spindle_speed_rpm=rpm)
    floor = CutFloor(job, machine, strategy)
    floor.start()
    return floor


def to_the_middle(floor: CutFloor, turns_before: float = 1.0) -> None:
    """Let the cut go on to its measured section, in the middle, or some turns before."""
    setup = floor.plan.setup
    place = setup.carriage_middle - turns_before * setup.carriage_per_turn
    until(floor, lambda: floor.card.card.motors[3].actual >= place)


def roundness_um(floor: CutFloor) -> float:
    """RONt in the middle of the cut, where it was held; without compensation less the 55 um of the lobe."""
    left_um = 0.0 if floor.plan.strategy.traits.inverts else 55.0
    return abs(floor.measured().ront_um - left_um)


def held_and_resumed(floor: CutFloor) -> HeldCut:
    to_the_middle(floor)
    asked_at = len(floor._recorders[1].positions)
    floor.card.tell("P46=1")
    until(floor, lambda: floor.number("P47") == 2.0)
    floor.card.sim.wait(HELD_S)
    floor.card.tell("P46=0")
    until(floor, lambda: floor.number("P47") == 0.0)
    return HeldCut(floor=floor, track=floor.finish(), asked_at=asked_at)


@pytest.mark.parametrize("strategy", HOLDING)
@pytest.mark.parametrize(("family", "rpm"), [("pmac", 1000.0), ("turbo", 870.0)])
@pytest.mark.first(2)
def test_a_held_cut_goes_on_at_the_same_angle_and_place(
    machine: MachineProfile, experiment: JobMaker, family: str, rpm: float, strategy: Strategy
) -> None:
    floor = ready(experiment, of_family(machine, family), strategy, rpm)
    found = held_and_resumed(floor)
    setup, track = floor.plan.setup, found.track
    # The tool stood out for as long as it was held, and the spindle never slowed down.
    out = found.out
    assert len(out) * 0.000442 > HELD_S
    turning = np.diff(track.spindle[found.asked_at : out[-1] + 1000 : 100])
    assert turning.min() > 0.98 * turning.max()
    # At no angle was it further in than while it cut.
    cutting = found.excess_um[: found.asked_at].max()
    assert found.excess_um.max() < max(cutting, 0.3) + 0.05
    # The feed takes the same helix up: a turn of the spindle is a turn of the feed, whole turns later.
    turn = track.spindle / setup.counts_per_turn - track.carriage / setup.carriage_per_turn
    before = turn[found.asked_at - 50]
    after = np.median(turn[out[-1] + 1400 : out[-1] + 1500])
    assert after - before > 10.0
    assert after - before == pytest.approx(round(after - before), abs=0.04)
    # As a cut that was never held: its turns, its end, the table off, and the part round where it was held.
    assert (floor.number("P43"), floor.number("P44")) == (setup.whole_turns, 1.0)
    assert floor.card.sim.collisions == ()
    assert roundness_um(floor) < 0.3
    if strategy is Strategy.CAM:
        assert (floor.number("I51"), floor.number("M169")) == (0.0, 0.0)


@pytest.mark.parametrize("strategy", HOLDING)
@pytest.mark.first(1)
def test_one_turn_is_cut_and_held_again(machine: MachineProfile, experiment: JobMaker, strategy: Strategy) -> None:
    floor = ready(experiment, machine, strategy)
    to_the_middle(floor, 4.0)
    floor.card.tell("P46=1")
    until(floor, lambda: floor.number("P47") == 2.0)
    turns = floor.number("P30")
    for more in (1.0, 2.0):
        floor.card.tell("P46=2")
        until(floor, lambda: floor.number("P47") != 2.0)
        until(floor, lambda: floor.number("P47") == 2.0)
        assert (floor.number("P30"), floor.number("P46")) == (turns + more, 1.0)
    floor.card.tell("P46=0")
    floor.finish()
    assert (floor.number("P43"), floor.number("P44")) == (floor.plan.setup.whole_turns, 1.0)
    assert roundness_um(floor) < 0.3


@pytest.mark.parametrize("ends", ["M26=1", "P1004=2"])
@pytest.mark.parametrize("strategy", [Strategy.PVT, Strategy.CAM])
@pytest.mark.first(2)
def test_a_held_cut_that_is_ended_or_has_lost_its_host_stays_out(
    machine: MachineProfile, experiment: JobMaker, strategy: Strategy, ends: str
) -> None:
    """The flag that ends every cut, and the loss that the heartbeat reports under any policy."""
    floor = ready(experiment, machine, strategy)
    to_the_middle(floor)
    floor.card.tell("P46=1")
    until(floor, lambda: floor.number("P47") == 2.0)
    floor.card.sim.wait(0.5)  # it reports its moves before they are made
    deepest = len(floor._recorders[1].positions)
    floor.card.tell(ends)
    track = floor.finish()
    out_um = (track.tool[deepest:] - floor.plan.setup.retracted) * floor.plan.setup.tool_count_um
    assert out_um.max() < 100.0  # a table adds its lobe there, too
    assert floor.number("P44") == 1.0 and floor.number("P43") < floor.plan.setup.whole_turns


@pytest.mark.parametrize("policy", list(Policy))
def test_a_host_that_falls_silent_while_held_ends_the_cut_under_every_policy(
    machine: MachineProfile, experiment: JobMaker, policy: Policy
) -> None:
    """Also where the policy lets a cut finish: nobody is there to see the tool come in again."""
    job, family = replace(experiment(1), cut_length_mm=1.0), of_family(machine, "turbo")
    dialect = DIALECTS["turbo"]
    condition = "" if policy is Policy.FINISH else watchdog_condition(dialect)
    floor = CutFloor(job, family, Strategy.PVT, watchdog=condition)
    card, keeper = floor.card, Keeper(dialect=dialect, i10=family.controller.variables["I10"])
    card.tell("I5=2", *set_up_lines(family, dialect, policy))
    floor.start(before_run=keeper.cut_line(floor.plan.setup.retracted))

    def kept_until(condition: Callable[[], bool]) -> None:
        while not condition():
            card.tell(keeper.line)
            card.sim.wait(0.04)

    setup = floor.plan.setup
    kept_until(lambda: card.card.motors[3].actual >= setup.carriage_middle)
    card.tell("P46=1")
    kept_until(lambda: floor.number("P47") == 2.0)
    kept_until(lambda: card.card.motors[1].actual < setup.retracted + 50)
    before = len(floor._recorders[1].positions)
    card.sim.wait(2.5)  # 0.3 s of watchdog, and a run-down of 1 s
    assert floor.number("P1004") == 2.0
    assert max(floor._recorders[1].positions[before:]) < setup.retracted + 50
    assert not card.card.systems[1].running and card.card.motors[2].velocity == 0.0


def test_a_hold_that_nobody_ends_is_over_in_ten_minutes(machine: MachineProfile, experiment: JobMaker) -> None:
    floor = ready(experiment, machine, Strategy.NONE)
    to_the_middle(floor)
    floor.card.tell("P46=1")
    until(floor, lambda: floor.number("P47") == 2.0)
    segments = 600_000 / floor.plan.segment_ms
    floor.card.tell(f"P48={segments - 5:g}")  # as after all but the last of them
    track = floor.finish()
    assert floor.number("P44") == 1.0 and floor.number("P43") < floor.plan.setup.whole_turns
    assert track.tool[-1] < floor.plan.setup.retracted + 50


def test_what_cannot_come_back_to_its_angle_is_not_held(machine: MachineProfile, experiment: JobMaker) -> None:
    """The printed program, and a table on a spindle that the controller does not turn."""
    job = replace(experiment(1), cut_length_mm=1.0)
    held = {strategy for strategy in Strategy if plan_cut(job, machine, strategy).holds}
    assert held == set(HOLDING)
    assert not plan_cut(job, with_inverter(machine), Strategy.CAM).holds
    assert plan_cut(job, with_inverter(machine), Strategy.TIMEBASE).holds
    assert target_path(job).lobes == 3


# A cut that goes by the spindle, in a table or on its time: the lobe is gone whatever the chuck and the speed.

BY_THE_SPINDLE = pytest.mark.parametrize("strategy", [Strategy.CAM, Strategy.TIMEBASE])


@pytest.mark.first(2)
@pytest.mark.parametrize(
    ("strategy", "jaws", "phase_deg", "rpm", "error_um"),
    [
        (Strategy.CAM, 4, 33.0, 640.0, 21.0),
        (Strategy.CAM, 6, -100.0, 477.0, 55.0),
        (Strategy.TIMEBASE, 6, -100.0, 477.0, 55.0),
        (Strategy.TIMEBASE, 3, 47.0, 1234.5, 55.0),
    ],
)
def test_less_than_a_third_of_a_micrometre_is_left_whatever_the_chuck(
    machine: MachineProfile,
    experiment: JobMaker,
    strategy: Strategy,
    jaws: int,
    phase_deg: float,
    rpm: float,
    error_um: float,
) -> None:
    job = replace(
        short(experiment),
        jaws=jaws,
        lobe_phase_deg=phase_deg,
        spindle_speed_rpm=rpm,
        lobe_spindle_speed_rpm=rpm,
        lobe_error_um_pp=error_um,
    )
    floor = CutFloor(job, machine, strategy)
    floor.cut()
    assert floor.measured().ront_um < 0.3


@BY_THE_SPINDLE
def test_a_spindle_with_inertia_that_lags_in_its_loop_costs_nothing(
    machine: MachineProfile, experiment: JobMaker, strategy: Strategy
) -> None:
    job = replace(short(experiment), cut_length_mm=0.6)
    floor = CutFloor(job, machine, strategy, replace(ideal(machine), ideal_spindle=False))
    floor.cut()
    assert floor.measured().ront_um < 0.3


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("strategy", "left_um", "within_um"),
    [(Strategy.PVT, 2.07, 0.1), (Strategy.CAM, 0.99, 0.25), (Strategy.TIMEBASE, 0.99, 0.25)],
)
def test_a_ripple_of_the_speed_moves_the_tool_with_the_angle(
    machine: MachineProfile, experiment: JobMaker, strategy: Strategy, left_um: float, within_um: float
) -> None:
    """5 % twice a turn is 1.43 deg of spindle, 0.075 of a lobe's radian.

    Beside the part: lobes by the even and by the swung angle, over the servo's response at 50 Hz, then through all
    of that response (Fourier, 7200 points a turn), less the lobe by the swung angle: 2.07 um by the clock and
    0.99 um by the angle are left. What stays is the servo's: it was inverted at one frequency, the ripple makes
    others.
    """
    floor = CutFloor(short(experiment), machine, strategy)
    floor.ripple(0.05)
    floor.cut()
    assert floor.measured().ront_um == pytest.approx(left_um, abs=within_um)


# A trim of the program: blended over a turn, put back beyond its bounds, bounded by every limit of the tool.


def in_part(experiment: JobMaker, machine: MachineProfile, rpm: float = 1000.0) -> CutFloor:
    job = replace(experiment(1), cut_length_mm=1.0, spindle_speed_rpm=rpm, lobe_spindle_speed_rpm=rpm)
    floor = CutFloor(job, machine, Strategy.PVT)
    floor.start()
    until(floor, lambda: floor.number("P30") >= 10.0)
    return floor


@pytest.mark.parametrize(
    ("family", "rpm"), [("pmac", 1000.0), pytest.param("turbo", 870.0, marks=pytest.mark.long)]
)
def test_a_trim_grows_over_a_turn(machine: MachineProfile, experiment: JobMaker, family: str, rpm: float) -> None:
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


def test_the_bound_is_the_last_percent_that_is_allowed(machine: MachineProfile, experiment: JobMaker) -> None:
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
def test_a_trim_is_applied_in_the_path_or_told_for_another(gain: float, angle_deg: float, told: bool) -> None:
    program, asked = Program(), Trim(gain_percent=10.0, phase_deg=3.0)
    trimming = trimmed_by(program, asked)
    program.values |= {"P53": gain, "P54": angle_deg}
    trimming.read()
    assert (trimming.applied, trimming.problem is not None) == (UNTRIMMED, told)
    program.values |= {"P55": gain, "P56": angle_deg}
    trimming.read()
    assert (trimming.applied == asked) is not told
