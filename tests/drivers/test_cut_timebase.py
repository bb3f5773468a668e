"""A cut on the spindle's time: on the card, in both families, from the blank to the measured part."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from drivers.cutting.planning import Strategy, plan_cut
from drivers.pmac.dialect import DIALECTS, PMAC
from drivers.pmac.programs.timebase import spindle_clock
from profiles.findings import Severity
from profiles.problem import ProblemError
from tests.drivers.close_together import machine as machine
from tests.drivers.cut_floor import FAMILIES, CutFloor, of_family, short, with_inverter

if TYPE_CHECKING:
    from profiles.machine import MachineProfile
    from tests.drivers.conftest import JobMaker


@pytest.mark.first(1)
@pytest.mark.parametrize(("family", "number"), [("pmac", 1), ("turbo", 2)])
def test_it_leaves_less_than_a_micrometre_and_the_card_as_it_was(
    machine: MachineProfile, experiment: JobMaker, family: str, number: int
) -> None:
    floor = CutFloor(short(experiment, number), of_family(machine, family), Strategy.TIMEBASE)
    source, slew = ("I193", "I194") if family == "pmac" else ("I5193", "I5194")
    track = floor.cut()
    assert floor.measured().ront_um < 0.2
    internal = 0.0 if family == "pmac" else float(0x2000)  # the time base of the controller, as from the factory
    assert [floor.number(name) for name in (source, slew, "I222", "%")] == [internal, 1644.0, 16.667, 100.0]
    assert floor.card.ask("#2->") == ["0"]
    floor.card.tell(*floor.plan.restore)
    assert floor.card.ask("#2->") == ["Y"]
    assert floor.number(source) == internal
    assert track.tool_told[-1] == pytest.approx(floor.plan.setup.retracted, abs=1e-6)
    assert track.tool[-1] == pytest.approx(floor.plan.setup.retracted, abs=50)
    assert track.spindle[-1] == track.spindle[-2]


@pytest.mark.parametrize("rpm", [1000.0, 640.0, 377.7])
def test_the_scale_factor_is_whole_and_its_speed_within_half_a_step_of_the_job(
    machine: MachineProfile, experiment: JobMaker, rpm: float
) -> None:
    """131072 over 10000 counts a turn at 1000 rpm, 166.67 counts/ms, is 786.4: with 786 it is 1000.55 rpm."""
    job = replace(short(experiment), spindle_speed_rpm=rpm)
    clock = spindle_clock(job, machine, PMAC)
    assert clock.counts_per_ms * clock.entry.factor == pytest.approx(131_072, rel=1e-12)
    assert abs(131_072 / (rpm / 6.0) - clock.entry.factor) <= 0.5
    plan = plan_cut(job, machine, Strategy.TIMEBASE)
    assert plan.spindle_speed_rpm == pytest.approx(rpm, rel=1e-9)
    assert plan.findings == ()


def test_the_motion_that_is_planned_is_the_motion_that_is_made(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    floor = CutFloor(short(experiment), machine, Strategy.TIMEBASE)
    plan = floor.plan
    began_s = floor.card.sim.now_s()
    floor.start()
    began_s = floor.card.sim.now_s()
    track = floor.finish()
    assert plan.checked.highest[1] == pytest.approx(track.tool_told.max(), abs=0.5)
    assert plan.checked.highest[3] == pytest.approx(track.carriage.max(), abs=1.0)
    fastest = np.abs(np.diff(track.tool_told)).max() / machine.controller.servo_period_ms
    assert plan.checked.peak_velocity[1] == pytest.approx(fastest, rel=0.02)
    # A turn of waiting for the index, and the run-down of the spindle.
    assert -0.1 < floor.card.sim.now_s() - began_s - plan.duration_s < 2.5


def test_the_motion_waits_for_the_index_and_the_cut_for_the_speed(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    floor = CutFloor(short(experiment), machine, Strategy.TIMEBASE)
    track = floor.cut()
    begins = int(np.flatnonzero(np.abs(np.diff(track.tool_told)) > 1e-6)[0])
    # The first programmed segment stands still, so the tool begins 3 programmed ms, 500 counts, behind the index.
    assert track.spindle[begins] % 10_000 == pytest.approx(500, abs=80)
    speeds = np.diff(track.spindle)[begins:-6000] / machine.controller.servo_period_ms
    assert speeds == pytest.approx(np.full_like(speeds, 10_000 / 60.0), rel=1e-6)


@pytest.mark.first(1)
@FAMILIES
def test_a_conventional_spindle_is_the_clock_as_well(
    machine: MachineProfile, experiment: JobMaker, family: str
) -> None:
    """It slips under load, so that a program by the clock would lose it; and nothing was homed but the axes."""
    floor = CutFloor(short(experiment), with_inverter(of_family(machine, family)), Strategy.TIMEBASE)
    floor.cut()
    assert floor.measured().ront_um < 0.3


@pytest.mark.parametrize("strategy", [Strategy.NONE, Strategy.PVT, Strategy.PAPER])
def test_a_strategy_that_turns_the_spindle_is_refused_where_the_card_cannot(
    machine: MachineProfile, experiment: JobMaker, strategy: Strategy
) -> None:
    with pytest.raises(ProblemError) as refused:
        plan_cut(short(experiment), with_inverter(machine), strategy)
    assert refused.value.problems[0].code == "program.not_turned"


@pytest.mark.parametrize("hold_s", [4.0, 4.437])
def test_a_hold_ends_the_cut_with_its_turn(machine: MachineProfile, experiment: JobMaker, hold_s: float) -> None:
    floor = CutFloor(short(experiment), machine, Strategy.TIMEBASE)
    floor.start()
    floor.card.sim.wait(hold_s)
    z_held = floor.number("#3P")
    floor.card.tell("M26=1")
    track = floor.finish()
    # Turns of the feed: the carriage goes on by a third of what it would in the 318 ms of the retract.
    per_turn = floor.plan.setup.carriage_per_turn
    turns = (track.carriage.max() - floor.plan.carriage_start) / per_turn - 318.0 / 3.0 / 59.967
    assert turns < floor.plan.setup.turns - 5
    assert turns == pytest.approx(round(turns), abs=0.06)
    assert track.carriage.max() - z_held < 3.9 * per_turn
    assert track.tool_told[-1] == pytest.approx(floor.plan.setup.retracted, abs=1e-6)
    assert track.tool[-1] == pytest.approx(floor.plan.setup.retracted, abs=50)


def test_a_hold_while_the_spindle_runs_down_still_ends_with_a_turn(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    """100 counts/ms in a second are 8 turns at least before it stands: the path goes slower with it."""
    floor = CutFloor(short(experiment), machine, Strategy.TIMEBASE)
    floor.start()
    floor.card.sim.wait(3.8)
    floor.card.tell("#2J/", "M26=1")
    track = floor.finish()
    turns = (track.carriage.max() - floor.plan.carriage_start) / floor.plan.setup.carriage_per_turn
    assert turns < floor.plan.setup.turns - 5
    assert turns - 318.0 / 3.0 / 59.967 == pytest.approx(round(turns - 1.77), abs=0.06)
    assert track.tool_told[-1] == pytest.approx(floor.plan.setup.retracted, abs=1e-6)


def test_a_spindle_that_stands_freezes_the_tool_and_an_abort_with_a_jog_takes_it_out(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    """A hold is not seen, because no turn comes to its end; jogs are not on the spindle's time."""
    floor = CutFloor(short(experiment), machine, Strategy.TIMEBASE)
    card, plan = floor.card, floor.plan
    floor.start()
    card.sim.wait(4.0)
    card.tell("#2J/")
    card.sim.wait(2.0)
    card.tell("M26=1")
    stands = floor.tool_told
    card.sim.wait(1.0)
    assert stands > plan.setup.surface
    assert floor.tool_told == stands
    assert card.card.systems[1].running
    card.tell("&1A")
    card.sim.wait(0.2)
    card.tell(f"#1J={plan.setup.retracted}")
    card.settle()
    card.sim.wait(1.0)
    assert floor.number("#1P") == pytest.approx(plan.setup.retracted, abs=5)
    card.tell(*plan.restore)
    card.sim.wait(1.1)  # what the factory's Ix94 takes from 0 to 100 %
    assert floor.number("%") == 100.0
    # The next cut is made from its beginning, as if nothing had been.
    card.tell(*plan.program.lines)
    floor.start()
    floor.finish()
    assert floor.number("#1P") == pytest.approx(plan.setup.retracted, abs=5)


