"""Cuts by a cam and on the time base of the spindle."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from console.session.stages import nominal_path
from drivers.cutting.planning import Strategy, plan_cut
from drivers.cutting.tables import Tables
from drivers.identification.nominal import nominal_response
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import DIALECTS, PMAC
from drivers.pmac.program_constants import constants_of
from drivers.pmac.programs.timebase import spindle_clock
from drivers.simulator.plant.true_parameters import ideal
from profiles.compensations.path import AlongCut, CutPath, target_path
from profiles.findings import Severity
from profiles.machine import MachineProfile
from profiles.problem import ProblemError
from tests.drivers import families
from tests.drivers.conftest import JobMaker
from tests.drivers.cut_floor import FAMILIES, CutFloor, Track, of_family, short, with_inverter

machine = families.close_machine
"""Everything close together."""


CYCLE_MS = 3_713_707 / 8_388_608


def turns_of_feed(floor: CutFloor, track: Track) -> float:
    """Turns for which the carriage has been fed."""
    return float(track.carriage.max() - floor.plan.carriage_start) / floor.plan.setup.carriage_per_turn


def excess_um(floor: CutFloor, track: Track) -> np.ndarray:
    """How much further in the tool is than the wanted path at the angle of the spindle."""
    infeed_um = (track.tool - floor.plan.setup.surface) * 0.2
    return np.asarray(infeed_um - target_path(floor.job).at_um(track.spindle * 0.036))


@pytest.mark.parametrize(("family", "number"), [("pmac", 1), ("turbo", 2)])
def test_a_cam_leaves_less_than_a_micrometre_and_the_table_off(
    machine: MachineProfile, experiment: JobMaker, family: str, number: int
) -> None:
    floor = CutFloor(short(experiment, number), of_family(machine, family), Strategy.CAM)
    track = floor.cut()
    assert floor.measured().ront_um < 0.2
    assert (floor.number("I51"), floor.number("M169")) == (0.0, 0.0)
    # Neither on nor off made a step: nothing that the tool was told is faster than its peak in the program.
    # A count of the encoder of the spindle is up to 0.3 counts of the cam.
    assert np.abs(np.diff(track.tool_told)).max() <= floor.plan.checked.peak_velocity[1] * CYCLE_MS + 0.3
    assert track.tool_told[-1] == pytest.approx(floor.plan.setup.retracted, abs=1e-6)
    assert track.tool[-1] == pytest.approx(floor.plan.setup.retracted, abs=50)


def test_the_planned_motion_is_the_motion_that_is_made(machine: MachineProfile, experiment: JobMaker) -> None:
    """What the table adds is in the extent and in the peaks of the plan, though no line of the program has it."""
    floor = CutFloor(short(experiment), machine, Strategy.CAM)
    checked = floor.plan.checked
    track = floor.cut()
    # An encoder count of the spindle is up to 0.3 counts of the tool, a servo cycle up to 22.
    assert checked.highest[1] == pytest.approx(track.tool_told.max(), abs=1.0)
    assert checked.lowest[1] == pytest.approx(track.tool_told.min(), abs=25.0)
    fastest = np.abs(np.diff(track.tool_told)).max() / CYCLE_MS
    assert checked.peak_velocity[1] == pytest.approx(fastest, rel=0.05)
    assert checked.highest[3] == pytest.approx(track.carriage.max(), abs=1.0)
    pieces = [piece for move in checked.moves for piece in move.pieces]
    gaps = [np.polyval(old.cubics[0][::-1], old.duration_ms) - new.cubics[0][0] for old, new in pairwise(pieces)]
    assert np.abs(gaps).max() < 0.05


def test_a_spindle_that_is_only_followed_will_do(machine: MachineProfile, experiment: JobMaker) -> None:
    """The angle of jaw 1 is then one of the motor's own counts, whose zero is where the card was switched on."""
    job, conventional = short(experiment), with_inverter(machine)
    zero = CutFloor(job, conventional, Strategy.CAM).card.card.motors[2].axis.origin
    found = replace(job, lobe_phase_deg=job.lobe_phase_deg - zero * 0.036)
    floor = CutFloor(found, conventional, Strategy.CAM)
    floor.card.sim.mount(job)
    floor.cut()
    assert floor.measured().ront_um < 0.3


@pytest.mark.parametrize("hold_s", [3.5, 3.937])
def test_a_hold_ends_the_cut_with_its_turn(machine: MachineProfile, experiment: JobMaker, hold_s: float) -> None:
    floor = CutFloor(short(experiment), machine, Strategy.CAM)
    floor.start()
    floor.card.sim.wait(hold_s)
    z_before = floor.number("#3P")
    floor.card.tell("M26=1")
    track = floor.finish()
    # The carriage comes to rest in the 311 ms of the retract, on a third of the way of that time.
    coasted = 311 / 60.0 / 3.0
    turns = turns_of_feed(floor, track) - coasted
    assert turns < floor.plan.setup.turns - 5
    # The end of a turn is met within half a segment of 8 ms.
    assert turns == pytest.approx(round(turns), abs=0.5 * 8.0 / 60.0 + 0.001)
    assert track.carriage.max() - z_before < (2.0 + coasted) * floor.plan.setup.carriage_per_turn
    assert (floor.number("I51"), floor.number("M169")) == (0.0, 0.0)
    excess = excess_um(floor, track)
    furthest = int(np.argmax(track.carriage))
    cutting = slice(int(np.flatnonzero(track.carriage > floor.plan.carriage_start + 300)[0]), furthest - 1000)
    assert excess[cutting.stop :].max() < excess[cutting].max() + 0.05


