"""A moment in which a cut was another one stands out from its other turns, and an even cut from nothing."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from console.text.catalogue import load
from drivers.cutting.path_seen import PathSeen
from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.lathe.snapshot import AxisState, Snapshot
from profiles.problem import Problem
from profiles.store import load_job
from tests.system.lathe_sites import compact

MACHINE = compact("pmac")
JOB = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=1.5)
POLL_S, TURN_S = 0.023, 0.06
PER_MM = MACHINE.carriage.counts_per_mm


@cache
def plan() -> CutPlan:
    return plan_cut(JOB, MACHINE, Strategy.PVT)


def found(
    tool_um: float = 0.0,
    *,
    share: float = 1.0,
    feed_mm: float = 0.0,
    turns: float = 0.0,
    noise_um: float = 0.5,
    within_s: tuple[float, float] = (1.5, 1.7),
    entry_um: float = 0.0,
    lags: bool = False,
    silent_s: tuple[float, float] = (0.0, 0.0),
    held_s: float = 0.0,
    took_s: float = 0.005,
    poll_s: float = POLL_S,
    waves_um: tuple[float, ...] = (),
    growth_per_mm: float = 0.0,
) -> list[Problem]:
    """What is found of a cut that is off by so much for 0.2 s, 1.5 s behind its beginning; `share` of its lobe.

    No poll comes within `silent_s`; `held_s` is what a simulated lathe has held its time. A poll of that moment
    takes `took_s`, every other one 5 ms. The lobe grows along the part by `growth_per_mm`.
    Where it `lags`, tool and carriage are commanded as planned all the time; else they are where commanded.

    A poll comes each `poll_s`. The tool is off by `waves_um` once, twice a turn and so on.
    The part pushes the tool off by `entry_um` where it begins, and the loop takes that back over four turns.
    """
    setup, chance = plan().setup, np.random.default_rng(1)
    planned = replace(plan(), target=replace(plan().target, growth_per_mm=growth_per_mm))
    seen = PathSeen(planned, MACHINE)
    for number in range(int(setup.whole_turns * TURN_S / poll_s)):
        at_s = number * poll_s
        if silent_s[0] <= at_s < silent_s[1]:
            continue
        off = 1.0 if within_s[0] <= at_s < within_s[1] else 0.0
        turn = at_s / TURN_S + off * turns
        z = setup.carriage_start + turn * setup.carriage_per_turn + off * feed_mm * PER_MM
        past_mm = (z - setup.carriage_middle) / PER_MM
        lobe_um = (1.0 + growth_per_mm * past_mm) * (plan().target.at_um(360.0 * turn) - plan().target.mean_um)
        target_um = plan().target.mean_um + share * lobe_um
        met = setup.carriage_face - 0.5 * MACHINE.tool.wiper_land_mm * MACHINE.carriage.counts_per_mm
        into_turns = (z - met) / setup.carriage_per_turn
        target_um -= entry_um * np.exp(-into_turns / 4.0) * (into_turns > 0.0)
        target_um += sum(um * np.cos(2.0 * np.pi * n * turn) for n, um in enumerate(waves_um, 1))
        infeed_um = target_um + off * tool_um + chance.normal(0.0, noise_um)
        tool_at = setup.surface + infeed_um / MACHINE.tool.count_um
        commanded = setup.surface + plan().command.at_um(360.0 * turn) / MACHINE.tool.count_um
        tool, spindle, carriage = (
            AxisState(position=float(at), following_error=float(lag) if lags else 0.0, flags=frozenset())
            for at, lag in (
                (tool_at, commanded - tool_at),
                (turn * setup.counts_per_turn, 0.0),
                (z, -off * feed_mm * PER_MM),
            )
        )
        seen.see(
            Snapshot(
                asked_s=at_s,
                at_s=at_s + (took_s if off else 0.005),
                program_running=True,
                runtime_error=False,
                tool=tool,
                spindle=spindle,
                carriage=carriage,
            )
        )
    return list(seen.problems(held_s))


def test_time_that_a_simulated_lathe_has_held_accuses_nobody() -> None:
    """Three turns of 60 ms are 0.18 s: held for 0.3 s they mean nothing, for 0.05 s they are told."""
    assert found(turns=3.0, held_s=0.3) == []
    assert [problem.code for problem in found(turns=3.0, held_s=0.05)] == ["cut.off_time"]


def test_where_polls_came_late_the_busy_computer_is_named_first() -> None:
    (problem,) = found(turns=3.0, silent_s=(1.2, 1.5))
    assert (problem.code, problem.key) == ("cut.polls_late", "0.3 s")
    said = load("en").problem(problem)
    assert said.index("this computer was busy") < said.index("another host")
    assert "busy" not in load("en").problem(found(turns=3.0)[0])


def test_a_poll_that_was_interrupted_accuses_nobody() -> None:
    """Its axes are read at different moments: a tool of half a lobe later looks like one that was moved."""
    assert [problem.code for problem in found(30.0, took_s=0.005)] == ["cut.off_path"]
    assert found(30.0, took_s=0.02) == []


def test_a_lobe_that_grows_as_planned_is_on_its_path() -> None:
    """By 27 um over 1.5 mm from the middle: not seen as the planned growth it would be half of the lobe."""
    assert found(growth_per_mm=0.6) == []
    assert found(30.0, growth_per_mm=0.6) != []


@pytest.mark.parametrize("polls", [0, 1, 2, 15])
def test_too_few_polls_accuse_nobody(polls: int) -> None:
    """Three turns too many in one of 15 polls: they do not show what the other turns are."""
    silent_s = (polls * POLL_S - 0.001, math.inf)
    assert found(turns=3.0, within_s=(0.14, 0.17), silent_s=silent_s) == []


def told(tool_um: float = 0.0, **how: Any) -> list[str]:
    """The axes of which something is found."""
    problems = found(tool_um, **how)
    assert {problem.code for problem in problems} <= {"cut.off_path", "cut.lobe_off_path", "cut.off_time"}
    return ["spindle" if problem.code == "cut.off_time" else problem.key for problem in problems]


@pytest.mark.parametrize("noise_um", [0.0, 0.5, 3.0])
def test_a_cut_that_is_the_same_turn_by_turn_is_left_alone(noise_um: float) -> None:
    assert told(noise_um=noise_um) == []


def test_a_lobe_that_a_weak_amplifier_makes_smaller_is_no_reason() -> None:
    assert told(share=0.7) == []


def test_a_tool_that_friction_holds_where_the_feed_begins_has_three_turns_in_air_to_follow() -> None:
    assert told(-35.0, within_s=(0.0, 3.0 * TURN_S)) == []
    assert told(-35.0, within_s=(3.5 * TURN_S, 5.0 * TURN_S)) == ["tool"]


def test_a_tool_that_yields_where_the_part_begins_is_no_reason() -> None:
    assert found(entry_um=25.0, lags=True) == []
    assert [each.code for each in found(20.0, entry_um=25.0, lags=True)] == ["cut.lagged"]


def test_an_oval_blank_that_is_polled_twice_a_turn_is_no_moment() -> None:
    """Polled at 0.487 turns its two waves swing with the beat of polls and turns, which is slow."""
    assert found(waves_um=(6.0, 12.0), poll_s=0.487 * TURN_S, lags=True) == []
    (problem,) = found(18.0, waves_um=(6.0, 12.0), poll_s=0.487 * TURN_S, lags=True)
    assert problem.code == "cut.lagged"


def test_a_command_that_is_off_in_every_turn_is_told_of_the_whole_cut() -> None:
    problem = found(25.0, within_s=(0.0, 9.0))[-1]
    assert (problem.code, problem.value) == ("cut.command_off_plan", "25.0 um")
    assert found(-25.0, within_s=(0.0, 9.0), lags=True) == [], "a tool that gives way: it is judged by its budget"


def test_a_moment_in_which_the_tool_was_deeper_is_told() -> None:
    assert told(20.0) == ["tool"]


def test_a_moment_in_which_the_carriage_was_ahead_is_told() -> None:
    assert told(feed_mm=0.1) == ["carriage"]


def test_a_spindle_that_was_elsewhere_for_a_moment_is_told() -> None:
    assert "spindle" in told(turns=2.5)


def test_a_lobe_that_is_followed_out_of_phase_from_the_first_turn_on_is_told() -> None:
    assert set(told(share=-1.0)) == {"tool"}


@pytest.mark.parametrize("lags", [False, True])
@pytest.mark.parametrize(
    ("how", "axis", "of_command", "of_axis"),
    [
        ({"tool_um": 18.0}, "tool", "cut.off_path", "cut.lagged"),
        ({"feed_mm": -0.1}, "carriage", "cut.off_path", "cut.lagged"),
        ({"share": 0.2}, "tool", "cut.lobe_off_path", "cut.lobe_lagged"),
        ({"share": -1.0}, "tool", "cut.lobe_off_path", "cut.lobe_lagged"),
    ],
)
def test_an_axis_that_lags_behind_the_planned_command_is_not_the_deed_of_another_host(
    how: dict[str, Any], axis: str, of_command: str, of_axis: str, lags: bool
) -> None:
    problem = next(each for each in found(**how, lags=lags) if each.key == axis)
    assert problem.code == (of_axis if lags else of_command)
    for language, host, friction in (("en", "another host", "dry friction"), ("ko", "다른 호스트", "건식 마찰")):
        said = load(language).problem(problem)
        assert all(fact in said for fact in (problem.value, problem.limit, problem.where))
        assert (friction in said) is lags
        assert not lags or said.index(friction) < said.index(host), "the likelier cause first"


def test_where_the_tool_lagged_is_told_from_the_face_of_the_part() -> None:
    (problem,) = found(18.0, noise_um=0.0, lags=True)
    assert float(problem.value.removesuffix(" um")) == pytest.approx(18.0, abs=3.0)
    setup = plan().setup
    begins_mm = (setup.carriage_start - setup.carriage_face + 1.5 / TURN_S * setup.carriage_per_turn) / PER_MM
    ends_mm = begins_mm + 0.2 / TURN_S * setup.carriage_per_turn / PER_MM
    assert begins_mm - 0.1 <= float(problem.where.removesuffix(" mm")) <= ends_mm + 0.1
