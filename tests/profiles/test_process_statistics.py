"""Statistics of parts in a row, against published examples and tables, and scipy's own distributions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from profiles.arrays import Floats
from profiles.metrology.process_statistics import (
    LEAST_CHART,
    LEAST_PARTS,
    LEAST_TREND,
    capability_below,
    capability_within,
    run_chart,
    trend,
)


def sample(count: int, mean: float, sd: float) -> Floats:
    """Values with exactly this mean and standard deviation."""
    values = np.random.default_rng(count).normal(size=count)
    values -= values.mean()
    return np.asarray(mean + sd * values / values.std(ddof=1))


def test_the_individuals_chart_is_that_of_the_handbook() -> None:
    """NIST/SEMATECH e-Handbook, 6.3.2.2: flow rates of ten batches."""
    flow = [49.6, 47.6, 49.9, 51.3, 47.8, 51.2, 52.6, 52.4, 53.6, 52.1]
    chart = run_chart(flow)
    assert chart is not None
    assert (round(chart.mean, 2), round(chart.moving_range, 4)) == (50.81, 1.8778)
    assert (round(chart.lower, 4), round(chart.upper, 4)) == (45.8159, 55.8041)
    assert chart.beyond == ()
    outside = run_chart([*flow, 60.0])
    assert outside is not None and outside.beyond == (10,)
    assert run_chart(flow[: LEAST_CHART - 1]) is None


def test_two_limits_give_the_indices_of_the_handbook_and_intervals_by_the_tables() -> None:
    """6.1.6: limits 8 and 20, mean 16, standard deviation 2; chi-square with 29 degrees: 16.047 and 45.722."""
    found = capability_within(sample(30, 16.0, 2.0), 8.0, 20.0)
    assert found is not None and found.cp is not None and found.cp_low is not None and found.cp_high is not None
    assert (round(found.cp, 4), round(found.cpk, 4), found.parts) == (1.0, 0.6667, 30)
    assert found.cp_low == pytest.approx(math.sqrt(16.047 / 29), abs=1e-4)
    assert found.cp_high == pytest.approx(math.sqrt(45.722 / 29), abs=1e-4)
    half = 1.95996 * math.sqrt(1 / (9 * 30) + 0.66667**2 / (2 * 29))
    assert (found.cpk - found.cpk_low, found.cpk_high - found.cpk) == pytest.approx((half, half), abs=1e-4)


@pytest.mark.parametrize(("count", "factor"), [(30, 3.064), (50, 2.862), (100, 2.684)])
def test_one_limit_gives_the_tolerance_factors_of_the_tables(count: int, factor: float) -> None:
    """One-sided normal tolerance limits, 95 % confidence that 99 % lie below (Owen): z = 2.3263 is the bound."""
    found = capability_below(sample(count, 0.0, 1.0), upper=factor, confidence=0.90)
    assert found is not None and found.cpk == pytest.approx(factor / 3.0)
    assert found.cpk_low == pytest.approx(2.3263 / 3.0, abs=3e-4)
    assert found.cp is None


@pytest.mark.parametrize("upper", [-2.0, 0.0, 0.5, 4.0, 40.0])
def test_the_interval_of_one_limit_is_that_of_the_noncentral_t(upper: float) -> None:
    from scipy.stats import nct

    found = capability_below(sample(40, 0.0, 1.0), upper)
    assert found is not None and found.cpk_low < found.cpk < found.cpk_high
    root = math.sqrt(40)
    for bound, probability in ((found.cpk_low, 0.975), (found.cpk_high, 0.025)):
        # Mirrored, which is the same: for negative values the function fails.
        side, above = (1.0, probability) if upper >= 0.0 else (-1.0, 1.0 - probability)
        assert nct.cdf(side * upper * root, 39, side * 3.0 * bound * root) == pytest.approx(above, abs=1e-6)


def test_of_few_parts_or_of_equal_ones_no_capability_is_claimed() -> None:
    few, same = sample(LEAST_PARTS - 1, 1.0, 0.1), np.ones(LEAST_PARTS)
    for values in (few, same):
        assert capability_below(values, 5.0) is None
        assert capability_within(values, 0.0, 5.0) is None


def test_the_interval_holds_the_truth_as_often_as_it_says() -> None:
    """Of 400 processes with Cpk 1.2, 19 of 20 within, give or take what chance may do (3 sd of a binomial)."""
    random = np.random.default_rng(7)
    inside = 0
    for _ in range(400):
        found = capability_below(random.normal(0.0, 1.0, 30), 3.6)
        assert found is not None
        inside += found.cpk_low <= 1.2 <= found.cpk_high
    assert abs(inside / 400 - 0.95) < 3.0 * math.sqrt(0.95 * 0.05 / 400)


def test_a_trend_is_that_of_linear_regression() -> None:
    from scipy.stats import linregress, t

    values = 0.3 * np.arange(12) + np.random.default_rng(3).normal(size=12)
    found, other = trend(values), linregress(np.arange(12), values)
    assert found is not None and found.significant
    assert found.per_part == pytest.approx(other.slope)
    assert found.half_width == pytest.approx(t.ppf(0.975, 10) * other.stderr)
    flat = trend([1.0, 3.0, 2.0, 3.0, 1.0])
    assert flat is not None and flat.per_part == pytest.approx(0.0) and not flat.significant
    assert trend(values[: LEAST_TREND - 1]) is None


@pytest.mark.parametrize("values", [[[1.0, 2.0]], [1.0, math.nan], [1.0, math.inf]])
def test_what_is_no_row_of_numbers_is_refused(values: list[float]) -> None:
    with pytest.raises(ValueError, match="finite"):
        run_chart(values)
