"""Force by torque: the line, its confidence and the way back, against repeated experiments."""

from __future__ import annotations

import math
from dataclasses import asdict, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from profiles.calibration.wrench import WrenchFit, fit_wrench
from profiles.problem import ProfileError
from profiles.strict_values import record

Floats = NDArray[np.float64]

TORQUE = np.repeat([10.0, 20.0, 30.0, 40.0, 50.0], 3)
SLOPE = 2 * math.pi * 0.12 * 4 / 0.008
"""Scroll chuck: 2 pi eta i / p with eta 0.12, i 4, p 8 mm: 50 N m give 18.8 kN."""


def refused(torque: object, force: object) -> tuple[str, str]:
    with pytest.raises(ProfileError) as caught:
        fit_wrench(torque, force)  # type: ignore[arg-type]
    return caught.value.problems[0].code, caught.value.problems[0].key


def test_the_line_is_surer_than_the_next_clamping_and_its_scatter_is_a_share() -> None:
    """Through the origin at one torque T: the line is +- t s T / sqrt(sum T^2) where the scatter is the same."""
    from scipy.stats import t as student_t

    torque = np.array([10.0, 20.0, 20.0, 30.0, 40.0])
    force = 100.0 * torque + np.array([30.0, -20.0, 10.0, -40.0, 25.0])
    slope = float(torque @ force) / float(torque @ torque)
    sd = math.sqrt(float(np.sum((force - slope * torque) ** 2)) / 4)
    half = float(student_t.ppf(0.975, 4)) * sd * 20.0 / math.sqrt(float(torque @ torque))
    fit = fit_wrench(torque, force)
    same = replace(
        fit,
        slope_n_per_n_m=slope,
        sd_n=sd,
        covariance=(0.0, 0.0, 1.0 / float(torque @ torque)),
        growing=0.0,
        as_likely=(),
    )
    band = same.line_n(20.0)
    assert (band.value - band.low, band.high - band.value) == pytest.approx((half, half))
    assert half < same.force_n(20.0).high - band.value
    assert fit.line_n(20.0).low <= band.low and band.high <= fit.line_n(20.0).high, "five clampings tell little"
    assert fit.force_sd_percent == pytest.approx(100.0 * fit.sd_n / (25.0 * fit.slope_n_per_n_m))


def test_a_scroll_chuck_is_a_line_through_the_origin() -> None:
    fit = fit_wrench(TORQUE, SLOPE * TORQUE)
    assert fit.force_n(50.0).value == pytest.approx(18850, rel=1e-4)
    assert fit.torque_n_m(18849.0).value == pytest.approx(50.0, rel=1e-4)
    assert (fit.outliers, fit.misses, fit.intercept_n) == ((), False, 0.0)


@pytest.mark.parametrize(
    ("affine", "grows", "torque"),
    [(False, False, TORQUE), (False, True, TORQUE[::2]), (True, False, TORQUE[::2]), (True, True, TORQUE)],
)
@pytest.mark.first(1)
def test_the_bands_hold_what_they_promise(affine: bool, grows: bool, torque: Floats) -> None:
    """250 calibrations: 95 % hold the slope, and the force and the torque of the next clamping anywhere.

    The scatter of a gauge is 400 N everywhere, that of friction 5 % of the force; which, nobody says.
    """
    rng, offset = np.random.default_rng(6), 900.0 if affine else 0.0

    def clamped(at: Floats) -> Floats:
        sd = 0.05 * SLOPE * at if grows else np.full_like(at, 400.0)
        return np.asarray(offset + SLOPE * at + sd * rng.normal(0.0, 1.0, at.size))

    held = []
    for _ in range(250):
        fit = fit_wrench(torque, clamped(torque), affine=affine)
        held.append([abs(fit.slope_n_per_n_m - SLOPE) < fit.slope_ci])
        for place in (12.0, 35.0, 48.0):
            next_n = float(clamped(np.array([place]))[0])
            line, band = fit.line_n(place), fit.force_n(place)
            held[-1] += [line.low < offset + SLOPE * place < line.high, band.low < next_n < band.high]
            if place == 35.0:
                back = fit.torque_n_m(next_n)
                held[-1].append(back.low < place < back.high)
    shares = np.mean(held, axis=0)
    assert shares.min() > 0.905, "95 %, less three sd of a share of 250"
    assert shares.mean() < 0.985, "and not by being far wider than need be"


