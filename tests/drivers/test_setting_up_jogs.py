"""Jogs of an operator: finite steps, only at rest, only within the travel; the retract only goes outwards."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from drivers.errors import DriverError
from drivers.lathe.lathe import Lathe
from drivers.lathe.lengths import settings_of
from drivers.lathe.snapshot import AxisName
from drivers.lathe.stop import StoppedError
from profiles.machine import MachineProfile
from profiles.problem import Problem
from tests.drivers.families import machine as machine

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench

BACKGROUND_MS = 5.0
LINK_MS = 50.0


def refusal(act: Callable[[], object]) -> Problem:
    with pytest.raises(DriverError) as refused:
        act()
    return refused.value.problems[0]


def overrun_counts(machine: MachineProfile, axis: AxisName) -> float:
    """How far a jog at its speed runs on after a stop."""
    settings = settings_of(machine, axis)
    return (
        settings.stopping_distance(settings.jog_speed, (BACKGROUND_MS + LINK_MS) / 1000.0)
        * settings.counts_per_unit
    )


def places(bench: Bench) -> list[float]:
    return [motor.desired for motor in bench.sim.controller.motors.values()]


def test_steps_add_up_without_an_error(closed: Bench) -> None:
    """The step starts from where the axis is commanded to be, not from where the loop happens to hold it."""
    closed.lathe.home()
    start = closed.sim.controller.motors[1].desired
    for _ in range(5):
        closed.lathe.jog_by(AxisName.TOOL, 7.0)
    assert closed.sim.controller.motors[1].desired - start == pytest.approx(35.0, abs=0.01)
    closed.lathe.jog_by(AxisName.SPINDLE, -2_500.0)
    closed.lathe.jog_by(AxisName.SPINDLE, 2_500.0)
    assert closed.sim.controller.motors[2].desired == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(
    ("axis", "counts", "limit"),
    [
        (AxisName.TOOL, -10_010.0, ">= -2.0000 mm"),
        (AxisName.TOOL, 375_010.0, "<= 75.0000 mm"),
        (AxisName.CARRIAGE, -5_010.0, ">= -5.000 mm"),
        (AxisName.CARRIAGE, 199_010.0, "<= 199.000 mm"),
    ],
)
def test_a_step_beyond_the_travel_is_refused_and_nothing_moves(
    closed: Bench, axis: AxisName, counts: float, limit: str
) -> None:
    closed.lathe.home()
    before = places(closed)
    problem = refusal(lambda: closed.lathe.jog_by(axis, counts))
    assert (problem.code, problem.key, problem.limit) == ("machine.beyond_travel", axis, limit)
    closed.sim.wait(0.5)
    assert places(closed) == before


def test_a_rotary_spindle_has_no_end_of_travel(closed: Bench) -> None:
    closed.lathe.jog_by(AxisName.SPINDLE, 30_000.0)
    closed.lathe.jog_by(AxisName.SPINDLE, -60_000.0)
    assert closed.lathe.snapshot().spindle.position == pytest.approx(-30_000, abs=1)


JOGS: list[Callable[[Lathe], None]] = [
    lambda lathe: lathe.jog_by(AxisName.CARRIAGE, 100.0),
    lambda lathe: lathe.retract(-500.0),
]


@pytest.mark.parametrize("jog", JOGS)
def test_a_jog_is_refused_while_something_moves(closed: Bench, jog: Callable[[Lathe], None]) -> None:
    closed.client.request("#2J+")
    closed.sim.wait(0.5)
    assert refusal(lambda: jog(closed.lathe)).code == "machine.moving"
    assert closed.sim.controller.motors[2].velocity > 0, "what moves is not disturbed"


@pytest.mark.parametrize("jog", JOGS)
def test_a_jog_does_not_switch_a_drive_on(bench: Bench, jog: Callable[[Lathe], None]) -> None:
    assert refusal(lambda: jog(bench.lathe)).code == "machine.not_enabled"
    assert not any(motor.enabled for motor in bench.sim.controller.motors.values())


@pytest.mark.parametrize("jog", JOGS)
def test_a_jog_is_refused_after_a_stop(closed: Bench, jog: Callable[[Lathe], None]) -> None:
    closed.client.request("#2J+")
    closed.sim.wait(0.5)
    closed.lathe.snapshot()
    closed.stop.stop("operator")
    with pytest.raises(StoppedError):
        jog(closed.lathe)


def test_the_retract_goes_out_and_never_in(closed: Bench) -> None:
    closed.lathe.home()
    closed.lathe.jog_to(AxisName.TOOL, 20_000.0)
    problem = refusal(lambda: closed.lathe.retract(20_100.0))
    assert (problem.code, problem.key, problem.value) == ("machine.retract_direction", "tool", "4.0200 mm")
    assert closed.lathe.snapshot().tool.position == pytest.approx(20_000, abs=4)
    closed.lathe.retract(10_000.0)
    assert closed.lathe.snapshot().tool.position == pytest.approx(10_000, abs=4)
    # Where it already stands, a count of noise is no reason to complain, nor to move.
    closed.sim.wait(1.0)
    commanded = closed.sim.controller.motors[1].desired
    closed.lathe.retract(10_003.0)
    assert closed.sim.controller.motors[1].desired == commanded


def test_after_a_stop_in_the_part_the_tool_can_be_taken_out(closed: Bench) -> None:
    closed.lathe.home()
    closed.lathe.jog_to(AxisName.TOOL, 5_000.0)
    closed.client.request("#1J=60000")
    closed.sim.wait(0.5)
    closed.lathe.snapshot()
    closed.stop.stop("operator")
    closed.lathe.wait_for_rest()
    closed.stop.release()
    closed.lathe.retract(5_000.0)
    assert closed.lathe.snapshot().tool.position == pytest.approx(5_000, abs=4)


@pytest.mark.parametrize(
    ("axis", "speed", "rate"),
    [(AxisName.TOOL, 50.0, 40.0), (AxisName.SPINDLE, 16.667, 0.5), (AxisName.CARRIAGE, 10.0, 0.5)],
)
def test_the_overrun_is_the_late_stop_and_the_ramp(
    closed: Bench, axis: AxisName, speed: float, rate: float
) -> None:
    expected = speed * (BACKGROUND_MS + LINK_MS) + speed**2 / (2 * rate)
    assert overrun_counts(closed.lathe.machine, axis) == pytest.approx(expected)


def test_an_axis_that_never_ramps_down_has_no_end_of_its_overrun(closed: Bench) -> None:
    machine = closed.lathe.machine
    variables = {**machine.controller.variables, "I315": 0.0}
    soft = replace(machine, controller=replace(machine.controller, variables=variables))
    assert overrun_counts(soft, AxisName.CARRIAGE) == float("inf")


@pytest.mark.parametrize("motor", [1, 2, 3])
def test_a_stop_in_mid_jog_runs_on_by_less_than_the_overrun(closed: Bench, motor: int) -> None:
    """The link of the bench is quick: of the 50 ms only those that are waited here are used."""
    closed.client.request(f"#{motor}J+")
    closed.sim.wait(1.0)
    closed.lathe.snapshot()
    pressed = closed.sim.controller.motors[motor].desired
    closed.sim.wait(LINK_MS / 1000.0 - 0.005)
    closed.stop.stop("operator")
    closed.lathe.wait_for_rest()
    went = closed.sim.controller.motors[motor].desired - pressed
    bound = overrun_counts(closed.lathe.machine, list(AxisName)[motor - 1])
    assert 0.8 * bound < went <= bound


def test_loops_that_a_kill_of_ours_opens_are_nobody_elses_doing(
    closed: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The key thread sends it between the decision to look and the look."""
    closed.lathe.home()
    request = closed.client.request

    def with_a_kill(line: str, *more: object, **words: object) -> tuple[str, ...]:
        if line.startswith("#1P") and closed.sim.controller.motors[3].jogging and closed.stop.reason is None:
            closed.stop.kill("F9")
        return request(line, *more, **words)  # type: ignore[arg-type]

    monkeypatch.setattr(closed.client, "request", with_a_kill)
    with pytest.raises(StoppedError, match="F9"):
        closed.lathe.jog_by(AxisName.CARRIAGE, 20_000.0)
