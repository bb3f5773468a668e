"""The spectrum of a profile: each order has twice its amplitude, whatever the others are."""

from __future__ import annotations

import numpy as np
import pytest

from profiles.arrays import Floats, floats
from profiles.metrology.circles import CIRCLES
from profiles.metrology.harmonics import spectrum_um_pp
from profiles.problem import ProfileError
from profiles.roundness import centred_profile, evaluate, profile_of

ANGLE_DEG = np.arange(3600) / 10.0


def wave(*harmonics: tuple[int, float, float]) -> Floats:
    angle = np.radians(ANGLE_DEG)
    return floats(np.sum([um * np.cos(n * (angle - np.radians(at))) for n, um, at in harmonics], axis=0))


def test_each_order_has_its_height_peak_to_peak_and_nothing_else_has_any() -> None:
    found = spectrum_um_pp(ANGLE_DEG, 4.0 + wave((3, 27.5, 12.0), (50, 0.25, 3.0), (600, 1.5, 0.0)))
    assert found.shape == (1801,)
    for n, um_pp in ((0, 8.0), (3, 55.0), (50, 0.5), (600, 3.0)):
        assert found[n] == pytest.approx(um_pp)
    assert np.delete(found, [0, 3, 50, 600]).max() < 1e-9


def test_the_order_of_the_points_does_not_matter_and_unequal_angles_have_no_spectrum() -> None:
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
