"""Responses: identified, between their points, and from a curve."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from profiles.axis.identification import FrequencyResponse, fit_sine, frequency_response, reference_swing
from profiles.axis.response import (
    AMPLIFICATION_LIMIT,
    ResponseSource,
    ServoResponse,
    identified_response,
    model_response,
    monotone_cubic,
)
from profiles.axis.servo import sampled_response
from profiles.problem import ProfileError
from profiles.store import load_machine

RATE_HZ = 2258.82
"""The servo rate of the factory setting: no whole number of samples in a period of anything."""

Floats = NDArray[np.float64]


def times(frequency_hz: float, periods: int, rate_hz: float = RATE_HZ) -> Floats:
    return np.arange(math.ceil(periods / frequency_hz * rate_hz) + 1) / rate_hz


def sine(time_s: Floats, frequency_hz: float, amplitude: float, phase_deg: float) -> Floats:
    return amplitude * np.cos(2 * np.pi * frequency_hz * time_s + math.radians(phase_deg))


@given(
    frequency_hz=st.floats(1.0, 200.0),
    gain=st.floats(0.05, 3.0),
    phase_deg=st.floats(-179.0, 179.0),
    begins_deg=st.floats(0.0, 360.0),
    offset=st.floats(-1000.0, 1000.0),
    drift=st.floats(-50.0, 50.0),
    periods=st.integers(4, 30),
)
def test_what_was_put_in_comes_out_whatever_offset_and_drift(
    frequency_hz: float,
    gain: float,
    phase_deg: float,
    begins_deg: float,
    offset: float,
    drift: float,
    periods: int,
) -> None:
    time = times(frequency_hz, periods)
    reference = sine(time, frequency_hz, 25.0, begins_deg)
    response = sine(time, frequency_hz, 25.0 * gain, begins_deg + phase_deg) + offset + drift * time
    found = frequency_response(time, reference, response, frequency_hz)
    assert found.response == pytest.approx(cmath.rect(gain, math.radians(phase_deg)), abs=1e-9)
    assert found.reference == pytest.approx(25.0, rel=1e-9)
    assert found.coherence == pytest.approx(1.0, abs=1e-12)
    assert found.gain_ci < 1e-6
    assert 2 <= found.segments <= 10


@given(scale=st.floats(1e-6, 1e6), zero_s=st.floats(-1e4, 1e4))
def test_neither_the_unit_nor_the_time_of_the_first_sample_matters(scale: float, zero_s: float) -> None:
    random = np.random.default_rng(7)
    time = times(30.0, 12)
    reference = sine(time, 30.0, 25.0, 10.0)
    response = sine(time, 30.0, 20.0, -30.0) + random.normal(0.0, 1.0, len(time))
    plain = frequency_response(time, reference, response, 30.0)
    other = frequency_response(time + zero_s, reference * scale, response * scale, 30.0)
    assert other.response == pytest.approx(plain.response, rel=1e-6)
    assert other.gain_ci == pytest.approx(plain.gain_ci, rel=1e-4)
    assert other.reference == pytest.approx(25.0 * scale, rel=1e-6)


def noisy(seed: int, noise: float, periods: int = 20) -> FrequencyResponse:
    random = np.random.default_rng(seed)
    time = times(50.0, periods)
    response = sine(time, 50.0, 22.0, -52.0) + random.normal(0.0, noise, len(time))
    return frequency_response(time, sine(time, 50.0, 25.0, 0.0), response, 50.0)


@pytest.mark.long
def test_the_confidence_holds_the_truth_as_often_as_it_says() -> None:
    """95 %, of 300 draws; the larger of two half-widths holds a little more."""
    found = [noisy(seed, noise=5.0) for seed in range(300)]
    gains = np.mean([abs(each.gain - 0.88) <= each.gain_ci for each in found])
    phases = np.mean([abs(each.phase_deg + 52.0) <= each.phase_ci_deg for each in found])
    assert 0.94 <= gains <= 0.995
    assert 0.94 <= phases <= 0.995


@pytest.mark.parametrize(
    ("memory", "periods", "draws"),
    [(0.95, 20, 150), *(pytest.param(m, p, 600, marks=pytest.mark.long) for m in (0.9, 0.97) for p in (3, 20))],
)
def test_the_confidence_holds_where_neighbours_err_alike(memory: float, periods: int, draws: int) -> None:
    """AR(1) noise of 5 um; taken for white it would hold the gain in half of the draws."""
    from scipy.signal import lfilter

    random, time = np.random.default_rng(3), times(50.0, periods)
    noise = random.normal(0.0, 5.0 * math.sqrt(1.0 - memory**2), (draws, time.size + 500))
    noise = lfilter([1.0], [1.0, -memory], noise, axis=1)[:, 500:]
    reference, response = sine(time, 50.0, 25.0, 0.0), sine(time, 50.0, 22.0, -52.0)
    found = [frequency_response(time, reference, response + each, 50.0) for each in noise]
    gains = np.mean([abs(each.gain - 0.88) <= each.gain_ci for each in found])
    phases = np.mean([abs(each.phase_deg + 52.0) <= each.phase_ci_deg for each in found])
    assert min(gains, phases) > 0.88
    assert max(gains, phases) < 0.995


def test_the_confidence_is_the_size_of_the_scatter_that_there_is() -> None:
    """Standard deviation of a component: noise sqrt(2 / samples) / amplitude; the half-width twice that."""
    found = [noisy(seed, noise=5.0) for seed in range(100)]
    target = 5.0 * math.sqrt(2.0 / (0.4 * RATE_HZ)) / 25.0
    assert np.std([each.gain for each in found]) == pytest.approx(target, rel=0.2)
    assert np.mean([each.gain_ci for each in found]) == pytest.approx(2.1 * target, rel=0.15)


def test_what_changes_from_segment_to_segment_is_seen_though_each_fits_well() -> None:
    """An amplitude that wanders by 10 % is no residual of a segment; the scatter has it."""
    time = times(50.0, 20)
    wandering = 1.0 + 0.1 * np.sin(2 * np.pi * 2.5 * time)
    reference = sine(time, 50.0, 25.0, 0.0)
    found = frequency_response(time, reference, wandering * sine(time, 50.0, 20.0, -30.0), 50.0)
    assert found.gain_ci > 0.01
    assert found.coherence < 0.999


def test_a_second_method_finds_the_same() -> None:
    """Welch's cross spectrum over the same segments, ten periods of 40 samples each, rectangular, no overlap."""
    from scipy import signal

    random = np.random.default_rng(3)
    rate_hz, frequency_hz, samples = 2000.0, 50.0, 4000
    time = np.arange(samples) / rate_hz
    reference = sine(time, frequency_hz, 25.0, 33.0)
    response = sine(time, frequency_hz, 21.0, -20.0) + random.normal(0.0, 6.0, samples)
    segment = {"fs": rate_hz, "nperseg": 400, "noverlap": 0, "window": "boxcar", "detrend": "constant"}
    frequencies, cross = signal.csd(reference, response, **segment)
    place = int(np.argmin(np.abs(frequencies - frequency_hz)))
    target = cross[place] / signal.welch(reference, **segment)[1][place]
    coherence = signal.coherence(reference, response, **segment)[1][place]
    found = frequency_response(time, reference, response, frequency_hz)
    assert found.segments == 10
    # Only the drift, which is fitted here and not there, is between the two: a share of the noise.
    assert found.response == pytest.approx(complex(target), abs=0.2 * found.gain_ci)
    assert found.coherence == pytest.approx(float(coherence), abs=2e-3)
    assert found.coherence < 0.9999


