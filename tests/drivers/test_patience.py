"""The simulator of a screen waits for a host that gets no processor, but not for one that is gone."""

from __future__ import annotations

import pytest

from drivers.pmac.heartbeat.watchdog import MARGIN_MS, PERIOD_MS, WATCHDOG_MS
from drivers.simulator.hosts.real_time import HEARD_S, TIMEOUT_S, Pace, patient

TICK_S = 0.005


class Elapsed:
    """A lathe that adds up what it is advanced by."""

    def __init__(self) -> None:
        self.simulated_s = 0.0

    def wait(self, seconds: float) -> None:
        self.simulated_s += seconds


def silence(real_s: float) -> float:
    """Return the simulated time of a host's silence."""
    lathe, now_s = Elapsed(), [0.0]
    wait = patient(lathe.wait, lambda: 0.0, lambda: now_s[0])
    while now_s[0] < real_s:
        now_s[0] += TICK_S
        wait(TICK_S)
    return lathe.simulated_s


@pytest.mark.parametrize("real_s", [0.2, 0.3, 1.0, 1.9])
def test_a_lease_outlives_a_host_that_is_held_up(real_s: float) -> None:
    assert silence(real_s) < (WATCHDOG_MS - MARGIN_MS - PERIOD_MS) / 1000.0


@pytest.mark.parametrize("speed", [0.25, 1.0, 2.0, 4.0])
def test_a_lease_outlives_one_input_in_a_few_at_any_speed(speed: float) -> None:
    """Between two renewals there are one or two other inputs, each of them held up."""
    lathe, now_s, heard_s = Elapsed(), [0.0], [0.0]
    wait = patient(lathe.wait, lambda: heard_s[0], lambda: now_s[0], Pace(speed))
    for _ in range(2 if speed > 1.0 else 1):
        heard_s[0] = now_s[0]
        until_s = now_s[0] + 1.0
        while now_s[0] < until_s:
            now_s[0] += TICK_S
            wait(TICK_S * speed)
    assert lathe.simulated_s < (WATCHDOG_MS - MARGIN_MS - PERIOD_MS) / 1000.0


def test_a_host_that_is_gone_is_not_waited_for() -> None:
    assert silence(TIMEOUT_S + 1.0) == pytest.approx(HEARD_S + 1.0, abs=3 * TICK_S)


def test_before_the_first_word_time_runs() -> None:
    lathe = Elapsed()
    patient(lathe.wait, lambda: None, lambda: 1000.0)(TICK_S)
    assert lathe.simulated_s == TICK_S


def test_the_time_that_a_lathe_waits_for_its_host_is_counted() -> None:
    lathe, now_s, pace = Elapsed(), [0.0], Pace()
    wait = patient(lathe.wait, lambda: 0.0, lambda: now_s[0], pace)
    while now_s[0] < 1.0:
        now_s[0] += TICK_S
        wait(TICK_S)
    assert pace.held_s + lathe.simulated_s == pytest.approx(1.0)
    assert pace.held_s == pytest.approx(1.0 - HEARD_S, abs=3 * TICK_S)
