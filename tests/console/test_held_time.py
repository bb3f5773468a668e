"""A simulated lathe whose computer is busy holds its time: it is said once, and nobody is accused of it."""

from __future__ import annotations

from dataclasses import replace
from itertools import count
from typing import Any

import pytest

from console.session.station.alarms import Priority
from console.session.station.commands import Start
from drivers.lathe import heartbeat
from drivers.lathe.heartbeat import RATE, RATE_READINGS
from drivers.simulator.plant.workshop_view import WorkshopView
from profiles.problem import Problem
from tests.console.floor import Floor, experiment_1, in_turn


def holding(floor: Floor, held_s: list[float]) -> None:
    """Have the lathe report this much held time."""
    look = floor.sim.look

    def held() -> WorkshopView:
        return replace(look(), held_s=held_s[0])

    floor.sim.look = held  # type: ignore[method-assign]


def test_time_that_is_held_in_a_cut_is_told_once_and_the_part_is_good(aligned: Floor) -> None:
    held_s = [0.0]
    holding(aligned, held_s)
    aligned.arm(experiment_1())
    aligned.when(lambda _: in_turn(aligned, 5.0), lambda: held_s.__setitem__(0, 1.2))
    aligned.do(Start())
    assert aligned.state.cut_done
    (alarm,) = aligned.idle().alarms
    assert (alarm.problem.code, alarm.problem.value) == ("simulator.held", "1.2 s")
    assert (alarm.priority, alarm.count) == (Priority.LOW, 1)


def test_time_that_is_held_at_rest_is_not_mentioned(aligned: Floor) -> None:
    held_s = [0.0]
    holding(aligned, held_s)
    aligned.idle(2.0)
    held_s[0] = 3.0
    assert aligned.idle(2.0).alarms == ()


@pytest.mark.parametrize("held", [True, False])
def test_the_rate_of_a_watchdog_is_not_judged_while_time_is_held(
    aligned: Floor, held: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    readings = count()

    def read(*_: Any) -> Any:
        next(readings)

    monkeypatch.setattr(heartbeat, "read_heartbeat", read)
    monkeypatch.setattr(heartbeat, "heartbeat_problems", lambda *_: (Problem(code=RATE),))
    times = count()
    held_s = (lambda: float(next(times))) if held else None
    guard = heartbeat.Heartbeat(aligned.lathe._client, aligned.sim, aligned.context.machine, held_s=held_s)
    _, problems = guard._looked()
    assert [problem.code for problem in problems] == ([] if held else [RATE])
    assert next(readings) == RATE_READINGS