@pytest.mark.parametrize("frequency_hz", [10.0, 50.0, 150.0])
def test_the_response_of_a_known_filter_is_found_in_noise(frequency_hz: float) -> None:
    from scipy import signal

    random = np.random.default_rng(11)
    b, a = signal.butter(2, 60.0, fs=RATE_HZ)
    time = times(frequency_hz, 60)
    reference = sine(time, frequency_hz, 25.0, 70.0)
    response = signal.lfilter(b, a, reference) + random.normal(0.0, 0.5, len(time))
    target = complex(signal.freqz(b, a, [frequency_hz], fs=RATE_HZ)[1][0])
    half = len(time) // 2  # what the filter makes of the beginning has gone
    found = frequency_response(time[half:], reference[half:], response[half:], frequency_hz)
    assert abs(found.response - target) < 2.0 * found.gain_ci
    assert found.gain_ci < 0.01


def test_two_signals_without_a_relation_have_next_to_no_coherence() -> None:
    """One over the number of segments in the mean: 0.1 of ten."""
    time = times(50.0, 20)
    found = []
    for seed in range(200):
        random = np.random.default_rng(seed)
        response = random.normal(0.0, 1.0, len(time))
        found.append(frequency_response(time, sine(time, 50.0, 25.0, 0.0), response, 50.0))
    assert np.mean([each.coherence for each in found]) == pytest.approx(0.1, abs=0.02)
    assert np.median([each.phase_ci_deg for each in found]) > 45.0


