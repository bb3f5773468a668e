"""When a machine counts as at rest: soon where it rests, whatever noise its scales have, never where it moves."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import t as student

from drivers.lathe.guards import ProgramGuard
from drivers.lathe.standstill import STUDENT_T, drift_and_scatter, rest_is_proven, rest_limits
from drivers.simulator.plant.true_parameters import ideal
from profiles.machine import MachineProfile
from tests.drivers.conftest import TrueBenchMaker
from tests.drivers.families import machine as machine  # both families
from tests.drivers.test_guards import LENGTHS, seen, state

LIMITS = rest_limits(LENGTHS.machine)
POLL_S = 0.2
NOISE = [0.0, 0.75, 1.5, 3.0]
"""Of the tool's scale, counts rms: 1.5 are 0.3 um of a scale with counts of 0.2 um."""


def proven_after_s(seed: int, noise: float, place: Callable[[float], float]) -> float | None:
    """Return when rest is proven of a tool at a place that depends on time, within the 15 s that a stop allows."""
    chance = np.random.default_rng(seed)
    looks = []
    for at_s in np.arange(0.0, 15.0, POLL_S):
        position = round(place(at_s) + noise * chance.standard_normal(), 1)
        looks.append(seen(float(at_s), tool=state(position)))
        if rest_is_proven(looks, LIMITS):
            return float(at_s)
    return None


@pytest.mark.parametrize("noise", NOISE)
def test_rest_is_proven_within_seconds_whatever_the_noise(noise: float) -> None:
    found = [proven_after_s(seed, noise, lambda _: 17.3) for seed in range(40)]
    slowest = max(15.0 if each is None else each for each in found)
    assert slowest <= (0.61 if noise == 0.0 else 4.0)


@pytest.mark.parametrize("noise", NOISE)
@pytest.mark.parametrize("counts_per_s", [-200.0, 20.0])
def test_an_axis_that_moves_is_not_at_rest(noise: float, counts_per_s: float) -> None:
    """20 counts/s are 4 um/s of the tool, and 0.12 rpm of the spindle."""
    assert [proven_after_s(seed, noise, lambda at_s: counts_per_s * at_s) for seed in range(20)] == [None] * 20


@pytest.mark.parametrize("noise", [1.5, 3.0])
def test_a_lucky_look_in_fifteen_seconds_hardly_ever_calls_a_slow_drift_rest(noise: float) -> None:
    """10 counts/s are twice the limit, and below the noise from poll to poll."""
    found = [proven_after_s(seed, noise, lambda at_s: 10.0 * at_s) for seed in range(100)]
    assert sum(each is not None for each in found) <= 2


@pytest.mark.parametrize("frequency_hz", [0.5, 1.3, 2.4, 4.4, 7.7, 12.3, 26.0, 40.0])
def test_an_axis_that_swings_is_not_at_rest(frequency_hz: float) -> None:
    """By 50 counts about one place: a loop that hunts. Its mean drift is none.

    Not told: one that swings in step with the polls, to a hundredth of a second.
    """
    chance = np.random.default_rng(7)
    for _ in range(10):
        phase = chance.uniform(0.0, 2 * np.pi)
        late_s = iter(chance.uniform(0.0, 0.01, 80))

        def place(at_s: float, phase: float = phase, late_s: Iterator[float] = late_s) -> float:
            return 50.0 * float(np.sin(2 * np.pi * frequency_hz * (at_s + next(late_s)) + phase))

        assert proven_after_s(1, 0.0, place) is None


def test_one_axis_that_moves_is_enough() -> None:
    looks = [seen(POLL_S * n, carriage=state(100.0 * n)) for n in range(12)]
    assert not rest_is_proven(looks, LIMITS)
    assert not rest_is_proven(looks[:1] * 12, LIMITS), "one look that is shown twelve times proves nothing"


@given(
    positions=st.lists(st.integers(-100_000, 100_000), min_size=4, max_size=12),
    late_s=st.lists(st.floats(0.0, 0.1), min_size=12, max_size=12),
)
def test_the_bound_is_that_of_linear_regression(positions: list[int], late_s: list[float]) -> None:
    times_s = [POLL_S * number + late for number, late in zip(range(len(positions)), late_s, strict=False)]
    (slope, _), covariance = np.polyfit(times_s, positions, 1, cov=True)
    expected = abs(slope) + student.ppf(0.975, len(positions) - 2) * np.sqrt(max(covariance[0, 0], 0.0))
    assert drift_and_scatter(times_s, positions)[0] == pytest.approx(expected, rel=1e-3, abs=1e-3)


def test_the_quantiles_are_those_of_student() -> None:
    assert STUDENT_T == pytest.approx(student.ppf(0.975, np.arange(2, 11)), abs=5e-4)


def test_a_stop_of_a_lathe_with_a_noisy_scale_is_proven_in_seconds(
    machine: MachineProfile, bench_with: TrueBenchMaker
) -> None:
    made = bench_with(replace(ideal(machine), encoder_noise_um=0.3))
    made.lathe.enable()
    for _ in range(5):
        made.stop.stop("operator")
        began_s = made.sim.now_s()
        made.lathe.wait_for_rest()
        assert made.sim.now_s() - began_s < 4.0
        made.stop.release()


@pytest.mark.parametrize("poll_s", [0.05, 0.2, 0.34])
@pytest.mark.parametrize("noise", NOISE)
def test_a_program_on_a_noisy_scale_that_is_held_is_stalled(noise: float, poll_s: float) -> None:
    """It is the only thing that tells of a spindle at standstill, where the program follows the spindle."""
    for seed in range(10):
        chance = np.random.default_rng(seed)
        guard = ProgramGuard(LENGTHS, real_time=False)
        places = noise * chance.standard_normal(round(8.0 / poll_s))
        told = [guard(seen(poll_s * n, tool=state(round(at, 1)))) for n, at in enumerate(places)]
        first = next(n for n, problems in enumerate(told) if problems)
        assert 1.0 <= poll_s * first <= (1.4 if noise == 0.0 else 6.0)


def test_a_fine_scale_has_its_noise_in_more_counts() -> None:
    """0.3 um are 6 counts of 0.05 um: such an axis comes to rest as well."""
    tool = replace(LENGTHS.machine.tool, counts_per_mm=20_000.0)
    limits = rest_limits(replace(LENGTHS.machine, tool=tool))
    chance = np.random.default_rng(5)
    looks = [seen(POLL_S * n, tool=state(6.0 * chance.standard_normal())) for n in range(12)]
    assert rest_is_proven(looks, limits) and not rest_is_proven(looks, LIMITS)
