"""Limits between a plan and its machine: margins of the guard, ends of a home search, rate of reports."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from drivers.cutting.guarding import cut_guard
from drivers.cutting.planning import Strategy, plan_cut
from drivers.cutting.program_reports import POLLS_A_REPORT, ProgramReports
from drivers.errors import LinkError
from drivers.lathe.polling import SLOW_LINE_S
from drivers.lathe.snapshot import AxisName, AxisState, Snapshot
from drivers.lathe.standstill import HomeSearch
from profiles.machine import MachineProfile
from profiles.problem import Problem
from tests.drivers.conftest import JobMaker

IN_CUT = frozenset({"activated", "amplifier_enabled", "home_complete"})
RESTING = frozenset({"activated", "amplifier_enabled", "desired_velocity_zero"})


def polled(at_s: float = 0.0, **axes: AxisState) -> Snapshot:
    still = AxisState(position=0.0, following_error=0.0, flags=IN_CUT)
    states = {name.value: axes.get(name.value, still) for name in AxisName}
    return Snapshot(
        asked_s=at_s, at_s=at_s, program_running=True, runtime_error=False, override_percent=100.0, **states
    )


def commanded(counts: float) -> AxisState:
    return AxisState(position=counts, following_error=0.0, flags=IN_CUT)


@pytest.mark.parametrize(
    ("axis", "margin_counts"),
    [
        (AxisName.TOOL, 30.0 / 0.2),  # 30 um at 5000 counts a mm
        (AxisName.SPINDLE, 5.0 / 360.0 * 12_000.0),  # 5 deg
        (AxisName.CARRIAGE, 0.1 * 1000.0),  # 0.1 mm
    ],
)
def test_a_running_cut_may_leave_its_plan_by_its_margins(
    machine: MachineProfile, experiment: JobMaker, axis: AxisName, margin_counts: float
) -> None:
    plan = plan_cut(experiment(1), machine, Strategy.NONE)
    motors = {AxisName.TOOL: 1, AxisName.SPINDLE: 2, AxisName.CARRIAGE: 3}
    assert (machine.tool.counts_per_mm, machine.carriage.counts_per_mm) == (5000.0, 1000.0)
    margin_counts *= machine.spindle.counts_per_rev / 12_000.0 if axis is AxisName.SPINDLE else 1.0
    inside = {name: plan.checked.highest[motor] for name, motor in motors.items()}
    for planned, way in ((plan.checked.highest, 1.0), (plan.checked.lowest, -1.0)):
        for beyond, codes in ((0.9, []), (1.1, ["cut.outside_plan"])):
            at = {**inside, axis: planned[motors[axis]] + way * beyond * margin_counts}
            states = {name.value: commanded(counts) for name, counts in at.items()}
            found = cut_guard(plan, machine)(polled(**states))
            assert [problem.code for problem in found] == codes, (axis, way, beyond)


def searched(*flags: frozenset[str]) -> list[bool]:
    search = HomeSearch(AxisName.CARRIAGE, 50.0)
    states = (AxisState(position=0.0, following_error=0.0, flags=each) for each in flags)
    return [search.is_over(polled(0.1 * k, carriage=state)) for k, state in enumerate(states)]


def test_a_home_search_that_rests_three_times_without_a_zero_is_over() -> None:
    """Once or twice in a row it may turn round; a poll of the search between them begins the count anew."""
    searching = frozenset({"activated", "home_search"})
    assert searched(RESTING, RESTING, RESTING) == [False, False, True]
    assert searched(RESTING, RESTING, searching, RESTING, RESTING, RESTING) == [False] * 5 + [True]
    assert searched(*[searching | RESTING] * 5) == [False] * 5
    assert searched(*[IN_CUT - {"home_complete"}] * 5) == [False] * 5


def test_a_home_search_with_a_zero_is_over_in_position_and_not_by_its_rests() -> None:
    zero = RESTING | {"home_complete"}
    assert searched(*[zero] * 5) == [False] * 5
    assert searched(zero | {"in_position"}) == [True]
    assert searched(zero | {"in_position", "home_search"}) == [False]


class Queried:
    """A controller that counts its queries."""

    def __init__(self, problem: str = "") -> None:
        self.queries, self.problem = 0, problem

    def request(self, _: str, __: float) -> list[str]:
        self.queries += 1
        if self.problem:
            raise LinkError(Problem(code=self.problem))
        return [""]


def reports(queried: Queried, round_trip_s: float = 0.01) -> ProgramReports:
    poller = SimpleNamespace(round_trip_s=round_trip_s)
    return ProgramReports(cast(Any, queried), cast(Any, poller), cast(Any, None))


def test_a_program_is_asked_for_its_line_once_in_twelve_polls() -> None:
    queried = Queried()
    read, asked = reports(queried).read, []
    for _ in range(36):
        read()
        asked.append(queried.queries)
    assert POLLS_A_REPORT == 12
    assert asked == [0] * 11 + [1] * 12 + [2] * 12 + [3]


def test_a_slow_line_is_left_to_the_polls() -> None:
    for round_trip_s, queries in ((SLOW_LINE_S, 0), (0.9 * SLOW_LINE_S, 2)):
        queried = Queried()
        read = reports(queried, round_trip_s).read
        for _ in range(24):
            read()
        assert queried.queries == queries


@pytest.mark.parametrize(("code", "gone"), [("link.timeout", False), ("link.lost", True)])
def test_a_missing_reply_is_left_to_the_next_round_and_a_lost_link_is_not(code: str, gone: bool) -> None:
    queried = Queried(code)
    read = reports(queried).read
    for _ in range(11):
        read()
    if gone:
        with pytest.raises(LinkError):
            read()
        return
    for _ in range(13):
        read()
    assert queried.queries == 2
