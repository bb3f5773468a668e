"""What polls tell: guards of motions, paths of cuts, and zeros that somebody shifted."""

from __future__ import annotations

import math
from contextlib import nullcontext
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from console.text.catalogue import load
from drivers.cutting.path_seen import PathSeen
from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.errors import DriverError
from drivers.lathe.guards import (
    STALLED_S,
    AxisRange,
    JogGuard,
    OthersStill,
    ProgramGuard,
    open_loop_problem,
    reset_problem,
    unasked_motion,
)
from drivers.lathe.held_positions import HeldPositions
from drivers.lathe.lengths import Lengths
from drivers.lathe.snapshot import AxisName, AxisState, Snapshot
from profiles.compensations.path import AlongCut
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.store import load_job, load_machine
from tests.drivers.test_limits_of_a_cut import commanded, polled
from tests.system.lathe_sites import Site, compact, opened

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
    planned = replace(plan(), target=replace(plan().target, along=AlongCut(orders=((3, (growth_per_mm,)),))))
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


def test_what_polls_cannot_tell_accuses_nobody() -> None:
    """Three turns of 60 ms are 0.18 s: held for 0.3 s they mean nothing, for 0.05 s they are told."""
    assert found(turns=3.0, held_s=0.3) == []
    assert [problem.code for problem in found(turns=3.0, held_s=0.05)] == ["cut.off_time"]
    (problem,) = found(turns=3.0, silent_s=(1.2, 1.5))
    assert (problem.code, problem.key) == ("cut.polls_late", "0.3 s")
    said = load("en").problem(problem)
    assert said.index("this computer was busy") < said.index("another host")
    assert "busy" not in load("en").problem(found(turns=3.0)[0])
    # Its axes are read at different moments: a tool of half a lobe later looks like one that was moved.
    assert [problem.code for problem in found(30.0, took_s=0.005)] == ["cut.off_path"]
    assert found(30.0, took_s=0.02) == []


def test_what_a_lathe_does_by_itself_is_no_reason() -> None:
    """By 27 um over 1.5 mm from the middle: not seen as the planned growth it would be half of the lobe."""
    assert found(growth_per_mm=0.6) == []
    assert found(30.0, growth_per_mm=0.6) != []
    assert told(share=0.7) == []
    assert told(-35.0, within_s=(0.0, 3.0 * TURN_S)) == []
    assert told(-35.0, within_s=(3.5 * TURN_S, 5.0 * TURN_S)) == ["tool"]
    assert found(entry_um=25.0, lags=True) == []
    assert [each.code for each in found(20.0, entry_um=25.0, lags=True)] == ["cut.lagged"]
    # Polled at 0.487 turns its two waves swing with the beat of polls and turns, which is slow.
    assert found(waves_um=(6.0, 12.0), poll_s=0.487 * TURN_S, lags=True) == []
    (problem,) = found(18.0, waves_um=(6.0, 12.0), poll_s=0.487 * TURN_S, lags=True)
    assert problem.code == "cut.lagged"


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


def test_a_moment_in_which_an_axis_was_elsewhere_is_told() -> None:
    problem = found(25.0, within_s=(0.0, 9.0))[-1]
    assert (problem.code, problem.value) == ("cut.command_off_plan", "25.0 um")
    assert found(-25.0, within_s=(0.0, 9.0), lags=True) == [], "a tool that gives way: it is judged by its budget"
    assert told(20.0) == ["tool"]
    assert told(feed_mm=0.1) == ["carriage"]
    assert "spindle" in told(turns=2.5)
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


# What a poll of a machine in motion is judged by: the wrong way, too far, another axis, held, reset, open.

LENGTHS = Lengths(load_machine("lee-2001-lathe").machine)
"""Its tool makes 5000 counts a mm, its carriage 1000."""

CLOSED = frozenset({"activated", "amplifier_enabled", "home_complete"})
OFF = frozenset({"activated", "open_loop"})


def state(position: float, flags: frozenset[str] = CLOSED, following_error: float = 0.0) -> AxisState:
    return AxisState(position=position, following_error=following_error, flags=flags)


