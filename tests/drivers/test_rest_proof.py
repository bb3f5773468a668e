"""When a machine counts as at rest: soon where it rests, whatever noise its scales have, never where it moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import t as student

from drivers.lathe.drift import STUDENT_T, drift_bound_counts_per_s, rest_is_proven
from drivers.lathe.guards import ProgramGuard
from drivers.simulator.plant.true_parameters import ideal
from profiles.machine import MachineProfile
from tests.drivers.conftest import TrueBenchMaker
from tests.drivers.families import machine as machine  # both families
from tests.drivers.test_guards import LENGTHS, codes, seen, state

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
        if rest_is_proven(looks):
            return float(at_s)
    return None


@pytest.mark.parametrize("noise", NOISE)
def test_rest_is_proven_within_seconds_whatever_the_noise(noise: float) -> None:
    found = [proven_after_s(seed, noise, lambda _: 17.3) for seed in range(40)]
    slowest = max(15.0 if each is None else each for each in found)
    assert slowest <= (0.61 if noise == 0.0 else 3.0)


@pytest.mark.parametrize("noise", NOISE)
@pytest.mark.parametrize("counts_per_s", [-200.0, 20.0])
def test_an_axis_that_moves_is_not_at_rest(noise: float, counts_per_s: float) -> None:
    """20 counts/s are 4 um/s of the tool, and 0.12 rpm of the spindle."""
    assert [proven_after_s(seed, noise, lambda at_s: counts_per_s * at_s) for seed in range(20)] == [None] * 20


@pytest.mark.parametrize("period_s", [0.3, 0.8, 3.0])
def test_an_axis_that_swings_is_not_at_rest(period_s: float) -> None:
    """By 100 counts about one place: a loop that hunts. Its mean drift is none."""
    assert proven_after_s(1, 0.0, lambda at_s: 100.0 * float(np.sin(2 * np.pi * (at_s / period_s + 0.1)))) is None


def test_one_axis_that_moves_is_enough() -> None:
    looks = [seen(POLL_S * n, carriage=state(100.0 * n)) for n in range(12)]
    assert not rest_is_proven(looks)
    assert not rest_is_proven(looks[:1] * 12), "one look that is shown twelve times proves nothing"


@given(
    positions=st.lists(st.integers(-100_000, 100_000), min_size=4, max_size=12),
    late_s=st.lists(st.floats(0.0, 0.1), min_size=12, max_size=12),
)
def test_the_bound_is_that_of_linear_regression(positions: list[int], late_s: list[float]) -> None:
    times_s = [POLL_S * number + late for number, late in zip(range(len(positions)), late_s, strict=False)]
    (slope, _), covariance = np.polyfit(times_s, positions, 1, cov=True)
    expected = abs(slope) + student.ppf(0.975, len(positions) - 2) * np.sqrt(max(covariance[0, 0], 0.0))
    assert drift_bound_counts_per_s(times_s, positions) == pytest.approx(expected, rel=1e-3, abs=1e-3)


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


def test_a_program_on_a_noisy_scale_that_is_held_is_stalled() -> None:
    """It is the only thing that tells of a spindle at standstill, where the program follows the spindle."""
    chance = np.random.default_rng(3)
    guard = ProgramGuard(LENGTHS, real_time=False)
    places = 1.5 * chance.standard_normal(80)
    told = [codes(guard(seen(0.05 * n, tool=state(round(at, 1))))) for n, at in enumerate(places)]
    assert told[:20] == [[]] * 20, "a second has not passed"
    assert told.count(["cut.stalled"]) > 40