def test_a_lease_that_runs_out_ends_the_cut_as_a_hold_does(machine: MachineProfile, experiment: JobMaker) -> None:
    floor = CutFloor(short(experiment), machine, Strategy.CAM, watchdog="P900>0")
    floor.card.tell("P900=1")
    floor.start()
    floor.card.sim.wait(3.7)
    floor.card.tell("P900=0")
    track = floor.finish()
    assert turns_of_feed(floor, track) < floor.plan.setup.turns - 5
    assert floor.number("I51") == 0.0
    assert track.tool_told[-1] == pytest.approx(floor.plan.setup.retracted, abs=1e-6)
    assert track.tool[-1] == pytest.approx(floor.plan.setup.retracted, abs=50)


def test_after_a_stop_in_mid_cut_the_table_is_in_its_zeros(machine: MachineProfile, experiment: JobMaker) -> None:
    floor = CutFloor(short(experiment), machine, Strategy.CAM)
    card, plan = floor.card, floor.plan
    client = PmacClient(MemoryLink(card.port, card.sim), card.sim)
    tables = Tables(client, machine)
    assert tables.find_remaining_tables() == ()
    floor.start()
    card.sim.wait(3.7)
    card.raw("\x01")
    card.settle()
    found = tables.switch_off()
    assert "cut.table_on" in {problem.code for problem in found}
    assert floor.number("I51") == 1.0
    card.tell(f"#1J={plan.setup.retracted}")
    card.settle()
    card.tell(f"#3J={plan.zero_row_z}")
    card.settle()
    assert tables.switch_off() == ()
    assert (floor.number("I51"), floor.number("M169")) == (0.0, 0.0)


def test_with_a_correction_left_behind_nothing_moves(machine: MachineProfile, experiment: JobMaker) -> None:
    floor = CutFloor(short(experiment), machine, Strategy.CAM)
    floor.card.tell(f"M169={50 * 96 * 32}")
    floor.card.sim.wait(0.5)
    floor.start()
    track = floor.finish()
    assert np.ptp(track.carriage) == np.ptp(track.spindle) == 0.0
    client = PmacClient(MemoryLink(floor.card.port, floor.card.sim), floor.card.sim)
    held = Tables(client, machine).find_remaining_tables()
    assert [problem.code for problem in held] == ["cut.table_holds"]


def test_a_cut_beside_the_end_of_the_travel_is_refused(machine: MachineProfile, experiment: JobMaker) -> None:
    """The part begins 0.6 mm behind the zero of Z: there is no place for a row of zeros in front of it."""
    job = replace(experiment(1), overhang_mm=198.7)
    with pytest.raises(ProblemError) as refused:
        plan_cut(job, machine, Strategy.CAM)
    assert refused.value.problems[0].code == "program.no_zero_row"


def as_shell(machine: MachineProfile) -> MachineProfile:
    return replace(machine, chuck=replace(machine.chuck, lobe_along="shell"))


def lobe_along(floor: CutFloor, track: Track, past_mm: float) -> tuple[float, float]:
    """Return the amplitude of the tool at the order of the lobe, and the mean of its command, um, at a place."""
    setup = floor.plan.setup
    here = (np.abs(track.carriage - setup.carriage_middle - 1000.0 * past_mm) < 150.0) & (
        track.tool > setup.surface
    )
    phase = 3.0 * np.radians(track.spindle[here] * 0.036)
    waves = np.stack([np.ones_like(phase), np.cos(phase), np.sin(phase)], axis=1)
    made, told = (
        np.linalg.lstsq(waves, (motion[here] - setup.surface) * 0.2, rcond=None)[0]
        for motion in (track.tool, track.tool_told)
    )
    return float(np.hypot(*made[1:])), float(told[0])


@pytest.mark.parametrize("strategy", [Strategy.CAM, Strategy.PVT, Strategy.TIMEBASE])
def test_the_tool_follows_the_lobe_along_the_part(
    machine: MachineProfile, experiment: JobMaker, strategy: Strategy
) -> None:
    """A shell far from the jaws: 15 % less lobe over the last 2 mm; the mean goes in where the part bends."""
    lathe, true = as_shell(machine), replace(ideal(machine), jaw_stiffness=300.0)
    floor = CutFloor(replace(short(experiment), cut_length_mm=2.0), lathe, strategy, true)
    track, along = floor.cut(), floor.plan.target.along
    assert float(along.factor(3, 0.8)) - float(along.factor(3, -0.8)) > 0.05
    mean_um = lobe_along(floor, track, 0.0)[1]
    for past_mm in (-0.6, 0.0, 0.6):
        amplitude_um, here_um = lobe_along(floor, track, past_mm)
        assert amplitude_um == pytest.approx(27.5 * float(along.factor(3, past_mm)), abs=0.15)
        assert here_um - mean_um == pytest.approx(float(along.further_um(past_mm)), abs=0.02)