def test_a_fit_gives_offset_drift_growth_and_what_is_left() -> None:
    random = np.random.default_rng(5)
    time = times(20.0, 40) + 3.0
    values = sine(time, 20.0, 4.0, 60.0) + 7.0 + 2.0 * (time - time.mean()) + random.normal(0.0, 0.1, len(time))
    found = fit_sine(time, values, 20.0)
    assert found.phasor == pytest.approx(cmath.rect(4.0, math.radians(60.0)), abs=0.02)
    assert found.offset == pytest.approx(7.0, abs=0.01)
    assert found.drift_per_s == pytest.approx(2.0, abs=0.02)
    assert found.residual == pytest.approx(0.1, rel=0.05)
    time = times(50.0, 20)
    steady = sine(time, 50.0, 25.0, 0.0)
    assert reference_swing(time, steady, 50.0) < 1e-9
    assert reference_swing(time, steady * np.minimum(1.0, time / 0.1), 50.0) > 0.5


@pytest.mark.parametrize(
    ("code", "periods", "amplitude", "spoiled"),
    [
        ("identification.too_short", 1, 25.0, 0.0),
        ("identification.not_finite", 20, 25.0, math.nan),
        ("identification.no_reference", 20, 0.0, 0.0),
    ],
)
def test_what_says_nothing_is_refused(code: str, periods: int, amplitude: float, spoiled: float) -> None:
    time = times(50.0, periods)
    response = sine(time, 50.0, 20.0, 0.0)
    response[3] += spoiled
    with pytest.raises(ProfileError) as refused:
        frequency_response(time, sine(time, 50.0, amplitude, 0.0), response, 50.0)
    assert [problem.code for problem in refused.value.problems] == [code]


def test_a_sine_that_the_samples_cannot_show_is_refused() -> None:
    """60 Hz at 100 samples a second would be seen as 40 Hz."""
    time = np.arange(1000) / 100.0
    with pytest.raises(ProfileError) as refused:
        frequency_response(time, sine(time, 60.0, 1.0, 0.0), sine(time, 60.0, 1.0, 0.0), 60.0)
    assert refused.value.problems[0].code == "identification.too_short"


# A response with its disc: what is inverted, how far it may be off, and where nothing may be inverted.

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
def test_an_inverse_that_is_off_leaves_its_part(gain_error: float, phase_error_deg: float, left_um: float) -> None:
    """|1 - T / T_hat| of 55 um; the disc that just holds such a T promises no less."""
    hat = identified(50.0).response_at(50.0)
    true = hat * cmath.rect(1.0 + gain_error, math.radians(phase_error_deg))
    assert 55.0 * abs(1.0 - true / hat) == pytest.approx(left_um, abs=0.02)
    disc = identified(50.0, gain_ci=abs(true - hat)).relative_95(50.0)
    assert 55.0 * disc == pytest.approx(left_um, abs=0.02)