def test_without_a_time_base_to_go_back_to_nothing_moves(machine: MachineProfile, experiment: JobMaker) -> None:
    """A host that died in mid-cut has left the spindle as the clock; loading once more must not keep that."""
    floor = CutFloor(short(experiment), machine, Strategy.TIMEBASE)
    card = floor.card
    card.tell(f"I193={DIALECTS['pmac'].conversion_table.first_address + 11}")
    card.tell(*floor.plan.program.lines)
    floor.start()
    card.sim.wait(2.0)
    assert floor.tool_told == pytest.approx(floor.plan.setup.retracted, abs=1e-6)
    assert (floor.number("#2P"), floor.number("#3P")) == (0.0, floor.plan.carriage_start)


def test_a_calculation_delay_on_the_card_is_refused(machine: MachineProfile, experiment: JobMaker) -> None:
    """I11 would pass on the program's own time, behind the index: 5 ms are 30 deg of the spindle."""
    variables = {**machine.controller.variables, "I11": 5.0}
    late = replace(machine, controller=replace(machine.controller, variables=variables))
    plan = plan_cut(short(experiment), late, Strategy.TIMEBASE)
    refusals = [f.problem for f in plan.findings if f.severity is Severity.REFUSAL]
    assert [(problem.code, problem.key) for problem in refusals] == [("cut.clock_late", "I11")]
