"""The filters beside the Gaussian, against their published equations, written down here in another way."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from profiles.arrays import Floats
from profiles.metrology.points import gaussian_filter
from profiles.metrology.profile_filters import FilterKind, filter_profile, transmission
from profiles.problem import ProfileError
from profiles.roundness import evaluate

COUNT = 3600
TURN = 2.0 * np.pi * np.arange(COUNT) / COUNT
CUTOFFS = (15.0, 50.0, 150.0, 500.0)


def passed(kind: FilterKind, n: int, cutoff_upr: float) -> complex:
    """Return what is left of cos(n angle), as amplitude and lag: by the sum over the turn."""
    found = filter_profile(np.cos(n * TURN), kind, cutoff_upr)
    return complex(2.0 * np.mean(found * np.exp(-1j * n * TURN)))


@pytest.mark.parametrize("cutoff_upr", CUTOFFS)
@pytest.mark.parametrize(
    ("kind", "share"),
    [(FilterKind.GAUSS, 0.5), (FilterKind.SPLINE, 0.5), (FilterKind.ROBUST, 0.5), (FilterKind.TWO_RC, 0.75)],
)
def test_each_passes_at_its_cut_off_what_its_standard_says(
    kind: FilterKind, share: float, cutoff_upr: float
) -> None:
    at = int(cutoff_upr)
    assert abs(complex(transmission(kind, at, cutoff_upr, COUNT))) == pytest.approx(share, abs=2e-5)
    if kind is not FilterKind.ROBUST:  # whose weights make a sine of large residuals another one: see below
        assert abs(passed(kind, at, cutoff_upr)) == pytest.approx(share, abs=1e-9)
    assert abs(passed(kind, 1, cutoff_upr)) == pytest.approx(1.0, abs=0.005)


def test_the_spline_solves_the_equation_of_iso_16610_22() -> None:
    """(1 + alpha^4 Q) w = z: Q has the rows 1 -4 6 -4 1, closed round the turn."""
    count, cutoff_upr = 120, 9.0
    profile = np.random.default_rng(3).normal(0.0, 1.0, count)
    row = np.zeros(count)
    row[[0, 1, 2, -1, -2]] = 6.0, -4.0, 1.0, -4.0, 1.0
    q = np.stack([np.roll(row, place) for place in range(count)])
    alpha = 1.0 / (2.0 * math.sin(math.pi * cutoff_upr / count))
    line = np.linalg.solve(np.eye(count) + alpha**4 * q, profile)
    assert filter_profile(profile, FilterKind.SPLINE, cutoff_upr) == pytest.approx(line, abs=1e-9)


def test_the_spline_falls_with_the_fourth_power_far_below_half_of_the_points() -> None:
    for n in (15, 30, 100, 150):
        expected = 1.0 / (1.0 + (n / 50.0) ** 4)
        assert abs(passed(FilterKind.SPLINE, n, 50.0)) == pytest.approx(expected, rel=0.03)


def test_2rc_is_two_rc_stages_one_after_the_other() -> None:
    """Each follows its input by y' = (x - y) / tau, run over turns until it repeats."""
    cutoff_upr, signal = 15.0, np.cos(15 * TURN) + 0.4 * np.sin(3 * TURN + 0.3)
    step, tau = TURN[1], 1.0 / (math.sqrt(3.0) * cutoff_upr)
    fade = math.exp(-step / tau)
    stages = [np.zeros(COUNT), np.zeros(COUNT)]
    for _turn in range(2):
        read: NDArray[np.float64] = signal
        for stage in stages:
            y = stage[-1]
            for place in range(COUNT):
                y = fade * y + (1.0 - fade) * 0.5 * (read[place] + read[place - 1])
                stage[place] = y
            read = stage
    assert filter_profile(signal, FilterKind.TWO_RC, cutoff_upr) == pytest.approx(stages[1], abs=1e-3)


def regression_line(profile: Floats, cutoff_upr: float, rounds: int) -> Floats:
    """Return the robust line of ISO 16610-31, degree 2, point by point with least squares of weighted rows."""
    count = profile.size
    trust, line = np.ones(count), np.zeros(count)
    for _ in range(rounds):
        for place in range(count):
            apart = (np.arange(count) - place + count // 2) % count - count // 2
            x = apart * cutoff_upr / count  # in wavelengths of the cut-off
            root = np.sqrt(np.exp(-math.pi * (x / 0.7309) ** 2) * trust)
            columns = np.stack([np.ones(count), x, x**2], axis=1) * root[:, None]
            line[place] = np.linalg.lstsq(columns, profile * root, rcond=None)[0][0]
        off = np.abs(profile - line)
        limit = 4.4478 * np.median(off)
        trust = np.where(off <= limit, (1.0 - (off / limit) ** 2) ** 2, 0.0)
    return line


def test_the_robust_filter_is_the_weighted_regression_of_iso_16610_31() -> None:
    rng = np.random.default_rng(5)
    turn = 2.0 * np.pi * np.arange(120) / 120
    profile = 3.0 * np.cos(3 * turn) + rng.normal(0.0, 0.2, 120)
    profile[[20, 21, 77]] -= (12.0, 9.0, 15.0)
    expected = regression_line(profile, 9.0, 40)
    assert filter_profile(profile, FilterKind.ROBUST, 9.0) == pytest.approx(expected, abs=1e-3)


def test_a_scratch_draws_the_gaussian_line_and_not_the_robust_one() -> None:
    part = 2.0 * np.cos(3 * TURN) + np.random.default_rng(1).normal(0.0, 0.05, COUNT)
    scratched = part.copy()
    scratched[1000:1012] -= 20.0  # 1.2 deg wide; one undulation of the cut-off is 7.2 deg
    drawn = [
        float(np.abs(filter_profile(scratched, kind, 50.0) - filter_profile(part, kind, 50.0)).max())
        for kind in (FilterKind.GAUSS, FilterKind.ROBUST)
    ]
    assert drawn[0] > 4.0 and drawn[1] < 0.1
    angle = np.degrees(TURN)
    robust = evaluate(angle, scratched, 50.0, filter_kind=FilterKind.ROBUST)
    assert robust.ront_um == pytest.approx(4.0, abs=0.2)
    assert (robust.filter_kind, robust.filter_upr) == (FilterKind.ROBUST, 50.0)
    assert evaluate(angle, scratched, 50.0).ront_um > 6.0


def test_the_gaussian_one_is_as_before_and_what_no_filter_can_do_is_refused() -> None:
    profile = np.cos(7 * TURN)
    assert filter_profile(profile, FilterKind.GAUSS, 50.0) == pytest.approx(gaussian_filter(profile, 50.0))
    band = filter_profile(profile, FilterKind.SPLINE, 50.0, 7.0)
    assert band == pytest.approx(0.5 * profile, abs=2e-3)
    for cutoff_upr in (0.0, math.nan, COUNT):
        with pytest.raises(ProfileError) as caught:
            filter_profile(profile, FilterKind.SPLINE, cutoff_upr)
        assert caught.value.problems[0].key == "filter_upr"