def seen(at_s: float = 0.0, *, running: bool = True, percent: float = 100.0, **axes: AxisState) -> Snapshot:
    still = {"tool": state(0.0), "spindle": state(0.0), "carriage": state(0.0)} | axes
    return Snapshot(
        asked_s=at_s,
        at_s=at_s,
        program_running=running,
        runtime_error=False,
        override_percent=percent,
        tool=still["tool"],
        spindle=still["spindle"],
        carriage=still["carriage"],
    )


def codes(problems: object) -> list[str]:
    assert isinstance(problems, tuple)
    return [problem.code for problem in problems]


def jog(begin: float, end: float) -> JogGuard:
    others = OthersStill({AxisName.TOOL}, seen(), LENGTHS)
    return JogGuard(axis=AxisName.TOOL, begin=begin, end=end, beyond_counts=100.0, others=others, lengths=LENGTHS)


@pytest.mark.parametrize("at", [0.0, 2500.0, 5000.0, 5100.0, -100.0])
def test_a_jog_between_its_ends_is_left_alone(at: float) -> None:
    assert jog(0.0, 5000.0)(seen(tool=state(at))) == ()


@pytest.mark.parametrize(
    ("begin", "end", "at"), [(0.0, 5000.0, 5101.0), (0.0, 5000.0, -101.0), (0.0, -50.0, 101.0)]
)
def test_a_jog_beyond_its_target_or_the_wrong_way_is_reported(begin: float, end: float, at: float) -> None:
    (problem,) = jog(begin, end)(seen(tool=state(at)))
    assert (problem.code, problem.key, problem.value) == ("machine.jog_astray", "tool", f"{at / 5000.0:.4f} mm")
    assert problem.limit == f"{begin / 5000.0:.4f} to {end / 5000.0:.4f} mm"


def test_it_is_the_commanded_position_that_counts_and_another_axis_is_reported() -> None:
    """An axis that lags is not astray, and one that is commanded beyond its target is, before it gets there."""
    assert codes(jog(0.0, 5000.0)(seen(tool=state(4000.0, following_error=1500.0)))) == ["machine.jog_astray"]
    assert jog(0.0, 5000.0)(seen(tool=state(5200.0, following_error=-200.0))) == ()
    (problem,) = jog(0.0, 5000.0)(seen(tool=state(100.0), carriage=state(60.0)))
    assert (problem.code, problem.key) == ("machine.unexpected_motion", "carriage")


@pytest.mark.parametrize("percent", [0.0, 50.0, 99.0, 101.0])
def test_any_override_but_real_time_is_no_cut(percent: float) -> None:
    assert codes(ProgramGuard(LENGTHS)(seen(percent=percent))) == ["cut.override"]
    assert ProgramGuard(LENGTHS, real_time=False)(seen(percent=percent)) == ()
    assert ProgramGuard(LENGTHS)(seen(percent=percent, running=False)) == ()


def test_an_axis_outside_the_plan_is_reported_unless_its_loop_is_open() -> None:
    guard = ProgramGuard(LENGTHS, [AxisRange(axis=AxisName.CARRIAGE, low=-10.0, high=1000.0)])
    assert guard(seen(carriage=state(1000.0))) == ()
    (problem,) = guard(seen(carriage=state(1001.0)))
    assert (problem.code, problem.key, problem.limit) == ("cut.outside_plan", "carriage", "-0.010 to 1.000 mm")
    # That its loop is open is what is wrong, and is told by itself.
    coasting = seen(tool=state(9000.0, OFF), carriage=state(9000.0, OFF))
    assert jog(0.0, 5000.0)(coasting) == ()
    assert ProgramGuard(LENGTHS, [AxisRange(axis=AxisName.CARRIAGE, low=-10.0, high=1000.0)])(coasting) == ()
    opened = open_loop_problem(coasting)
    assert opened is not None and opened.key == "tool, carriage"


def test_only_what_moves_can_be_stalled() -> None:
    guard, step_s = ProgramGuard(LENGTHS), STALLED_S / 4.0
    told = [codes(guard(seen(number * step_s))) for number in range(6)]
    assert told == [[], [], [], [], ["cut.stalled"], ["cut.stalled"]]
    guard = ProgramGuard(LENGTHS)
    assert all(guard(seen(number * 0.4, spindle=state(10.0 * number))) == () for number in range(10))
    guard = ProgramGuard(LENGTHS)
    assert all(guard(seen(number * 0.4, running=False)) == () for number in range(10))


