"""A response with its disc: what is inverted, how far it may be off, and where nothing may be inverted."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from profiles.axis.response import AMPLIFICATION_LIMIT, ServoResponse, Source, identified_response, model_response
from profiles.axis.servo import sampled_response
from profiles.problem import ProfileError
from profiles.store import load_machine

MACHINE = load_machine("lee-2001-lathe").machine
TABLE_5_HZ = (10.0, 30.0, 50.0, 70.0)


def nominal(frequency_hz: float) -> complex:
    return complex(sampled_response(MACHINE, frequency_hz))


def identified(
    *frequencies_hz: float, gain_ci: float = 0.0, phase_ci_deg: float = 0.0, shrunk: float = 1.0
) -> ServoResponse:
    """Points on the sampled loop of the paper's lathe, as a file has them: phases within half a turn."""
    points = [shrunk * nominal(frequency) for frequency in frequencies_hz]
    return identified_response(
        frequency_hz=frequencies_hz,
        gain=[abs(point) for point in points],
        phase_deg=[math.degrees(cmath.phase(point)) for point in points],
        gain_ci=[gain_ci] * len(points),
        phase_ci_deg=[phase_ci_deg] * len(points),
        amplitude_um=25.0,
        name="there",
    )


def refusal(response: ServoResponse, frequency_hz: float) -> str:
    with pytest.raises(ProfileError) as caught:
        response.invertible(frequency_hz)
    return caught.value.problems[0].code


@pytest.mark.parametrize(
    ("gain_error", "phase_error_deg", "left_um"),
    [(0.01, 0.0, 0.55), (0.02, 1.0, 1.47), (0.05, 2.0, 3.38), (0.05, 5.0, 5.63), (0.10, 10.0, 11.46)],
)
def test_an_inverse_that_is_off_leaves_what_the_paper_arithmetic_says(
    gain_error: float, phase_error_deg: float, left_um: float
) -> None:
    """|1 - T / T_hat| of 55 um; the disc that just holds such a T promises no less."""
    hat = identified(50.0).at(50.0)
    true = hat * cmath.rect(1.0 + gain_error, math.radians(phase_error_deg))
    assert 55.0 * abs(1.0 - true / hat) == pytest.approx(left_um, abs=0.02)
    disc = identified(50.0, gain_ci=abs(true - hat)).relative_95(50.0)
    assert 55.0 * disc == pytest.approx(left_um, abs=0.02)


@given(share=st.floats(0.0, 1.0), angle_deg=st.floats(0.0, 360.0), radius=st.floats(0.0, 0.5))
def test_whatever_lies_in_the_confidence_leaves_no_more_than_the_disc(
    share: float, angle_deg: float, radius: float
) -> None:
    """Identification gives the circle of its confidence twice: as half-width of the gain, and as seen from 0."""
    hat = nominal(50.0)
    seen_deg = math.degrees(math.asin(radius / abs(hat)))
    response = identified(50.0, gain_ci=radius, phase_ci_deg=seen_deg)
    true = hat + cmath.rect(share * radius, math.radians(angle_deg))
    assert abs(1.0 - true / response.at(50.0)) <= response.relative_95(50.0) + 1e-12


@pytest.mark.parametrize(
    "frequencies_hz",
    [
        TABLE_5_HZ,
        (10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0),
        (200.0, 226.0, 260.0, 300.0),  # the phase goes through half a turn here
    ],
)
def test_between_points_the_loop_is_within_the_disc(frequencies_hz: tuple[float, ...]) -> None:
    response = identified(*reversed(frequencies_hz))
    for frequency_hz in np.linspace(frequencies_hz[0], frequencies_hz[-1], 101):
        off = abs(nominal(frequency_hz) / response.at(frequency_hz) - 1.0)
        assert off <= response.relative_95(frequency_hz) + 1e-12
        assert response.relative_95(frequency_hz) < 0.02


def test_on_a_point_it_is_the_point_with_its_own_confidence() -> None:
    response = identified(*TABLE_5_HZ, gain_ci=0.01)
    assert response.at(50.0) == pytest.approx(nominal(50.0), rel=1e-12)
    assert response.relative_95(50.0) == pytest.approx(0.01 / 0.88554, rel=1e-4)
    assert response.source is Source.IDENTIFIED


def test_between_points_the_less_certain_of_the_two_counts() -> None:
    gain, gain_ci = [0.9, 0.9, 0.9], [0.001, 0.03, 0.002]
    zeros = [0.0] * 3
    straight = identified_response(
        frequency_hz=[40, 50, 60],
        gain=gain,
        phase_deg=zeros,
        gain_ci=gain_ci,
        phase_ci_deg=zeros,
        amplitude_um=25.0,
        name="there",
    )
    assert [straight.relative_95(f) for f in (40.0, 41.0, 59.0)] == pytest.approx(
        [0.001 / 0.9, 0.03 / 0.9, 0.03 / 0.9]
    )


def test_outside_the_identified_band_nothing_is_inverted() -> None:
    response = identified(*TABLE_5_HZ)
    assert [refusal(response, hz) for hz in (9.99, 70.01)] == ["response.outside_band"] * 2
    # 3 x 1400 / 60 is not 70 to the last bit on every way to it
    assert response.invertible(70.0 * (1.0 + 1e-12)) == pytest.approx(nominal(70.0))


def test_a_table_that_no_feedforward_hears_passes_and_much_more_does_not() -> None:
    """0.162 at 50 Hz needs a command 6.2 times the motion."""
    heard = identified(50.0, shrunk=0.162 / abs(nominal(50.0)))
    assert 1.0 / abs(heard.invertible(50.0)) == pytest.approx(6.17, abs=0.01)
    assert refusal(identified(50.0, shrunk=0.12 / abs(nominal(50.0))), 50.0) == "response.amplified"
    assert 6.2 < AMPLIFICATION_LIMIT


def test_points_too_far_apart_say_nothing_of_what_lies_between() -> None:
    response = identified(10.0, 70.0)
    assert refusal(response, 50.0) == "response.too_sparse"
    assert response.invertible(70.0) == pytest.approx(nominal(70.0))


@pytest.mark.parametrize(
    "columns",
    [
        ([], [], []),
        ([50.0, 50.0], [0.9, 0.9], [0.0, 0.0]),
        ([50.0], [0.0], [0.0]),
        ([50.0], [math.nan], [0.0]),
        ([0.0], [0.9], [0.0]),
        ([50.0], [0.9], [-0.1]),
    ],
)
def test_points_that_make_no_curve_are_refused(columns: tuple[list[float], list[float], list[float]]) -> None:
    hz, gain, gain_ci = columns
    zeros = [0.0] * len(hz)
    with pytest.raises(ProfileError) as caught:
        identified_response(
            frequency_hz=hz,
            gain=gain,
            phase_deg=zeros,
            gain_ci=gain_ci,
            phase_ci_deg=zeros,
            amplitude_um=25.0,
            name="there",
        )
    assert caught.value.problems[0].code == "response.bad_points"


def test_the_model_is_as_sure_as_a_tenth_of_mass_and_gain() -> None:
    """Mass 10 % up and loop gain 10 % down leave 9.08 um of 55 at 50 Hz, simulated with a period of 442 us."""
    response = model_response(MACHINE, nominal)
    assert 55.0 * response.relative_95(50.0) == pytest.approx(9.08, rel=0.01)
    assert response.at(333.0) == nominal(333.0)
