"""V-blocks and two-point gauges, several turns, size: against tables and rigid bodies."""

import numpy as np
import pytest

from profiles.metrology.harmonics import Harmonic, usable_factor, v_block_factor
from profiles.metrology.turns import mean_diameter_mm, several_turns, tool_offset_um
from profiles.problem import ProfileError

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


def test_turns_at_other_angles_are_refused() -> None:
    angle = np.arange(720.0) + np.where(np.arange(720) >= 360, 0.3, 0.0)
    for angles, turns in ((angle, 2), (np.arange(361.0), 2)):
        with pytest.raises(ProfileError) as caught:
            several_turns(angles, np.zeros(angles.size), turns)
        assert caught.value.problems[0].code == "trace.turns"


def test_a_crest_past_jaw_1_is_counted_as_the_spindle_counts() -> None:
    lobe = Harmonic(n=3, amplitude_um=27.5, phase_deg=100.0)
    assert lobe.past_jaw_1_deg(90.0) == pytest.approx(10.0)
    assert lobe.past_jaw_1_deg(90.0, against_spindle=True) == pytest.approx(110.0)
    assert lobe.past_jaw_1_deg(100.0) == 0.0


def test_a_part_that_is_too_large_moves_the_tool_on_by_half() -> None:
    size_mm = mean_diameter_mm(25.5, 6.0)
    assert size_mm == pytest.approx(51.012)
    assert tool_offset_um(size_mm, 51.0) == pytest.approx(6.0)
    assert tool_offset_um(50.99, 51.0) == pytest.approx(-5.0)