def test_a_lost_home_or_loop_is_named() -> None:
    off = state(0.0, OFF)
    problem = reset_problem(frozenset(AxisName), seen(tool=off, spindle=off, carriage=off))
    assert problem is not None and problem.code == "controller.was_reset"
    lost = seen(carriage=state(0.0, CLOSED - {"home_complete"}))
    problem = reset_problem(frozenset(AxisName), lost)
    assert problem is not None and (problem.code, problem.key) == ("controller.home_lost", "carriage")
    assert reset_problem(frozenset(), lost) is None
    opened = seen(spindle=state(0.0, OFF))
    problem = open_loop_problem(opened)
    assert problem is not None and (problem.code, problem.key) == ("machine.loop_open", "spindle")
    assert open_loop_problem(replace(opened, driven=(AxisName.TOOL, AxisName.CARRIAGE))) is None


@pytest.mark.parametrize(
    ("moving", "program", "key"),
    [(("carriage",), False, "carriage"), (("spindle", "tool"), True, "tool, spindle"), ((), True, "program")],
)
def test_a_motion_that_nobody_here_asked_for_is_told(moving: tuple[str, ...], program: bool, key: str) -> None:
    resting = CLOSED | {"desired_velocity_zero", "in_position"}
    axes = {
        name: state(0.0, flags=CLOSED if name in moving else resting) for name in ("tool", "spindle", "carriage")
    }
    tool, spindle, carriage = axes.values()
    problem = unasked_motion(seen(running=program, tool=tool, spindle=spindle, carriage=carriage))
    assert problem is not None and (problem.code, problem.key) == ("machine.moves_unasked", key)
    still = state(0.0, flags=resting)
    assert unasked_motion(seen(running=False, tool=still, spindle=still, carriage=still)) is None


# A zero that another host sets (HMZ) is not taken for one that was found, nor for the one that was there.


def another_sends_at(site: Site, counts: float, line: bytes) -> None:
    """At the first look that shows the spindle beyond so many counts."""
    from drivers.link.memory import MemoryLink

    assert isinstance(site.client.link, MemoryLink)
    sent: list[bytes] = []

    def see(snapshot: object) -> None:
        position = site.lathe._poller.last.spindle.position if site.lathe._poller.last else 0.0
        if position > counts and not sent:
            sent.append(line)
            site.clock.connect().receive(line)  # type: ignore[attr-defined]

    site.seen.append(see)


def test_a_home_that_is_called_in_mid_search_is_no_home() -> None:
    with opened("memory", "pmac") as site:
        site.lathe.connect()
        site.lathe.claim()
        site.lathe.enable()
        another_sends_at(site, 1000.0, b"#2HMZ\r")
        with pytest.raises(DriverError) as error:
            site.lathe.home()
        assert error.value.problems[0].code == "machine.home_ended"


def test_a_zero_that_is_set_between_two_jogs_is_found_before_the_next_one_moves() -> None:
    with opened("memory", "pmac") as site:
        site.lathe.connect()
        site.lathe.claim()
        site.lathe.enable()
        site.lathe.home()
        site.lathe.jog_to(AxisName.SPINDLE, 1234.0)
        site.clock.connect().receive(b"#2HMZ\r")  # type: ignore[attr-defined]
        site.clock.wait(0.05)
        with pytest.raises(DriverError) as error:
            site.lathe.jog_to(AxisName.CARRIAGE, 5000.0)
        found = error.value.problems[0]
        assert (found.code, found.key) == ("controller.zero_shifted", "spindle")
        site.lathe.home()
        site.lathe.jog_to(AxisName.CARRIAGE, 500.0)


