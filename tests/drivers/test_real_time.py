"""Simulated time in step with real time, on a clock that is advanced by hand."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from contextlib import suppress

import pytest

from drivers.simulator.hosts.real_time import (
    MOST_CATCH_UP_S,
    SLICE_S,
    TICK_S,
    Pace,
    WallClock,
    run_clock,
)


class AllOverError(Exception):
    """The clock has run out of ticks."""


class HandClock(WallClock):
    """Wakes up as late as it is told, once for each lateness."""

    def __init__(self, late_s: Iterable[float]) -> None:
        self._late_s = iter(late_s)
        self._now_s = 100.0

    def now_s(self) -> float:
        return self._now_s

    async def sleep(self, seconds: float) -> None:
        if seconds == 0.0:
            return
        late_s = next(self._late_s, None)
        if late_s is None:
            raise AllOverError
        self._now_s += seconds + late_s


class Heard:
    """A lathe that adds up what it is advanced by, and a host that counts how often it is heard."""

    def __init__(self) -> None:
        self.slices_s: list[float] = []
        self.times = 0

    def wait(self, seconds: float) -> None:
        self.slices_s.append(seconds)

    def flush(self) -> None:
        self.times += 1


def run(late_s: list[float], speed: float = 1.0) -> tuple[Heard, list[float]]:
    heard, lags_s = Heard(), list[float]()
    with suppress(AllOverError):
        asyncio.run(run_clock(heard.wait, (heard,), HandClock(late_s), Pace(speed), lags_s))
    return heard, lags_s


@pytest.mark.parametrize("speed", [0.01, 0.5, 1.0, 7.0, 100.0])
def test_simulated_time_runs_as_many_times_as_fast(speed: float) -> None:
    heard, _ = run([0.0, 0.002, 0.0, 0.03] * 50, speed)
    assert sum(heard.slices_s) == pytest.approx(speed * (200 * TICK_S + 50 * 0.032))


@pytest.mark.parametrize("speed", [1.0, 100.0])
def test_hosts_are_heard_after_each_short_slice(speed: float) -> None:
    heard, _ = run([0.0, 0.08] * 5, speed)
    assert max(heard.slices_s) <= SLICE_S
    assert heard.times == len(heard.slices_s)


def test_a_process_that_slept_makes_up_for_a_tenth_of_a_second_and_loses_the_rest() -> None:
    heard, _ = run([0.0, 30.0, 0.0])
    assert sum(heard.slices_s) == pytest.approx(MOST_CATCH_UP_S + 2 * TICK_S)


def test_each_tick_that_comes_late_is_taken_down() -> None:
    late_s = [0.0, 0.001, 0.0, 0.25]
    _, lags_s = run(late_s)
    assert lags_s == pytest.approx(late_s, abs=1e-9)


def test_what_a_busy_computer_has_held_up_is_counted() -> None:
    """A tick that is some milliseconds late is none of it; one that is 0.5 s late is, at any speed."""
    for speed in (1.0, 2.0):
        pace = Pace(speed)
        with suppress(AllOverError):
            asyncio.run(run_clock(Heard().wait, (), HandClock([0.0, 0.004, 0.5, 0.002]), pace))
        assert pace.held_s == pytest.approx(0.5 * speed)
