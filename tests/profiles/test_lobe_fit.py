"""The lobe in a trace: exact without noise, as sure as it says with noise, refused where angles do not tell."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from profiles.lobe.lobe_fit import fit_lobe
from profiles.problem import ProfileError

Floats = NDArray[np.float64]


def turn(points: int, turns: int = 1) -> Floats:
    return np.arange(points * turns) * 360.0 / points


def harmonic(angle_deg: Floats, n: int, amplitude: float, phase_deg: float) -> Floats:
    return np.asarray(amplitude * np.cos(n * np.radians(angle_deg - phase_deg)))


def part(angle_deg: Floats) -> Floats:
    """27.5 um of three lobes with a crest at 30 deg, off centre, oval, from another nominal radius."""
    return (
        harmonic(angle_deg, 3, 27.5, 30.0)
        + harmonic(angle_deg, 1, 12.0, 77.0)
        + harmonic(angle_deg, 2, 4.0, 10.0)
        + 3.0
    )


def refused(
    angle_deg: ArrayLike, deviation_um: ArrayLike, jaws: int = 3, **options: object
) -> tuple[str, str, str]:
    with pytest.raises(ProfileError) as caught:
        fit_lobe(angle_deg, deviation_um, jaws, **options)  # type: ignore[arg-type]
    problem = caught.value.problems[0]
    return problem.code, problem.value, problem.limit


@settings(max_examples=30, deadline=None)
@given(
    jaws=st.integers(2, 6),
    amplitude=st.floats(0.5, 200.0),
    crest_share=st.floats(0.0, 0.999),
    seed=st.integers(0, 1000),
)
def test_without_noise_it_is_exact_at_any_angles(
    jaws: int, amplitude: float, crest_share: float, seed: int
) -> None:
    angle = np.sort(np.random.default_rng(seed).uniform(0.0, 360.0, 240))
    crest = crest_share * 360.0 / jaws
    off_centre = harmonic(angle, 1, 40.0, 200.0) + harmonic(angle, 2 * jaws, 1.5, 4.0)
    fit = fit_lobe(angle, harmonic(angle, jaws, amplitude, crest) + off_centre, jaws)
    if jaws == 2:  # the ovality is the lobe
        assert fit.lobe is fit.harmonic(2)
    assert fit.error_um_pp == pytest.approx(2 * amplitude, rel=1e-6)
    assert math.remainder(fit.lobe.phase_deg - crest, 360.0 / jaws) == pytest.approx(0.0, abs=1e-6)
    assert fit.noise_um == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("points", "sigma", "sd_um", "sd_rad"),
    [(72, 3.0, 0.5000, 0.0182), (360, 1.0, 0.0745, 0.00271)],
)
@pytest.mark.first(1)
def test_the_confidence_is_that_of_repeated_measurements(
    points: int, sigma: float, sd_um: float, sd_rad: float
) -> None:
    """200 traces: the scatter is sigma sqrt(2/M), the errors say so, 95 % of the half-widths hold the truth."""
    rng, angle = np.random.default_rng(11), turn(points)
    lobes = [fit_lobe(angle, part(angle) + rng.normal(0.0, sigma, points), 3).lobe for _ in range(200)]
    amplitude = np.array([lobe.amplitude_um for lobe in lobes])
    crest = np.array([lobe.phase_deg for lobe in lobes])
    assert amplitude.std() == pytest.approx(sd_um, rel=0.15)
    assert np.mean([lobe.sd_um for lobe in lobes]) == pytest.approx(sd_um, rel=0.02)
    assert np.radians(crest.std() * 3) == pytest.approx(sd_rad, rel=0.15)
    assert np.radians(np.mean([lobe.sd_deg for lobe in lobes]) * 3) == pytest.approx(sd_rad, rel=0.02)
    within = [abs(lobe.amplitude_um - 27.5) < lobe.ci_um for lobe in lobes]
    aimed = [abs(lobe.phase_deg - 30.0) < lobe.ci_deg for lobe in lobes]
    assert np.mean(within) == pytest.approx(0.95, abs=0.046)  # three sd of a share of 200
    assert np.mean(aimed) == pytest.approx(0.95, abs=0.046)


@pytest.mark.parametrize(
    ("memory", "points"),
    [(0.9, 72), pytest.param(0.95, 360, marks=pytest.mark.long), pytest.param(0.5, 360, marks=pytest.mark.long)],
)
@pytest.mark.long
def test_the_confidence_holds_where_neighbouring_points_err_alike(memory: float, points: int) -> None:
    """AR(1) residuals of a known lobe, 150 traces: taken for white, 30 % of the half-widths hold it at 0.9."""
    from scipy.signal import lfilter

    rng, angle = np.random.default_rng(20), turn(points)
    drawn = lfilter([1.0], [1.0, -memory], rng.normal(0.0, 1.0, (150, points + 400)), axis=1)[:, 400:]
    fits = [fit_lobe(angle, part(angle) + each, 3) for each in drawn]
    within = [abs(fit.lobe.amplitude_um - 27.5) < fit.lobe.ci_um for fit in fits]
    aimed = [abs(fit.lobe.phase_deg - 30.0) < fit.lobe.ci_deg for fit in fits]
    assert np.mean(within) > 0.88  # 95 %, less four sd of a share of 150
    assert np.mean(aimed) > 0.88
    told = np.mean([fit.left_um > 3.0 * fit.floor_um for fit in fits])
    assert told < 0.05, "what such noise leaves at low orders is no wave that should be declared"


def test_a_wave_that_was_not_declared_makes_no_noise_of_the_others() -> None:
    """One line of 2 um in white noise of 0.1 um: the lobe is as sure as the variance of both makes it."""
    rng, angle = np.random.default_rng(8), turn(360)
    fit = fit_lobe(angle, part(angle) + harmonic(angle, 5, 2.0, 20.0) + rng.normal(0.0, 0.1, 360), 3)
    assert (fit.left_n, fit.left_um > 3.0 * fit.floor_um) == (5, True)
    assert fit.lobe.sd_um == pytest.approx(math.sqrt((2.0 + 0.01) * 2 / 360), rel=0.05)


def test_without_a_lobe_one_trace_in_twenty_shows_a_significant_one() -> None:
    rng, angle = np.random.default_rng(3), turn(120)
    fits = [fit_lobe(angle, rng.normal(0.0, 2.0, 120), 3) for _ in range(300)]
    assert np.mean([fit.lobe.significant for fit in fits]) == pytest.approx(0.05, abs=0.038)
    assert np.mean([fit.lobe.amplitude_um > fit.floor_um for fit in fits]) == pytest.approx(0.05, abs=0.038)
    squared = np.mean([fit.lobe.amplitude_um**2 for fit in fits])
    assert squared == pytest.approx(
        2 * np.mean([fit.lobe.sd_um**2 for fit in fits]), rel=0.15
    )  # all of it is bias


def test_a_lobe_that_changes_from_turn_to_turn_is_as_unsure_as_its_turns() -> None:
    """Ten turns whose lobes scatter by 1 um: sd 1/sqrt(10) um, of which residuals alone show a fraction."""
    rng, angle = np.random.default_rng(2), turn(360, turns=10)
    size = np.repeat(27.5 + rng.normal(0.0, 1.0, 10), 360)
    noise = rng.normal(0.0, 0.5, angle.size)
    fit = fit_lobe(angle, size * np.cos(3 * np.radians(angle - 30.0)) + noise, 3)
    assert fit.turns == 10
    assert fit.lobe.sd_um == pytest.approx(size[::360].std(ddof=1) / math.sqrt(10), rel=0.1)
    assert fit.lobe.ci_um == pytest.approx(2.262 * fit.lobe.sd_um, rel=1e-3)  # Student's t of 9
    alone = fit_lobe(angle[:360], (27.5 * np.cos(3 * np.radians(angle - 30.0)) + noise)[:360], 3)
    assert (alone.turns, fit.lobe.sd_um > 5 * alone.lobe.sd_um) == (1, True)


def test_a_chip_is_left_out_and_a_scratch_too() -> None:
    rng, angle = np.random.default_rng(9), turn(360)
    measured = part(angle) + rng.normal(0.0, 0.5, 360)
    spoilt = measured.copy()
    spoilt[40:52] += 60.0
    spoilt[200:204] -= 25.0
    plain, robust = fit_lobe(angle, spoilt, 3), fit_lobe(angle, spoilt, 3, robust=True)
    assert abs(plain.lobe.amplitude_um - 27.5) > 1.0
    assert robust.lobe.amplitude_um == pytest.approx(27.5, abs=0.1)
    assert (robust.left_out, robust.points) == (16, 344)
    assert robust.noise_um == pytest.approx(0.5, rel=0.1)


def test_worse_points_count_less() -> None:
    rng, angle = np.random.default_rng(4), turn(360)
    sigma = np.where(angle < 120.0, 8.0, 0.5)
    measured = part(angle) + rng.normal(0.0, 1.0, 360) * sigma
    told, untold = fit_lobe(angle, measured, 3, sigma_um=sigma), fit_lobe(angle, measured, 3)
    assert told.lobe.sd_um < 0.3 * untold.lobe.sd_um
    assert abs(told.lobe.amplitude_um - 27.5) < told.lobe.ci_um
    assert fit_lobe(angle, measured, 3, sigma_um=4.0) == untold


def test_a_wave_that_was_not_declared_is_named() -> None:
    angle = turn(360)
    fit = fit_lobe(angle, part(angle) + harmonic(angle, 5, 2.0, 20.0), 3)
    assert fit.left_n == 5
    assert fit.left_um == pytest.approx(2.0, abs=1e-9)
    declared = fit_lobe(angle, part(angle) + harmonic(angle, 5, 2.0, 20.0), 3, extra=(5,))
    assert declared.harmonic(5).phase_deg == pytest.approx(20.0)
    assert declared.left_um == pytest.approx(0.0, abs=1e-9)


def test_the_rounding_of_a_trace_without_noise_is_no_wave() -> None:
    angle = turn(360)
    fit = fit_lobe(angle, harmonic(angle, 3, 27.5, 20.0) + harmonic(angle, 1, 12.0, 5.0), 3)
    assert [each.n for each in fit.harmonics if each.significant] == [1, 3]


def test_nothing_has_no_crest() -> None:
    lobe = fit_lobe(turn(90), np.zeros(90), 3).lobe
    assert (lobe.amplitude_um, lobe.ci_deg, lobe.significant) == (0.0, 60.0, False)


def test_what_says_nothing_of_the_lobe_is_refused() -> None:
    angle = turn(360)
    assert refused(angle[:280], part(angle[:280])) == ("trace.narrow_angles", "81 deg", "60 deg")
    assert refused(turn(18), part(turn(18))) == ("trace.few_points", "18", ">= 19")
    assert refused(turn(18, turns=5), part(turn(18, turns=5)))[0] == "trace.few_points"
    assert refused(angle, part(angle)[1:])[0] == "trace.columns"
    assert refused(angle, np.where(angle == 7.0, np.nan, 0.0))[:2] == ("trace.not_finite", "nan")
    assert refused(angle, part(angle), sigma_um=0.0) == ("lobe_fit.sigma", "0 um", "> 0 um")
    assert refused(angle, part(angle), jaws=1)[0] == "lobe_fit.order"
    assert refused(angle, part(angle), extra=(0,))[0] == "lobe_fit.order"
    sparse = np.concatenate([turn(120)[:4], np.arange(60.0, 360.0, 60.0), turn(120)[:30] / 30])
    assert refused(sparse, part(sparse))[0] == "lobe_fit.dependent"
