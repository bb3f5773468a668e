"""What a plan allows and tells: the widest override, the speed that a program could cut, a trim in um."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from drivers.cutting.bounds import UNTRIMMED, Trim
from drivers.cutting.feed_hold import turns_back
from drivers.cutting.guarding import cut_guard
from drivers.cutting.live_trim import trim_um, untrimmed
from drivers.cutting.override import bounds_of
from drivers.cutting.planning import Strategy, plan_cut
from drivers.identification.nominal import path_response
from drivers.lathe.heartbeat import cut_condition
from drivers.lathe.snapshot import AxisName
from drivers.lathe.standstill import rest_limits
from profiles.problem import ProblemError
from tests.drivers.cut_floor import with_inverter
from tests.drivers.families import ON_ONE
from tests.drivers.families import machine as machine
from tests.drivers.test_limits_of_a_cut import commanded, polled

if TYPE_CHECKING:
    from profiles.machine import MachineProfile
    from tests.drivers.conftest import JobMaker


@ON_ONE
def test_no_override_is_wider_than_a_fifth(machine: MachineProfile, experiment: JobMaker) -> None:
    """At 80 % a program takes 1.25 times its time, of the 1.5 times that it is given."""
    job = replace(experiment(1), cut_length_mm=1.0, spindle_speed_rpm=300.0, lobe_spindle_speed_rpm=300.0)
    found = bounds_of(plan_cut(job, machine, Strategy.NONE), job, machine, path_response(Strategy.NONE, machine))
    assert (found.low_percent, found.low_by) == (80, "widest")
    assert (found.high_percent, found.high_by) == (120, "widest")


@ON_ONE
def test_a_speed_that_is_too_fast_is_refused_with_the_fastest_that_is_not(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    job = replace(experiment(1), jaws=12, spindle_speed_rpm=1500.0)
    with pytest.raises(ProblemError) as refused:
        plan_cut(job, machine, Strategy.PVT)
    limit = refused.value.problems[0].limit
    fastest = int(limit.removeprefix("<= ").removesuffix(" rpm"))
    assert 1 < fastest < 1500

    def code(rpm: float) -> str:
        try:
            plan_cut(replace(job, spindle_speed_rpm=rpm), machine, Strategy.PVT)
        except ProblemError as error:
            return error.problems[0].code
        return ""

    assert code(fastest + 1.0) == "program.too_fast" != code(float(fastest))


@ON_ONE
def test_a_trim_is_in_the_path_and_taken_out_of_a_poll(machine: MachineProfile, experiment: JobMaker) -> None:
    """10 % of a lobe of 27.5 um, at its crest in full, a quarter of a lobe on nothing; a count is 0.2 um."""
    plan = plan_cut(experiment(1), machine, Strategy.PVT)
    crest_deg, amplitude_um = plan.target.phase_deg, plan.target.amplitude_um
    assert amplitude_um == pytest.approx(27.5, rel=0.01)
    angles = [crest_deg + 120.0 / 8.0 * eighth for eighth in range(8)]
    most = max(angles, key=lambda each: abs(trim_um(plan, Trim(gain_percent=10.0), each)))
    found_um = trim_um(plan, Trim(gain_percent=10.0), most)
    assert abs(found_um) == pytest.approx(2.75, rel=0.01)
    assert trim_um(plan, Trim(gain_percent=10.0), most + 30.0) == pytest.approx(0.0, abs=1e-6)
    assert trim_um(plan, UNTRIMMED, most) == 0.0
    spindle = commanded(most / 360.0 * machine.spindle.counts_per_rev)
    poll = polled(0.0, tool=commanded(1000.0), spindle=spindle)
    assert untrimmed(poll, plan, machine, UNTRIMMED) is poll
    shifted = untrimmed(poll, plan, machine, Trim(gain_percent=10.0)).tool.position
    assert shifted == pytest.approx(1000.0 - found_um / 0.2, abs=0.01)


@pytest.mark.parametrize("policy", ["retract", "stop", "finish"])
def test_a_program_knows_its_watchdog_unless_it_may_finish(machine: MachineProfile, policy: str) -> None:
    held = replace(machine, heartbeat=replace(machine.heartbeat, policy=policy))
    assert (cut_condition(held) == "") is (policy == "finish")


@ON_ONE
def test_on_a_spindle_that_the_controller_does_not_turn_only_what_counts_its_angle_is_cut(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    """A table on its angle, or its time base: where a program commands the spindle, nothing would turn it."""
    turned, refused = with_inverter(machine), dict[Strategy, tuple[str, str]]()
    for strategy in Strategy:
        try:
            plan_cut(experiment(1), turned, strategy)
        except ProblemError as error:
            refused[strategy] = error.problems[0].code, error.problems[0].limit
    told = "program.not_turned", "cam, timebase"
    assert refused == dict.fromkeys((Strategy.PAPER, Strategy.NONE, Strategy.PVT), told)


@ON_ONE
def test_the_land_of_the_tool_stays_clear_of_the_jaws_by_their_clearance(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    """Of a land of 0.4 mm half is in front of the place of the tool."""
    plan = plan_cut(experiment(1), machine, Strategy.PVT)
    tool, carriage = replace(machine.tool, wiper_land_mm=0.4), machine.carriage
    furthest_mm = plan.checked.highest[carriage.motor] / carriage.counts_per_mm
    for more_mm, refused in ((0.05, False), (-0.05, True)):
        clearance_mm = carriage.jaw_face_mm - furthest_mm - 0.2 - more_mm
        near = replace(machine, tool=tool, carriage=replace(carriage, jaw_clearance_mm=clearance_mm))
        found = {finding.problem.code for finding in plan_cut(experiment(1), near, Strategy.PVT).findings}
        assert ("cut.near_jaws" in found) is refused


@ON_ONE
def test_what_is_rest_goes_by_the_counts_of_an_axis(machine: MachineProfile) -> None:
    """5 counts/s; of a scale of 5 nm 1 um/s, which are 200 of its counts."""
    assert rest_limits(machine) == dict.fromkeys(AxisName, 5.0)
    for axis in (AxisName.TOOL, AxisName.CARRIAGE):
        finer = replace(getattr(machine, axis.value), counts_per_mm=200_000.0)
        found = rest_limits(replace(machine, **{axis.value: finer}))
        assert found == {**dict.fromkeys(AxisName, 5.0), axis: pytest.approx(200.0)}


@ON_ONE
def test_a_cut_with_a_trim_may_leave_its_plan_by_the_largest_one(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    """30 um, and 10 % of what the path commands of the lobe: the operator may ask for that at every moment."""
    plan = plan_cut(experiment(1), machine, Strategy.PVT)
    guard, places = cut_guard(plan, machine), plan.checked.highest
    margin_um = 30.0 + 0.1 * plan.command.amplitude_um
    for beyond, codes in ((0.99, []), (1.01, ["cut.outside_plan"])):
        tool = commanded(places[machine.tool.motor] + beyond * margin_um / machine.tool.count_um)
        spindle, carriage = (commanded(places[axis.motor]) for axis in (machine.spindle, machine.carriage))
        assert [each.code for each in guard(polled(0.0, tool=tool, spindle=spindle, carriage=carriage))] == codes


@ON_ONE
def test_after_a_hold_as_many_turns_are_not_judged_as_the_way_out_took_and_two(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    """On its way out the tool cut less and less of the chip, and there it finds less of it again."""
    plan = plan_cut(experiment(1), machine, Strategy.PVT)
    at = plan.checked.motors.index(machine.tool.motor)
    moves = [
        (move.record.target[at], sum(piece.duration_ms for piece in move.pieces)) for move in plan.checked.moves
    ]
    while moves[-2][0] == moves[-1][0]:
        moves.pop()  # the tool is out, the spindle comes to rest
    out_ms, mean_counts = 0.0, plan.setup.surface + plan.setup.depth
    while moves[-1][0] < mean_counts:
        out_ms += moves.pop()[1]
    assert turns_back(plan, machine) == pytest.approx(2.0 + out_ms / 60.0, abs=0.4)  # a lobe is 20 ms