@pytest.mark.parametrize("strategy", [Strategy.CAM, Strategy.PVT, Strategy.TIMEBASE])
def test_the_tool_follows_what_was_learned_along_the_part(
    machine: MachineProfile, experiment: JobMaker, strategy: Strategy
) -> None:
    """A slope of 3 um of the lobe, a curvature of 2, and a mean that goes in by 4 um to either end."""
    job = replace(short(experiment), cut_length_mm=4.0)
    nominal = nominal_path(job, machine, strategy)
    through = nominal_response(strategy, machine, job.lobe_frequency_hz)
    lobe = nominal.target.harmonics[0].coefficient / 27.5
    added = {(0, 2): 4.0 + 0j, (3, 1): 3.0 * lobe, (3, 2): 2.0 * lobe}
    command = {key: c / through if key[0] else c for key, c in added.items()}
    path = CutPath(target=nominal.target.plus_axial(added), command=nominal.command.plus_axial(command))
    floor = CutFloor(job, machine, strategy, path=path)
    track = floor.cut()
    middle_um = lobe_along(floor, track, 0.0)
    for s in (-0.6, 0.0, 0.6):
        amplitude_um, here_um = lobe_along(floor, track, 2.0 * s)
        assert amplitude_um == pytest.approx(27.5 + 3.0 * s + 2.0 * s**2, abs=0.15)
        assert here_um - middle_um[1] == pytest.approx(4.0 * s**2, abs=0.1)


@pytest.mark.parametrize("strategy", [Strategy.PVT, Strategy.TIMEBASE])
def test_what_says_how_the_path_changes_along_the_part_is_read_back_and_watched(
    machine: MachineProfile, experiment: JobMaker, strategy: Strategy
) -> None:
    """Step, start and the powers of amplitude and mean are constants like any other."""
    plan = plan_cut(experiment(1), as_shell(machine), strategy)
    kept = {each.name for each in constants_of(plan.program, PMAC) if each.kept}
    along = plan.command.along
    powers = {f"P{83 + n}" for n in range(len(along.powers(3)))} | {
        f"P{89 + n}" for n in range(len(along.mean_um))
    }
    assert len(powers) >= 3 and {"P81", "P82"} | powers <= kept


@pytest.mark.parametrize("strategy", [Strategy.PAPER, Strategy.NONE])
def test_what_is_printed_or_straight_does_not_change_along_the_part(
    machine: MachineProfile, experiment: JobMaker, strategy: Strategy
) -> None:
    constant = AlongCut(half_length_mm=experiment(1).cut_length_mm / 2.0)
    assert plan_cut(experiment(1), as_shell(machine), strategy).target.along == AlongCut()
    assert plan_cut(experiment(1), as_shell(machine), Strategy.CAM).target.along.orders
    assert plan_cut(experiment(1), machine, Strategy.CAM).target.along == constant, "one lobe along Z"


# A cut on the spindle's time: on the card, in both families, from the blank to the measured part.


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


def test_the_motion_made_is_the_motion_planned(machine: MachineProfile, experiment: JobMaker) -> None:
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


def test_motion_waits_for_the_index_and_cut_for_speed(machine: MachineProfile, experiment: JobMaker) -> None:
    floor = CutFloor(short(experiment), machine, Strategy.TIMEBASE)
    track = floor.cut()
    begins = int(np.flatnonzero(np.abs(np.diff(track.tool_told)) > 1e-6)[0])
    # The first programmed segment stands still, so the tool begins 3 programmed ms, 500 counts, behind the index.
    assert track.spindle[begins] % 10_000 == pytest.approx(500, abs=80)
    speeds = np.diff(track.spindle)[begins:-6000] / machine.controller.servo_period_ms
    assert speeds == pytest.approx(np.full_like(speeds, 10_000 / 60.0), rel=1e-6)


@pytest.mark.first(1)
@FAMILIES
def test_a_conventional_spindle_is_a_clock_too(machine: MachineProfile, experiment: JobMaker, family: str) -> None:
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
def test_on_the_time_base_a_hold_ends_the_cut_with_its_turn(
    machine: MachineProfile, experiment: JobMaker, hold_s: float
) -> None:
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


def test_a_hold_while_the_spindle_runs_down_ends_a_turn(machine: MachineProfile, experiment: JobMaker) -> None:
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


def test_a_standing_spindle_freezes_the_tool_until_an_abort(machine: MachineProfile, experiment: JobMaker) -> None:
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
