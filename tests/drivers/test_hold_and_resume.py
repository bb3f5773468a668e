"""A cut that is held takes the tool out, and comes back in at the same angle and place: the part does not tell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.cutting.planning import Strategy, plan_cut
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.heartbeat.plc import Policy, set_up_lines
from drivers.pmac.heartbeat.watch import Keeper
from drivers.pmac.heartbeat.watchdog import watchdog_condition
from profiles.compensations.path import target_path
from tests.drivers.close_together import machine as machine
from tests.drivers.cut_floor import CutFloor, Floats, Track, of_family, until, with_inverter

if TYPE_CHECKING:
    from profiles.job import Job
    from profiles.machine import MachineProfile
    from tests.drivers.conftest import JobMaker

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


def test_a_hold_that_nobody_ends_ends_the_cut_after_ten_minutes(
    machine: MachineProfile, experiment: JobMaker
) -> None:
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
