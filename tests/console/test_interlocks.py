"""What the controller must report before a cut starts, and the name of each reason why it does not."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from console.session.cut.interlocks import of_machine
from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.lathe.snapshot import AxisName, AxisState, Snapshot
from profiles.problem import Problem
from tests.compact import compact_machine
from tests.console.floor import experiment_1

READY = frozenset(
    {"activated", "amplifier_enabled", "home_complete", "desired_velocity_zero", "in_position"},
)
MACHINE = compact_machine().machine


@cache
def plan() -> CutPlan:
    return plan_cut(experiment_1(1.0), MACHINE, Strategy.PVT)


def axis(position: float, flags: frozenset[str] = READY, lag: float = 0.0) -> AxisState:
    return AxisState(position=position, following_error=lag, flags=flags)


def at_start(**axes: AxisState) -> Snapshot:
    still = {
        "tool": axis(plan().tool_start),
        "spindle": axis(plan().spindle_start),
        "carriage": axis(plan().carriage_start),
    } | axes
    return Snapshot(
        asked_s=0.0,
        at_s=0.0,
        program_running=False,
        runtime_error=False,
        tool=still["tool"],
        spindle=still["spindle"],
        carriage=still["carriage"],
    )


def problems(snapshot: Snapshot) -> list[Problem]:
    return list(of_machine(snapshot, plan(), MACHINE))


def test_a_machine_at_its_start_may_cut() -> None:
    assert problems(at_start()) == []


@pytest.mark.parametrize("name", list(AxisName))
@pytest.mark.parametrize("off", [11.0, -11.0])
def test_an_axis_that_is_not_at_its_start_is_named_with_both_places(name: AxisName, off: float) -> None:
    (told,) = problems(at_start(**{name.value: axis(at_start().axis(name).position + off)}))
    assert (told.code, told.key) == ("machine.not_at_start", name)
    assert told.value and told.limit and told.value != told.limit


def test_ten_counts_are_near_enough_and_a_lag_does_not_count() -> None:
    """2 um of the tool; where it is commanded to be is where its program goes on from."""
    start = plan().tool_start
    assert problems(at_start(tool=axis(start + 10.0))) == []
    assert problems(at_start(tool=axis(start - 40.0, lag=40.0))) == []


@pytest.mark.parametrize(
    ("flags", "code"),
    [
        (READY - {"home_complete"}, "machine.not_homed"),
        (READY - {"amplifier_enabled"} | {"open_loop"}, "machine.not_enabled"),
        (READY - {"desired_velocity_zero"}, "machine.moving"),
        (READY | {"fatal_following_error"}, "machine.fault"),
    ],
)
@pytest.mark.parametrize("name", list(AxisName))
def test_what_the_controller_reports_forbids_the_cut_by_its_name(
    name: AxisName, flags: frozenset[str], code: str
) -> None:
    changed = at_start(**{name.value: replace(at_start().axis(name), flags=flags)})
    assert code in [told.code for told in problems(changed)]