@given(share=st.floats(0.0, 1.0), angle_deg=st.floats(0.0, 360.0), radius=st.floats(0.0, 0.5))
def test_whatever_lies_in_the_confidence_leaves_its_disc(share: float, angle_deg: float, radius: float) -> None:
    """Identification gives the circle of its confidence twice: as half-width of the gain, and as seen from 0."""
    hat = nominal(50.0)
    seen_deg = math.degrees(math.asin(radius / abs(hat)))
    response = identified(50.0, gain_ci=radius, phase_ci_deg=seen_deg)
    true = hat + cmath.rect(share * radius, math.radians(angle_deg))
    assert abs(1.0 - true / response.response_at(50.0)) <= response.relative_95(50.0) + 1e-12


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
        off = abs(nominal(frequency_hz) / response.response_at(frequency_hz) - 1.0)
        assert off <= response.relative_95(frequency_hz) + 1e-12
        assert response.relative_95(frequency_hz) < 0.02


def test_between_and_outside_its_points_a_response_is_as_certain_as_they_allow() -> None:
    response = identified(*TABLE_5_HZ, gain_ci=0.01)
    assert response.response_at(50.0) == pytest.approx(nominal(50.0), rel=1e-12)
    assert response.relative_95(50.0) == pytest.approx(0.01 / 0.88554, rel=1e-4)
    assert response.source is ResponseSource.IDENTIFIED
    response = identified(*TABLE_5_HZ)
    assert [refusal(response, hz) for hz in (9.99, 70.01)] == ["response.outside_band"] * 2
    # 3 x 1400 / 60 is not 70 to the last bit on every way to it
    assert response.invertible(70.0 * (1.0 + 1e-12)) == pytest.approx(nominal(70.0))
    response = identified(10.0, 70.0)
    assert refusal(response, 50.0) == "response.too_sparse"
    assert response.invertible(70.0) == pytest.approx(nominal(70.0))


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


def test_a_table_that_no_feedforward_hears_passes_and_much_more_does_not() -> None:
    """0.162 at 50 Hz needs a command 6.2 times the motion."""
    heard = identified(50.0, shrunk=0.162 / abs(nominal(50.0)))
    assert 1.0 / abs(heard.invertible(50.0)) == pytest.approx(6.17, abs=0.01)
    assert refusal(identified(50.0, shrunk=0.12 / abs(nominal(50.0))), 50.0) == "response.amplified"
    assert 6.2 < AMPLIFICATION_LIMIT


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
    assert response.response_at(333.0) == nominal(333.0)


# The shape-preserving cubic: the same as scipy's, whatever the points.


@settings(max_examples=60)
@given(
    steps=st.lists(st.floats(0.1, 50.0), min_size=1, max_size=12),
    values=st.lists(st.sampled_from([-3.0, 0.0, 0.25, 1.0, 7.5]), min_size=13, max_size=13),
)
def test_it_is_the_curve_of_scipy(steps: list[float], values: list[float]) -> None:
    from scipy.interpolate import PchipInterpolator

    x = np.concatenate(([1.0], 1.0 + np.cumsum(steps)))
    y = np.array(values[: x.size])
    at = np.linspace(x[0], x[-1], 101)
    assert monotone_cubic(x, y, at) == pytest.approx(PchipInterpolator(x, y)(at), abs=1e-9)


def test_it_keeps_to_the_values_beside_it_and_passes_through_its_points() -> None:
    x, y = np.array([10.0, 30.0, 50.0, 80.0]), np.array([1.0, 0.9, 0.9, 0.5])
    assert monotone_cubic(x, y, x) == pytest.approx(y)
    between = monotone_cubic(x, y, np.linspace(30.0, 50.0, 11))
    assert between == pytest.approx(0.9)
    assert (np.diff(monotone_cubic(x, y, np.linspace(10.0, 80.0, 200))) <= 1e-12).all()
