"""Plans of cuts, also of axes that were identified."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from drivers.cutting.findings import leaving_findings
from drivers.cutting.planning import CutPlan, Strategy, nominal_command, plan_cut
from drivers.errors import DriverError
from drivers.identification.nominal import nominal_response
from drivers.identification.result import (
    IdentifiedPoint,
    IdentifiedResponse,
    ResponseOrigin,
    as_response,
    unfit_problems,
)
from drivers.pmac.axes import read_definitions
from drivers.pmac.check import CheckedMove, CheckedProgram, loop_lines, run_through
from drivers.pmac.settings import settings_with
from profiles.axis.servo import sampled_response
from profiles.compensations.path import CutPath, PathHarmonic, target_path
from profiles.findings import Severity
from profiles.job import Job
from profiles.lobe.along import along_cut, holding_spread
from profiles.machine import MachineProfile
from profiles.problem import ProblemError, ProfileError
from profiles.store import load_machine
from tests.drivers.conftest import JobMaker
from tests.drivers.cut_floor import short


def with_settings(machine: MachineProfile, changed: Mapping[str, float]) -> MachineProfile:
    variables = {**machine.controller.variables, **changed}
    return replace(machine, controller=replace(machine.controller, variables=variables))


def codes(plan: CutPlan, severity: Severity) -> set[str]:
    return {finding.problem.code for finding in plan.findings if finding.severity is severity}


def checked(plan: CutPlan, machine: MachineProfile) -> CheckedProgram:
    start = {1: plan.tool_start, 2: plan.spindle_start, 3: plan.carriage_start}
    definitions = read_definitions(machine.controller.axis_definitions)
    return run_through(plan.program, settings_with(machine.controller.variables), definitions, start)


def sampled(moves: list[CheckedMove], motor: int, count: int = 25) -> np.ndarray:
    """Positions along the pieces, by Horner on the polynomial coefficients themselves."""
    found = []
    for move in moves:
        for piece in move.pieces:
            t = np.linspace(0, piece.duration_ms, count)
            found.append(np.polyval(piece.cubics[motor][::-1], t))
    return np.concatenate(found)


def cutting_moves(plan: CutPlan, checked_program: CheckedProgram) -> list[CheckedMove]:
    """The moves in which the carriage feeds at a constant rate, that of the job; in the first it gathers speed."""
    lines = loop_lines(plan.program.program)
    inside = [move for move in checked_program.moves if move.record.line in lines]
    rate = plan.setup.carriage_per_turn / plan.setup.counts_per_turn
    feeding = [
        after
        for before, after in pairwise(inside)
        if after.record.target[2] - before.record.target[2]
        == pytest.approx(rate * (after.record.target[1] - before.record.target[1]), rel=1e-7)
    ]
    return feeding[1:]


def deviation_um(plan: CutPlan, job: Job, machine: MachineProfile) -> np.ndarray:
    """Commanded tool path minus the inverted sinusoid at the same commanded spindle angle."""
    return deviation_in_um(cutting_moves(plan, checked(plan, machine)), plan, job, machine)


def deviation_in_um(moves: list[CheckedMove], plan: CutPlan, job: Job, machine: MachineProfile) -> np.ndarray:
    """The same in some of its moves."""
    tool, spindle = sampled(moves, 0), sampled(moves, 1)
    response = complex(sampled_response(machine, job.lobe_frequency_hz))
    target = target_path(job)
    harmonic = np.exp(1j * job.jaws * (2 * np.pi * spindle / 10_000 - np.radians(target.phase_deg)))
    path = target.mean_um + target.amplitude_um * np.real(harmonic / response)
    return np.asarray((tool - plan.setup.surface) * 0.2 - path)


@pytest.mark.first(2)
@pytest.mark.parametrize(
    ("jaws", "rpm", "phase_deg", "error_um", "length_mm"),
    [
        (3, 1000, 47, 55, 8.0),
        (4, 777, 33, 21, 1.0),
        (6, 377, -100, 55, 1.0),
        (2, 2900, 10, 55, 1.0),
        (3, 1234.5, 0, 33, 1.0),
    ],
)
def test_pvt_stays_within_its_interpolation_limit_over_the_whole_cut(
    machine: MachineProfile,
    experiment: JobMaker,
    jaws: int,
    rpm: float,
    phase_deg: float,
    error_um: float,
    length_mm: float,
) -> None:
    job = replace(
        experiment(1),
        jaws=jaws,
        spindle_speed_rpm=rpm,
        lobe_phase_deg=phase_deg,
        lobe_error_um_pp=error_um,
        cut_length_mm=length_mm,
    )
    plan = plan_cut(job, machine, Strategy.PVT)
    assert np.abs(deviation_um(plan, job, machine)).max() < 0.05
    assert plan.spindle_speed_rpm == pytest.approx(rpm, rel=1e-9)


@pytest.mark.long
def test_the_angle_is_not_rounded_over_a_thousand_turns(machine: MachineProfile, experiment: JobMaker) -> None:
    """2345.7 rpm has no whole number of milliseconds a turn; a rounded angle would drift by a lobe and more."""
    job = replace(
        experiment(1),
        jaws=2,
        spindle_speed_rpm=2345.7,
        feed_mm_per_rev=0.01,
        cut_length_mm=10.0,
        lobe_error_um_pp=5.0,
    )
    plan = plan_cut(job, machine, Strategy.PVT)
    moves = cutting_moves(plan, checked(plan, machine))
    turns = (moves[-1].record.target[1] - moves[0].record.target[1]) / 10_000
    assert turns > 1000
    assert np.abs(deviation_in_um(moves[-200:], plan, job, machine)).max() < 0.05


@pytest.mark.first(3)
@pytest.mark.parametrize("rpm", [333.3, 1000, 1234.5])
@pytest.mark.parametrize("strategy", [Strategy.PVT, Strategy.NONE])
def test_pvt_segments_are_whole_milliseconds(
    machine: MachineProfile, experiment: JobMaker, rpm: float, strategy: Strategy
) -> None:
    plan = plan_cut(replace(short(experiment), spindle_speed_rpm=rpm), machine, strategy)
    times = {move.used_times.tm_ms for move in checked(plan, machine).moves}
    assert all(time == int(time) and time >= 1 for time in times)


def test_pvt_is_continuous_and_ends_at_rest(machine: MachineProfile, experiment: JobMaker) -> None:
    program = checked(plan_cut(short(experiment), machine, Strategy.PVT), machine)
    pieces = [piece for move in program.moves for piece in move.pieces]
    for before, after in pairwise(pieces):
        for old, new in zip(before.cubics, after.cubics, strict=True):
            t = before.duration_ms
            assert np.polyval(old[::-1], t) == pytest.approx(new[0], abs=1e-5)
            assert np.polyval(np.polyder(old[::-1]), t) == pytest.approx(new[1], abs=1e-6)
    for cubic in pieces[-1].cubics:
        assert np.polyval(np.polyder(cubic[::-1]), pieces[-1].duration_ms) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    ("strategy", "rpm"),
    [
        (Strategy.PVT, 640.0),
        (Strategy.PVT, 1000.0),
        (Strategy.PVT, 2345.7),
        (Strategy.NONE, 1000.0),
        (Strategy.NONE, 9000.0),  # a turn of 6.7 ms, shorter than the longest segment
    ],
)
@pytest.mark.first(2)
def test_a_cut_is_the_whole_turns_that_it_needs(
    machine: MachineProfile, experiment: JobMaker, strategy: Strategy, rpm: float
) -> None:
    """8 mm and the free run of 0.7 mm at 0.07 mm a turn: 124.3 turns, so 125; within half a segment."""
    job = replace(experiment(1), feed_mm_per_rev=0.07, spindle_speed_rpm=rpm, lobe_error_um_pp=1.0)
    plan = plan_cut(job, machine, strategy)
    feeding = cutting_moves(plan, checked(plan, machine))
    counts = feeding[-1].record.target[2] - plan.carriage_start
    half_a_segment = 0.5 * plan.segment_ms * rpm / 60_000.0
    assert counts / 70.0 == pytest.approx(125, abs=half_a_segment + 1e-6)


@pytest.mark.parametrize("strategy", list(Strategy))
@pytest.mark.first(2)
def test_the_experiments_are_planned_without_a_refusal(
    machine: MachineProfile, experiment: JobMaker, strategy: Strategy
) -> None:
    for number in (1, 2):
        assert codes(plan_cut(experiment(number), machine, strategy), Severity.REFUSAL) == set()


def test_the_printed_times_cost_speed_and_stroke(machine: MachineProfile, experiment: JobMaker) -> None:
    plan = plan_cut(short(experiment), machine, Strategy.PAPER)
    assert plan.spindle_speed_rpm == pytest.approx(500)
    facts = {f.problem.code: (f.problem.value, f.problem.limit) for f in plan.findings}
    assert facts["cut.segment_stretched"] == ("20 ms", "10 ms")
    assert facts["cut.speed_differs"] == ("500 rpm", "1000 rpm")
    assert facts["cut.stroke_lost"] == ("36.67 um (66.7 %)", "55.00 um")
    assert codes(plan, Severity.WARNING) == set(facts)
    plan = plan_cut(short(experiment, 2), machine, Strategy.PAPER, 5)
    assert plan.spindle_speed_rpm == pytest.approx(1000)
    assert codes(plan, Severity.WARNING) == {"cut.stroke_lost"}
    assert {f.problem.value for f in plan.findings} == {"22.00 um (66.7 %)"}
    # TA = TM = 10, TS = 1: the share that a zig-zag keeps is 1 - 4 ((TA-TS)/8 + TS^2/(24 (TA-TS)))/TM.
    plan = plan_cut(short(experiment), machine, Strategy.PAPER, 1)
    lost = 4 * (9 / 8 + 1 / (24 * 9)) / 10
    (finding,) = [f for f in plan.findings if f.problem.code == "cut.stroke_lost"]
    assert float(finding.problem.value.partition(" ")[0]) == pytest.approx(55 * (1 - lost), abs=0.006)


def test_pvt_warns_of_nothing(machine: MachineProfile, experiment: JobMaker) -> None:
    assert plan_cut(experiment(1), machine, Strategy.PVT).findings == ()


@pytest.mark.parametrize(
    ("settings", "code", "key"),
    [
        ({"I116": 30}, "cut.too_fast", "I116"),
        ({"I216": 150}, "cut.too_fast", "I216"),
        ({"I113": 90_000}, "cut.beyond_travel", "I113"),
        ({"I114": 245_000}, "cut.beyond_travel", "I114"),
        ({"I313": 150_000}, "cut.beyond_travel", "I313"),
        ({"I111": 1600}, "cut.following_error", "I111"),
    ],
)
def test_a_cut_beyond_a_limit_of_the_machine_is_refused(
    machine: MachineProfile, experiment: JobMaker, settings: Mapping[str, float], code: str, key: str
) -> None:
    plan = plan_cut(short(experiment), with_settings(machine, settings), Strategy.PVT)
    refusals = [f.problem for f in plan.findings if f.severity is Severity.REFUSAL]
    assert [(problem.code, problem.key) for problem in refusals] == [(code, key)]


FOLLOWING = (Strategy.PVT, Strategy.CAM, Strategy.TIMEBASE, Strategy.PAPER)


@pytest.mark.parametrize("strategy", FOLLOWING)
def test_a_path_that_leaves_the_part_is_refused_and_a_plain_cut_of_the_same_job_is_not(
    machine: MachineProfile, experiment: JobMaker, strategy: Strategy
) -> None:
    shallow = replace(short(experiment), depth_of_cut_mm=0.02)
    (problem,) = [
        f.problem for f in plan_cut(shallow, machine, strategy).findings if f.severity is Severity.REFUSAL
    ]
    assert (problem.code, problem.key) == ("cut.leaves_part", "depth_of_cut_mm")
    assert (problem.value, problem.limit) == ("-7.50 um", ">= 0.0325 mm")
    assert codes(plan_cut(shallow, machine, Strategy.NONE), Severity.REFUSAL) == set()


def test_a_path_that_leaves_the_part_at_one_end_only_is_refused_with_its_place(experiment: JobMaker) -> None:
    """27.5 um mid-cut and 5 for the edge would do; at the jaws, Z 22, the lobe of the shell is a fifth more."""
    lathe, job = load_machine("lee-2001-lathe").machine, replace(experiment(1), depth_of_cut_mm=0.033)
    (found,) = leaving_findings(job, replace(target_path(job), along=along_cut(job, lathe)))
    assert found.problem.value.endswith(" um (Z 22.0 mm)")
    most, _ = holding_spread(job, lathe)["profile"]
    assert float(found.problem.limit.split()[1]) == pytest.approx(0.0275 * most + 0.005, abs=2e-4)
    assert leaving_findings(job, target_path(job)) == ()


def test_a_learned_path_is_judged_by_its_own_waves(machine: MachineProfile, experiment: JobMaker) -> None:
    """The lobe is lowest at 150 deg, and so is a wave of 6 um, four in a turn, with a crest at 15: 33.5 um out.

    The edge takes 5 um more.
    """
    lobe = target_path(experiment(1))
    for depth_mm, refused in ((0.0384, True), (0.0386, False)):
        job = replace(short(experiment), depth_of_cut_mm=depth_mm)
        # The mean that was learned is 20 um deeper, for a tool that gives way; the part is not.
        oval = PathHarmonic(lobes=4, amplitude_um=6.0, phase_deg=15.0)
        harmonics = replace(lobe, mean_um=1000 * depth_mm + 20.0, overtones=(oval,))
        plan = plan_cut(job, machine, Strategy.CAM, path=CutPath(target=harmonics, command=harmonics))
        assert ("cut.leaves_part" in codes(plan, Severity.REFUSAL)) is refused


def test_the_following_error_is_that_of_the_reference(machine: MachineProfile, experiment: JobMaker) -> None:
    """|1 - T| |1/T| 27.5 um at 50 Hz with T = 0.885 exp(-0.903 j): 25.6 um; 25 um trip, 27 um do not."""
    response = 0.885 * np.exp(-0.903j)
    error_um = 27.5 * abs(1 - response) / abs(response)
    for limit_um, refused in ((error_um - 0.3, True), (error_um + 0.3, False)):
        settings = {"I111": limit_um / 0.2 * 16}
        plan = plan_cut(short(experiment), with_settings(machine, settings), Strategy.PVT)
        assert ("cut.following_error" in codes(plan, Severity.REFUSAL)) is refused


def test_a_lobe_too_fast_for_whole_milliseconds_is_refused(machine: MachineProfile, experiment: JobMaker) -> None:
    job = replace(experiment(1), jaws=12, spindle_speed_rpm=1500.0)
    with pytest.raises(ProblemError) as refused:
        plan_cut(job, machine, Strategy.PVT)
    assert refused.value.problems[0].code == "program.too_fast"


@pytest.mark.parametrize("ts_ms", [-1, 8_388_608])
def test_a_ts_that_cannot_be_is_refused(machine: MachineProfile, experiment: JobMaker, ts_ms: int) -> None:
    with pytest.raises(DriverError) as refused:
        plan_cut(short(experiment), machine, Strategy.PAPER, ts_ms)
    assert refused.value.problems[0].code == "program.refused"


@pytest.mark.parametrize("strategy", list(Strategy))
def test_a_lease_is_looked_at_in_every_turn_and_changes_nothing_else(
    machine: MachineProfile, experiment: JobMaker, strategy: Strategy
) -> None:
    """It has run out while a program is only planned; the motion is planned as if it were renewed."""
    plain = plan_cut(short(experiment), machine, strategy)
    guarded = plan_cut(short(experiment), machine, strategy, watchdog="I5111>0")
    # Also in every segment of a feed hold, before the tool comes in, and in every segment before it cuts on.
    assert guarded.text.count("M26=0 AND I5111>0") == (5 if plain.holds else 1)
    assert guarded.text.replace(" AND I5111>0", "") == plain.text
    assert guarded.duration_s == plain.duration_s
    assert guarded.findings == plain.findings


# A cut that inverts what was identified: its command, whose response it takes, and what it refuses.

Curve = Callable[[float], complex]


def identified(
    machine: MachineProfile, path: Strategy, curve: Curve, *frequencies_hz: float
) -> IdentifiedResponse:
    """What the console would have kept of an axis that answers like this."""
    variables = machine.controller.variables
    origin = ResponseOrigin(
        machine=machine.name,
        simulated=True,
        version="1.17",
        kind="PMAC1, X1",
        gains={f"I{number}": variables[f"I{number}"] for number in range(130, 136)},
        servo_period_ms=machine.controller.servo_period_ms,
    )
    points = tuple(
        IdentifiedPoint(
            frequency_hz=frequency_hz,
            gain=abs(curve(frequency_hz)),
            phase_deg=math.degrees(cmath.phase(curve(frequency_hz))),
            gain_ci=0.001,
            phase_ci_deg=0.06,
            coherence=1.0,
            amplitude_um=25.0,
        )
        for frequency_hz in frequencies_hz
    )
    date = "2001-11-30T14:05:00.000Z"
    return IdentifiedResponse(origin=origin, path=path, how="measured", delay_cycles=0, date=date, points=points)


def test_the_command_is_divided_by_gain_and_leads_by_phase(machine: MachineProfile, experiment: JobMaker) -> None:
    """Half a gain and 60 deg of lag: twice the amplitude, and 20 deg of spindle earlier."""
    found = identified(machine, Strategy.PVT, lambda _: cmath.rect(0.5, math.radians(-60.0)), 50.0)
    job = experiment(1)
    command = nominal_command(job, machine, Strategy.PVT, as_response(found, "there"))
    assert command.amplitude_um == pytest.approx(55.0)
    assert command.phase_deg == pytest.approx(job.lobe_phase_deg - 20.0)
    assert command.mean_um == pytest.approx(100.0)


@pytest.mark.parametrize("path", [Strategy.PVT, Strategy.CAM, Strategy.TIMEBASE])
def test_what_the_model_would_have_answered_makes_the_command_of_the_model(
    machine: MachineProfile, experiment: JobMaker, path: Strategy
) -> None:
    """The age of a path is in what was identified, and no cycle of it is counted twice."""
    found = identified(machine, path, lambda hz: nominal_response(path, machine, hz), 50.0)
    command, model = (
        nominal_command(experiment(1), machine, path, response) for response in (as_response(found, "there"), None)
    )
    assert command.amplitude_um == pytest.approx(model.amplitude_um, rel=1e-9)
    assert command.phase_deg == pytest.approx(model.phase_deg, abs=1e-9)


@pytest.mark.parametrize("path", [Strategy.PVT, Strategy.CAM])
def test_the_program_of_an_identified_axis_is_another(
    machine: MachineProfile, experiment: JobMaker, path: Strategy
) -> None:
    found = identified(machine, path, lambda hz: 0.9 * complex(sampled_response(machine, hz)), 40.0, 60.0)
    job = replace(experiment(1), cut_length_mm=1.0)
    plan, by_model = (plan_cut(job, machine, path, response=r) for r in (as_response(found, "there"), None))
    assert (plan.text, plan.table) != (by_model.text, by_model.table)
    assert plan.target == by_model.target


def test_a_speed_that_was_not_identified_makes_no_program(machine: MachineProfile, experiment: JobMaker) -> None:
    found = identified(machine, Strategy.CAM, lambda _: 0.9 + 0j, 40.0, 60.0)
    job = replace(experiment(1), spindle_speed_rpm=1300.0)
    with pytest.raises(ProfileError) as caught:
        plan_cut(job, machine, Strategy.CAM, response=as_response(found, "there"))
    (problem,) = caught.value.problems
    assert (problem.code, problem.where, problem.value) == ("response.outside_band", "there", "65 Hz")


def test_a_response_holds_for_its_machine_path_gains_and_world(machine: MachineProfile) -> None:
    found = identified(machine, Strategy.PVT, lambda _: 0.9 + 0j, 50.0)
    assert unfit_problems(found, machine, Strategy.PVT, simulated=True) == ()
    assert unfit_problems(found, machine, Strategy.PVT) == ()
    origin = found.origin
    variables = {**machine.controller.variables, "I133": 0.0}
    others = {
        "strategy": (found, machine, Strategy.CAM),
        "machine": (found, replace(machine, name="another"), Strategy.PVT),
        "controller": (replace(found, origin=replace(origin, kind="TURBO PMAC2")), machine, Strategy.PVT),
        "I133": (
            found,
            replace(machine, controller=replace(machine.controller, variables=variables)),
            Strategy.PVT,
        ),
        "servo_period_ms": (replace(found, origin=replace(origin, servo_period_ms=0.2214)), machine, Strategy.PVT),
    }
    for key, differing in others.items():
        (problem,) = unfit_problems(*differing, simulated=True, where="file")
        assert (problem.code, problem.where, problem.key) == ("response.of_another", "file", key)
    (world,) = unfit_problems(found, machine, Strategy.PVT, simulated=False)
    assert (world.value, world.limit) == ("simulated", "real")


def test_a_response_that_names_no_filter_was_measured_without_one(machine: MachineProfile) -> None:
    """As they were kept before there was a filter: Ix30 to Ix35 alone."""
    found = identified(machine, Strategy.PVT, lambda _: 0.9 + 0j, 50.0)
    assert not any(name >= "I136" for name in found.origin.gains)
    variables = {**machine.controller.variables, "I136": -1.09375, "I139": 0.125}
    filtered = replace(machine, controller=replace(machine.controller, variables=variables))
    problems = unfit_problems(found, filtered, Strategy.PVT)
    assert [(each.key, each.value, each.limit) for each in problems] == [
        ("I136", "0", "-1.09375"),
        ("I139", "0", "0.125"),
    ]
