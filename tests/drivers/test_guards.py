"""What a poll of a machine in motion is judged by: the wrong way, too far, another axis, held, reset, open."""

from __future__ import annotations

from dataclasses import replace

import pytest

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
from drivers.lathe.lengths import Lengths
from drivers.lathe.snapshot import AxisName, AxisState, Snapshot
from profiles.store import load_machine

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
def test_a_jog_beyond_its_target_or_the_wrong_way_is_reported_with_both(
    begin: float, end: float, at: float
) -> None:
    (problem,) = jog(begin, end)(seen(tool=state(at)))
    assert (problem.code, problem.key, problem.value) == ("machine.jog_astray", "tool", f"{at / 5000.0:.4f} mm")
    assert problem.limit == f"{begin / 5000.0:.4f} to {end / 5000.0:.4f} mm"


def test_it_is_the_commanded_position_that_counts() -> None:
    """An axis that lags is not astray, and one that is commanded beyond its target is, before it gets there."""
    assert codes(jog(0.0, 5000.0)(seen(tool=state(4000.0, following_error=1500.0)))) == ["machine.jog_astray"]
    assert jog(0.0, 5000.0)(seen(tool=state(5200.0, following_error=-200.0))) == ()


def test_another_axis_that_moves_during_a_jog_is_reported() -> None:
    (problem,) = jog(0.0, 5000.0)(seen(tool=state(100.0), carriage=state(60.0)))
    assert (problem.code, problem.key) == ("machine.unexpected_motion", "carriage")


@pytest.mark.parametrize("percent", [0.0, 50.0, 99.0, 101.0])
def test_any_override_but_real_time_is_no_cut(percent: float) -> None:
    assert codes(ProgramGuard(LENGTHS)(seen(percent=percent))) == ["cut.override"]
    assert ProgramGuard(LENGTHS, real_time=False)(seen(percent=percent)) == ()
    assert ProgramGuard(LENGTHS)(seen(percent=percent, running=False)) == ()


def test_an_axis_outside_the_plan_is_reported_with_the_planned_range() -> None:
    guard = ProgramGuard(LENGTHS, [AxisRange(axis=AxisName.CARRIAGE, low=-10.0, high=1000.0)])
    assert guard(seen(carriage=state(1000.0))) == ()
    (problem,) = guard(seen(carriage=state(1001.0)))
    assert (problem.code, problem.key, problem.limit) == ("cut.outside_plan", "carriage", "-0.010 to 1.000 mm")


def test_an_axis_that_coasts_with_its_loop_open_is_commanded_nowhere() -> None:
    """That its loop is open is what is wrong, and is told by itself."""
    coasting = seen(tool=state(9000.0, OFF), carriage=state(9000.0, OFF))
    assert jog(0.0, 5000.0)(coasting) == ()
    assert ProgramGuard(LENGTHS, [AxisRange(axis=AxisName.CARRIAGE, low=-10.0, high=1000.0)])(coasting) == ()
    problem = open_loop_problem(coasting)
    assert problem is not None and problem.key == "tool, carriage"


def test_a_program_that_runs_and_moves_nothing_is_stalled_after_a_second() -> None:
    guard, step_s = ProgramGuard(LENGTHS), STALLED_S / 4.0
    told = [codes(guard(seen(number * step_s))) for number in range(6)]
    assert told == [[], [], [], [], ["cut.stalled"], ["cut.stalled"]]


def test_a_turning_spindle_is_no_stall() -> None:
    guard = ProgramGuard(LENGTHS)
    assert all(guard(seen(number * 0.4, spindle=state(10.0 * number))) == () for number in range(10))


def test_a_program_that_has_ended_is_no_stall() -> None:
    guard = ProgramGuard(LENGTHS)
    assert all(guard(seen(number * 0.4, running=False)) == () for number in range(10))


def test_a_controller_without_any_home_and_with_open_loops_was_reset() -> None:
    off = state(0.0, OFF)
    problem = reset_problem(frozenset(AxisName), seen(tool=off, spindle=off, carriage=off))
    assert problem is not None and problem.code == "controller.was_reset"


def test_one_home_that_is_lost_is_named_and_nothing_is_said_of_those_that_were_never_there() -> None:
    lost = seen(carriage=state(0.0, CLOSED - {"home_complete"}))
    problem = reset_problem(frozenset(AxisName), lost)
    assert problem is not None and (problem.code, problem.key) == ("controller.home_lost", "carriage")
    assert reset_problem(frozenset(), lost) is None


def test_a_loop_that_opens_is_named_and_one_of_an_inverter_is_not_looked_at() -> None:
    opened = seen(spindle=state(0.0, OFF))
    problem = open_loop_problem(opened)
    assert problem is not None and (problem.code, problem.key) == ("machine.loop_open", "spindle")
    assert open_loop_problem(replace(opened, driven=(AxisName.TOOL, AxisName.CARRIAGE))) is None


@pytest.mark.parametrize(
    ("moving", "program", "key"),
    [(("carriage",), False, "carriage"), (("spindle", "tool"), True, "tool, spindle"), ((), True, "program")],
)
def test_a_motion_that_nobody_here_asked_for_is_told_with_what_moves(
    moving: tuple[str, ...], program: bool, key: str
) -> None:
    resting = CLOSED | {"desired_velocity_zero", "in_position"}
    axes = {
        name: state(0.0, flags=CLOSED if name in moving else resting) for name in ("tool", "spindle", "carriage")
    }
    tool, spindle, carriage = axes.values()
    problem = unasked_motion(seen(running=program, tool=tool, spindle=spindle, carriage=carriage))
    assert problem is not None and (problem.code, problem.key) == ("machine.moves_unasked", key)
    still = state(0.0, flags=resting)
    assert unasked_motion(seen(running=False, tool=still, spindle=still, carriage=still)) is None
