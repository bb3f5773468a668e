"""Waves of a trace: fits, spectra, spikes, and what a V-block shows."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from profiles.arrays import Floats, floats
from profiles.lobe.lobe_fit import fit_lobe
from profiles.metrology.circles import CIRCLES
from profiles.metrology.harmonics import Harmonic, spectrum_um_pp, usable_factor, v_block_factor
from profiles.metrology.turns import mean_diameter_mm, several_turns, tool_offset_um
from profiles.problem import ProfileError
from profiles.roundness import centred_profile, evaluate, profile_of, spike

ANGLE_DEG = np.arange(3600) / 10.0


def wave(*harmonics: tuple[int, float, float]) -> Floats:
    angle = np.radians(ANGLE_DEG)
    return floats(np.sum([um * np.cos(n * (angle - np.radians(at))) for n, um, at in harmonics], axis=0))


def test_orders_have_their_height_whatever_the_order_of_the_points() -> None:
    found = spectrum_um_pp(ANGLE_DEG, 4.0 + wave((3, 27.5, 12.0), (50, 0.25, 3.0), (600, 1.5, 0.0)))
    assert found.shape == (1801,)
    for n, um_pp in ((0, 8.0), (3, 55.0), (50, 0.5), (600, 3.0)):
        assert found[n] == pytest.approx(um_pp)
    assert np.delete(found, [0, 3, 50, 600]).max() < 1e-9
    profile, order = wave((3, 2.0, 12.0)), np.roll(np.arange(3600), 777)
    assert spectrum_um_pp(ANGLE_DEG[order], profile[order])[3] == pytest.approx(4.0)
    assert spectrum_um_pp(np.delete(ANGLE_DEG, 9), np.delete(profile, 9)).size == 0
    with pytest.raises(ProfileError):
        spectrum_um_pp([0.0, 90.0], [1.0, 1.0])


@pytest.mark.parametrize("kind", CIRCLES)
@pytest.mark.parametrize("upr", [15.0, 50.0, None])
def test_the_profile_about_a_circle_has_its_figures(kind: str, upr: float | None) -> None:
    """RONp outside, RONv inside, whatever the circle; the inscribed one has nothing inside."""
    deviation = 7.0 + wave((1, 5.0, 40.0), (2, 1.0, 80.0), (3, 2.0, 12.0), (40, 0.3, 1.0))
    circle = evaluate(ANGLE_DEG, deviation, upr).circle(kind)
    angle_deg, profile = profile_of(ANGLE_DEG, deviation, upr, kind=kind)
    assert profile.max() == pytest.approx(circle.ronp_um, abs=1e-6)
    assert -profile.min() == pytest.approx(circle.ronv_um, abs=1e-6)
    assert np.array_equal(angle_deg, ANGLE_DEG)
    if kind == "LSC":
        assert np.array_equal(profile, centred_profile(ANGLE_DEG, deviation, upr))


def test_a_part_far_off_the_axis_is_drawn_about_its_own_centre() -> None:
    """e = 0.5 mm off a radius of 26 mm: the limacon model would show an oval of e^2 / 2R = 4.8 um."""
    angle = np.radians(ANGLE_DEG)
    e_mm, radius_mm = 0.5, 26.0
    distance_mm = e_mm * np.cos(angle) + np.sqrt(radius_mm**2 - (e_mm * np.sin(angle)) ** 2)
    deviation_um = 1000.0 * (distance_mm - radius_mm)
    assert np.ptp(profile_of(ANGLE_DEG, deviation_um)[1]) == pytest.approx(4.8, abs=0.1)
    assert np.ptp(profile_of(ANGLE_DEG, deviation_um, radius_mm=radius_mm)[1]) < 0.01


# The lobe in a trace: exact without noise, as sure as it says with noise, refused where angles do not tell.


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
def test_without_noise_it_is_exact(jaws: int, amplitude: float, crest_share: float, seed: int) -> None:
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
    ("points", "sigma", "sd_um", "sd_rad"), [(72, 3.0, 0.5000, 0.0182), (360, 1.0, 0.0745, 0.00271)]
)
@pytest.mark.first(1)
def test_confidence_is_that_of_repetition(points: int, sigma: float, sd_um: float, sd_rad: float) -> None:
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


@pytest.mark.long
@pytest.mark.parametrize("falls_as", [0.5, 1.0, 1.5, 2.0])
def test_the_half_width_holds_the_lobe_of_a_rough_part(falls_as: float) -> None:
    """Gaussian textures whose amplitude falls with the order, 400 traces; by the likeliest spectrum 56 to 88 %."""
    rng, held, turn = np.random.default_rng(470 + int(10 * falls_as)), 0, np.radians(np.arange(720) / 2.0)
    orders = np.arange(2.0, 200.0)
    rms_um = orders**-falls_as / math.sqrt(float(np.sum(orders ** (-2.0 * falls_as))))
    for _ in range(400):
        waves = rms_um * (rng.standard_normal(orders.size) + 1j * rng.standard_normal(orders.size))
        texture = np.real(waves @ np.exp(1j * np.outer(orders, turn))) + rng.normal(0.0, 0.02, turn.size)
        lobe = fit_lobe(np.degrees(turn), texture + 27.5 * np.cos(3.0 * turn), 3).lobe
        held += abs(lobe.amplitude_um - 27.5) <= lobe.ci_um
    assert 0.90 <= held / 400, held


@pytest.mark.long
@pytest.mark.parametrize("memory", [0.9, 0.95])
def test_the_half_width_holds_the_lobe_beside_chatter_and_is_no_wider_than_that(memory: float) -> None:
    """AR(1) noise and three high orders, 400 traces; all would hold it if every noise were a power law."""
    from scipy.signal import lfilter

    rng, held, angle = np.random.default_rng(480 + int(100 * memory)), 0, turn(720)
    for _ in range(400):
        noise = lfilter([1.0], [1.0, -memory], rng.normal(0.0, 0.2, 1720))[1000:]
        chatter = [harmonic(angle, int(n), 0.6, 10.0) for n in rng.integers(40, 120, 3)]
        lobe = fit_lobe(angle, harmonic(angle, 3, 27.5, 0.0) + noise + sum(chatter), 3).lobe
        held += abs(lobe.amplitude_um - 27.5) <= lobe.ci_um
    assert 0.93 <= held / 400 <= 0.99, held


def test_a_wave_that_was_not_declared_makes_no_noise_of_the_others() -> None:
    """One line of 2 um in white noise of 0.1 um: the lobe is as sure as the variance of both makes it."""
    rng, angle = np.random.default_rng(8), turn(360)
    fit = fit_lobe(angle, part(angle) + harmonic(angle, 5, 2.0, 20.0) + rng.normal(0.0, 0.1, 360), 3)
    assert (fit.left_n, fit.left_um > 3.0 * fit.floor_um) == (5, True)
    assert fit.lobe.sd_um == pytest.approx(math.sqrt((2.0 + 0.01) * 2 / 360), rel=0.05)


@pytest.mark.long
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


def test_worse_points_count_less_and_a_wave_that_was_not_declared_is_named() -> None:
    rng, angle = np.random.default_rng(4), turn(360)
    sigma = np.where(angle < 120.0, 8.0, 0.5)
    measured = part(angle) + rng.normal(0.0, 1.0, 360) * sigma
    told, untold = fit_lobe(angle, measured, 3, sigma_um=sigma), fit_lobe(angle, measured, 3)
    assert told.lobe.sd_um < 0.3 * untold.lobe.sd_um
    assert abs(told.lobe.amplitude_um - 27.5) < told.lobe.ci_um
    assert fit_lobe(angle, measured, 3, sigma_um=4.0) == untold
    angle = turn(360)
    fit = fit_lobe(angle, part(angle) + harmonic(angle, 5, 2.0, 20.0), 3)
    assert fit.left_n == 5
    assert fit.left_um == pytest.approx(2.0, abs=1e-9)
    declared = fit_lobe(angle, part(angle) + harmonic(angle, 5, 2.0, 20.0), 3, extra=(5,))
    assert declared.harmonic(5).phase_deg == pytest.approx(20.0)
    assert declared.left_um == pytest.approx(0.0, abs=1e-9)


def test_rounding_is_no_wave_and_nothing_has_no_crest() -> None:
    angle = turn(360)
    fit = fit_lobe(angle, harmonic(angle, 3, 27.5, 20.0) + harmonic(angle, 1, 12.0, 5.0), 3)
    assert [each.n for each in fit.harmonics if each.significant] == [1, 3]
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


# One wrong digit among the readings of a part is told; lobes, steps and noise are not taken for one.


def spikes_part(points: int, lobes: int, um: float, noise_um: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    angle_deg = 360.0 * np.arange(points) / points
    noise = np.random.default_rng(seed).normal(0.0, noise_um, points)
    return angle_deg, um * np.cos(np.radians(lobes * angle_deg)) + noise


@pytest.mark.parametrize("wrong_um", [1000.0, -90.0, 9.0])
def test_a_flipped_digit_is_told_with_its_angle_and_its_size(wrong_um: float) -> None:
    angle_deg, deviation_um = spikes_part(3600, 3, 5.0, 0.2, 1)
    deviation_um[900] += wrong_um
    told = [each for each in evaluate(angle_deg, deviation_um).warnings if each.code == "trace.spike"]
    assert [each.key for each in told] == ["90 deg"]
    assert float(told[0].value.split()[0]) == pytest.approx(wrong_um, abs=1.0)
    assert [each.code for each in evaluate(angle_deg, deviation_um, robust=True).warnings] == []


@given(
    points=st.integers(12, 720),
    lobes=st.integers(1, 6),
    um=st.floats(0.0, 200.0),
    noise_um=st.floats(0.0, 3.0),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_lobed_part_with_noise_has_none(points: int, lobes: int, um: float, noise_um: float, seed: int) -> None:
    _, deviation_um = spikes_part(points, lobes, um, noise_um, seed)
    assert spike(deviation_um) is None


@given(st.integers(1, 700), st.floats(1.0, 500.0))
def test_a_step_is_none(begin: int, height_um: float) -> None:
    """A flat, a keyway, a mark where the tool dwelt."""
    deviation_um = np.zeros(720)
    deviation_um[begin : begin + 10] = height_um
    assert spike(deviation_um) is None


# V-blocks and two-point gauges, several turns, size: against tables and rigid bodies.

# Amplitude of the reading over that of the lobe, n = 2 to 12, by included angle.
FACTORS = {
    60: [0, 3, 0, 0, 3, 0, 0, 3, 0, 0, 3],
    90: [1, 2, -0.414, 2, 1, 0, 2.414, 0, 1, 2, -0.414],
    120: [1.577, 1, 0.423, 2, -0.155, 2, 0.423, 1, 1.577, 0, 2.155],
    72: [0.474, 2.618, -0.376, 1, 2.376, -0.618, 1.526, 2, -0.701, 2, 1.526],
    108: [1.382, 1.382, 0, 2.236, 0, 1.382, 1.382, 0, 2.236, 0, 1.382],
    180: [2, 0, 2, 0, 2, 0, 2, 0, 2, 0, 2],
}


@pytest.mark.parametrize("included_deg", FACTORS)
def test_factors(included_deg: int) -> None:
    assert [v_block_factor(n, included_deg) for n in range(2, 13)] == pytest.approx(
        FACTORS[included_deg], abs=5.1e-4
    )


@pytest.mark.parametrize(("included_deg", "reading_um"), [(60, 165.0), (90, 110.0), (120, 55.0)])
def test_a_rigid_three_lobe_in_a_v(included_deg: float, reading_um: float) -> None:
    """The part is lowered into the V until both faces touch its support function; the indicator reads its top."""
    half = np.radians(included_deg / 2)
    t = np.radians(np.arange(0, 360, 0.1))

    def support(direction: float, turned: float) -> float:
        radius = 26_000 + 27.5 * np.cos(3 * (t - turned))
        return float(np.max(radius * np.cos(t - direction)))

    def top(turned: float) -> float:
        """Height of the surface over the corner of the V, on the bisector, with both faces touched."""
        left, right = support(np.pi + half, turned), support(-half, turned)
        x = (left - right) / (2 * np.cos(half))
        y = (left + right) / (2 * np.sin(half))
        radius = 26_000 + 27.5 * np.cos(3 * (t - turned))
        above = (t > 0.4 * np.pi) & (t < 0.6 * np.pi)
        return float(np.interp(0.0, (x + radius * np.cos(t))[above][::-1], (y + radius * np.sin(t))[above][::-1]))

    heights = [top(turned) for turned in np.radians(np.arange(0, 120, 10))]
    assert max(heights) - min(heights) == pytest.approx(reading_um, rel=0.01)
    assert abs(v_block_factor(3, included_deg)) * 55 == pytest.approx(reading_um, abs=1e-9)


@pytest.mark.parametrize(
    ("lobes", "included_deg", "code"),
    [
        (3, 180, "trace.two_point"),
        (2, 180, "trace.two_point"),
        (5, 60, "trace.v_block_blind"),
        (6, 120, "trace.v_block_blind"),
        (1, 90, "value.out_of_range"),
        (3, 0, "value.out_of_range"),
        (3, 200, "value.out_of_range"),
    ],
)
def test_what_a_v_block_cannot_see_is_refused(lobes: int, included_deg: float, code: str) -> None:
    with pytest.raises(ProfileError) as caught:
        usable_factor(lobes, included_deg)
    assert caught.value.problems[0].code == code


def test_what_repeats_is_told_from_what_does_not() -> None:
    turns, points = 10, 360
    angle = np.arange(turns * points) * 360 / points
    random = np.random.default_rng(5)
    swing = np.repeat(random.normal(0, 1.0, turns), points)
    noise = random.normal(0, 2.0, turns * points)
    measured = several_turns(angle, (27.5 + swing) * np.cos(3 * np.radians(angle)) + noise, turns)
    assert measured.each_um.shape == (turns, points)
    np.testing.assert_allclose(measured.repeatable_um, 27.5 * np.cos(3 * np.radians(angle[:points])), atol=3.5)
    assert measured.random_um == pytest.approx(np.hypot(2.0, 1.0 / np.sqrt(2)), rel=0.15)
    # The noise alone moves an amplitude by 2 sqrt(2 / 360) from turn to turn.
    assert measured.amplitude_sd_um(3) == pytest.approx(swing[::points].std(ddof=1), abs=0.2)
    assert measured.amplitude_sd_um(7) == pytest.approx(2 * np.sqrt(2 / points), rel=0.6)


def test_turns_at_other_angles_are_refused_and_crests_counted_as_the_spindle_does() -> None:
    angle = np.arange(720.0) + np.where(np.arange(720) >= 360, 0.3, 0.0)
    for angles, turns in ((angle, 2), (np.arange(361.0), 2)):
        with pytest.raises(ProfileError) as caught:
            several_turns(angles, np.zeros(angles.size), turns)
        assert caught.value.problems[0].code == "trace.turns"
    lobe = Harmonic(n=3, amplitude_um=27.5, phase_deg=100.0)
    assert lobe.past_jaw_1_deg(90.0) == pytest.approx(10.0)
    assert lobe.past_jaw_1_deg(90.0, against_spindle=True) == pytest.approx(110.0)
    assert lobe.past_jaw_1_deg(100.0) == 0.0
    size_mm = mean_diameter_mm(25.5, 6.0)
    assert size_mm == pytest.approx(51.012)
    assert tool_offset_um(size_mm, 51.0) == pytest.approx(6.0)
    assert tool_offset_um(50.99, 51.0) == pytest.approx(-5.0)