@pytest.mark.parametrize("grows", [False, True])
@pytest.mark.long
def test_chance_alone_is_rarely_taken_for_a_bend_or_an_outlier(grows: bool) -> None:
    rng, sd = np.random.default_rng(7), 0.05 * SLOPE * TORQUE if grows else np.full_like(TORQUE, 400.0)
    fits = [fit_wrench(TORQUE, SLOPE * TORQUE + sd * rng.normal(0.0, 1.0, TORQUE.size)) for _ in range(300)]
    met = np.mean([[fit.misses, bool(fit.outliers)] for fit in fits], axis=0)
    assert met == pytest.approx([0.05, 0.05], abs=0.038)  # three sd of a share of 300


def test_a_record_of_a_calibration_without_a_share_is_one_of_equal_scatter() -> None:
    kept = asdict(noisy(2))
    old = {key: value for key, value in kept.items() if key not in ("growing", "as_likely")}
    assert record(WrenchFit, old).growing == 0.0
    assert record(WrenchFit, kept) == noisy(2)


def test_the_way_back_is_the_same_band() -> None:
    fit = noisy(1)
    force = fit.force_n(30.0)
    assert fit.torque_n_m(force.high).low == pytest.approx(30.0, rel=1e-9)
    assert fit.torque_n_m(force.low).high == pytest.approx(30.0, rel=1e-9)


def noisy(seed: int, bent: float = 0.0, repeated: bool = True) -> WrenchFit:
    torque = TORQUE if repeated else np.linspace(10.0, 50.0, 15)
    noise = np.random.default_rng(seed).normal(0.0, 300.0, 15)
    return fit_wrench(torque, SLOPE * torque * (1 - bent * torque) + noise)


@pytest.mark.parametrize("repeated", [True, False])
def test_a_chuck_that_sticks_is_no_line(repeated: bool) -> None:
    assert not noisy(3, repeated=repeated).misses
    assert noisy(3, bent=0.005, repeated=repeated).misses


def test_a_clamping_that_stands_off_is_named_and_kept() -> None:
    force = SLOPE * TORQUE + np.random.default_rng(5).normal(0.0, 300.0, 15)
    force[7] -= 3000.0
    fit = fit_wrench(TORQUE, force)
    assert (fit.outliers, fit.points) == ((7,), 15)


def test_what_gives_no_line_is_refused() -> None:
    assert refused([10.0, 20.0, 30.0], [1.0, 2.0, 3.0])[0] == "calibration.few_points"
    assert refused([20.0] * 6, [1.0] * 6) == ("calibration.alike", "torque_n_m")
    assert refused([1.0, 2.0, 3.0, 0.0], [1.0] * 4) == ("calibration.not_positive", "torque_n_m")
    assert refused([1.0, 2.0, 3.0, 4.0], [1.0, 2.0, math.nan, 1.0]) == ("calibration.not_positive", "force_n")
    assert refused([10.0, 20.0, 30.0, 40.0], [9000.0, 10.0, 1.0, 1.0])[0] == "calibration.no_slope"
    with pytest.raises(ProfileError) as caught:
        noisy(1).force_n(80.0)
    assert (caught.value.problems[0].code, caught.value.problems[0].limit) == (
        "calibration.outside",
        "10 … 50 N m",
    )


def test_a_line_through_the_mean_of_every_torque_misses_nothing() -> None:
    """By rounding it may miss less than the means themselves, which is no number of a chance."""
    torque_n_m = np.repeat([10.0, 20.0, 30.0, 40.0], 3)
    fit = fit_wrench(torque_n_m, 200.0 * torque_n_m + np.tile([-400.0, 0.0, 400.0], 4))
    assert fit.lack_of_fit_chance == pytest.approx(1.0) and not fit.misses