@pytest.mark.parametrize(
    ("places_mm", "shifted"),
    [
        ((5.0, 5.0, 0.0), True),
        ((5.0, 5.0, 5.005, 0.0), True),  # a poll reads that much askew
        ((5.0, 5.0, 4.0), False),  # moved by hand
        ((5.0, 3.0, 0.0), False),  # moved by hand to its zero
        ((0.8, 0.8, 0.0), False),  # so may a hand, from one poll to the next
        ((0.0, 0.0, 5.0, 5.0), False),
    ],
)
def test_a_zero_that_is_set_on_an_axis_that_nothing_holds_is_found_and_a_hand_is_not_taken_for_it(
    machine: MachineProfile, places_mm: tuple[float, ...], shifted: bool
) -> None:
    held = HeldPositions(machine)
    for place_mm in (places_mm[0], *places_mm):  # the first one only says that nothing holds it
        counts = place_mm * machine.carriage.counts_per_mm
        axis = AxisState(position=counts, following_error=0.0, flags=frozenset({"activated", "home_complete"}))
        assert not axis.closed
        held.judge_poll(replace(polled(carriage=axis), program_running=False), ours=True)
    assert (set(held.shifted) == {AxisName.CARRIAGE}) is shifted


@pytest.mark.parametrize(("by", "shifted"), [("us", False), ("the controller", False), ("somebody", True)])
def test_what_we_or_the_controller_move_is_no_shift(machine: MachineProfile, by: str, shifted: bool) -> None:
    """A lost cut was taken out of the part by the controller itself."""
    held = HeldPositions(machine)
    flags = frozenset({"activated", "amplifier_enabled", "home_complete", "desired_velocity_zero"})

    def see(place_mm: float, lost: int = 0) -> None:
        axis = AxisState(place_mm * machine.carriage.counts_per_mm, following_error=0.0, flags=flags)
        held.judge_poll(replace(polled(carriage=axis), program_running=False, lost=lost), ours=True)

    for _ in range(3):
        see(5.0)
    with held.commanding() if by == "us" else nullcontext():
        see(3.0, lost=2 if by == "the controller" else 0)
    assert (AxisName.CARRIAGE in held.shifted) is shifted


@pytest.mark.parametrize("moment_um", [0.0, 12.0])
def test_what_changes_slowly_along_a_long_cut_is_no_moment(moment_um: float) -> None:
    """40 mm: the push of the cut fades over 5 mm, and friction holds back a lobe that changes its sign."""
    job = replace(JOB, overhang_mm=60.0, cut_length_mm=40.0, lobe_error_um_pp=15.0)
    lathe, chance = load_machine("lee-2001-lathe").machine, np.random.default_rng(1)
    planned = plan_cut(job, lathe, Strategy.CAM)
    setup, seen = planned.setup, PathSeen(planned, lathe)
    for number in range(int(setup.whole_turns * TURN_S / 0.05)):
        at_s = 0.05 * number
        turn = at_s / TURN_S
        z = setup.carriage_start + turn * setup.carriage_per_turn
        past_mm = (z - setup.carriage_middle) / lathe.carriage.counts_per_mm
        held_um = 3.0 * np.tanh((past_mm + 10.0) / 2.0) * np.cos(6.0 * np.pi * turn)
        off_um = held_um - 12.0 * np.exp(-(past_mm + 20.0) / 5.0) + moment_um * (30.0 <= at_s < 30.2)
        infeed_um = float(planned.target.at_um(360.0 * turn, past_mm)) + off_um + chance.normal(0.0, 0.3)
        lag_um = float(planned.command.at_um(360.0 * turn, past_mm)) - infeed_um
        tool = replace(
            commanded(setup.surface + infeed_um / lathe.tool.count_um),
            following_error=lag_um / lathe.tool.count_um,
        )
        seen.see(polled(at_s, tool=tool, spindle=commanded(turn * setup.counts_per_turn), carriage=commanded(z)))
    found_at = [each.where for each in seen.problems()]
    assert len(found_at) == (1 if moment_um else 0)
    assert all(float(each.removesuffix(" mm")) == pytest.approx(24.6, abs=0.5) for each in found_at)


THIN_JOB = load_job("lee-2001-experiment-2").job
"""8 mm at the free end of a thin tube: its lobe goes from -1 um of amplitude through none to 38."""

FOUR_JAWS = replace(load_job("lee-2001-experiment-1").job, jaws=4, lobe_jaws=4, lobe_error_um_pp=20.0)
"""8 mm at the free end of a tube in four jaws: its lobe goes from 3 um of amplitude to 18."""


def places(planned: CutPlan) -> tuple[Any, Any, Any]:
    """Carriage counts, turns and mm past the middle of the cut, of polls of all its feed."""
    setup = planned.setup
    z = setup.carriage_start + np.arange(0.0, setup.whole_turns, POLL_S / TURN_S) * setup.carriage_per_turn
    turns, past_mm = (z - setup.carriage_start) / setup.carriage_per_turn, (z - setup.carriage_middle) / PER_MM
    return z, turns, past_mm


def found_of(planned: CutPlan, off_um: Any, command_off_um: Any = 0.0) -> list[Problem]:
    """What is found of a tool that is so far further in than its target, and commanded so far off its plan."""
    z, turns, past_mm = places(planned)
    tool_um = planned.target.at_um(360.0 * turns, past_mm) + off_um
    command_um = planned.command.at_um(360.0 * turns, past_mm) + command_off_um
    seen = PathSeen(planned, MACHINE)
    for n, (at_um, told_um) in enumerate(zip(tool_um, command_um, strict=True)):
        tool = replace(
            commanded(planned.setup.surface + at_um / MACHINE.tool.count_um),
            following_error=float(told_um - at_um) / MACHINE.tool.count_um,
        )
        spindle, carriage = commanded(turns[n] * planned.setup.counts_per_turn), commanded(z[n])
        seen.see(polled(n * POLL_S, tool=tool, spindle=spindle, carriage=carriage))
    return list(seen.problems())


@pytest.mark.parametrize("lags", [False, True])
@pytest.mark.parametrize("dry_um", [0.0, 1.5])
def test_a_tool_that_is_moved_where_its_lobe_is_hardly_any_is_told(dry_um: float, lags: bool) -> None:
    """Dry friction holds back up to `dry_um` of the lobe; for 0.2 s from 0.6 mm on the tool is 5 um further in."""
    planned = plan_cut(THIN_JOB, MACHINE, Strategy.CAM)
    z, turns, past_mm = places(planned)
    lobe_um = planned.target.amplitude_um * planned.target.along.factor(3, past_mm)
    begin = planned.setup.carriage_face + 0.6 * PER_MM
    by_um = 5.0 * ((z >= begin) & (z < begin + 0.2 / TURN_S * planned.setup.carriage_per_turn))
    noise_um = np.random.default_rng(1).normal(0.0, 0.3, len(z))
    off_um = noise_um - np.clip(lobe_um, -dry_um, dry_um) * np.cos(6.0 * np.pi * turns)
    assert found_of(planned, off_um) == []
    (problem,) = found_of(planned, off_um + by_um, 0.0 if lags else by_um)
    assert problem.code == ("cut.lagged" if lags else "cut.off_path")
    assert float(problem.where.removesuffix(" mm")) == pytest.approx(0.68, abs=0.15)


@pytest.mark.parametrize("lag_um", [0.0, 12.0])
def test_a_cut_in_four_jaws_is_thrown_away_only_where_its_tool_lags(lag_um: float) -> None:
    """A tool that meets the part follows 3 um less of the lobe at first, and all of it after twelve turns or so.

    The lobe is hardly small anywhere, so friction is no reason to take its error apart into two larger ones.
    """
    planned = plan_cut(FOUR_JAWS, MACHINE, Strategy.CAM)
    z, turns, _ = places(planned)
    in_part = np.maximum((z - planned.setup.carriage_face) / planned.setup.carriage_per_turn, 0.0)
    noise_um = np.random.default_rng(1).normal(0.0, 0.3, len(z))
    yields_um = 3.0 * np.exp(-in_part / 12.0) * (in_part > 0.0) - lag_um
    problems = found_of(planned, yields_um * np.cos(8.0 * np.pi * turns) + noise_um)
    assert [each.code for each in problems] == (["cut.lobe_lagged"] if lag_um else [])
    assert all(float(each.value.removesuffix(" um")) == pytest.approx(lag_um, abs=1.0) for each in problems)
