"""Eqs 4, 6 to 8, 10 and 11 of the paper, alignment, and the inverse of the axis."""

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from profiles.compensations.path import (
    CutPath,
    LobedPath,
    PathHarmonic,
    chord_error,
    chord_scale,
    compensated_depth_um,
    delayed,
    free_state_lobe,
    invert,
    lobe_frequency_hz,
    misalignment,
    removed_depth_um,
    residual_um_pp,
    spindle_speed_rpm,
    target_path,
)
from profiles.problem import ProfileError
from profiles.store import load_job

ONE = load_job("lee-2001-experiment-1").job
TURN_DEG = np.arange(0.0, 360.0, 0.25)


@pytest.mark.parametrize(("jaws", "factor"), [(2, 30), (3, 20), (4, 15), (6, 10)])
def test_eq_4(jaws: int, factor: float) -> None:
    assert spindle_speed_rpm(50.0, jaws) == factor * 50
    assert lobe_frequency_hz(factor * 50.0, jaws) == 50


def test_eqs_10_and_11() -> None:
    theta = np.radians(TURN_DEG)
    for depth, amplitude in ((100, 27.5), (60, 16.5)):
        plain = removed_depth_um(TURN_DEG, a0_um=depth, a1_um=amplitude)
        np.testing.assert_allclose(plain, depth + amplitude * np.sin(3 * theta), atol=1e-12)
        path = compensated_depth_um(TURN_DEG, a0_um=depth, a1_um=amplitude)
        np.testing.assert_allclose(path, depth - amplitude * np.sin(3 * theta), atol=1e-12)


def test_eq_6_has_a_cosine_too() -> None:
    values = removed_depth_um([0.0, 30.0, 60.0], a0_um=10, a1_um=2, b1_um=3)
    np.testing.assert_allclose(values, [7, 12, 13], atol=1e-12)
    path = compensated_depth_um([0.0, 30.0, 60.0], a0_um=10, a1_um=2, b1_um=3)
    np.testing.assert_allclose(path, [13, 8, 7], atol=1e-12)


def test_the_rule_is_eq_11_where_jaw_1_stands_at_90_deg() -> None:
    # The paper's plain cut takes most at 30 deg, so its part is high at 90 deg.
    assert ONE.lobe_phase_deg == 90
    expected = compensated_depth_um(TURN_DEG, a0_um=100, a1_um=27.5)
    np.testing.assert_allclose(target_path(ONE).at_um(TURN_DEG), expected, atol=1e-9)


def test_the_tool_moves_in_where_the_part_is_high() -> None:
    lobe = free_state_lobe(ONE).at_um(TURN_DEG)
    assert lobe.shape == TURN_DEG.shape
    assert free_state_lobe(ONE).at_um(ONE.lobe_phase_deg) == lobe.max() == 27.5
    np.testing.assert_allclose(target_path(ONE).at_um(TURN_DEG) - 100, lobe, atol=1e-12)


@given(st.integers(2, 12), st.floats(-360, 360), st.floats(0, 1000))
def test_a_lobe_repeats_with_the_jaws_and_has_its_error_peak_to_peak(
    jaws: int, phase: float, error: float
) -> None:
    job = replace(ONE, jaws=jaws, lobe_phase_deg=phase, lobe_error_um_pp=error)
    lobe = free_state_lobe(job).at_um(phase + np.arange(0, 360, 360 / (2 * jaws)))
    np.testing.assert_allclose(lobe, np.tile([error / 2, -error / 2], jaws), atol=1e-9)


@pytest.mark.parametrize(
    ("gain", "phase_rad", "amplitude_um", "lobe_lead_deg"),
    [(0.74546, -0.78226, 36.89, 44.82), (0.884, -0.241, 31.11, 13.81)],
)
def test_the_command_of_experiment_1(
    gain: float, phase_rad: float, amplitude_um: float, lobe_lead_deg: float
) -> None:
    command = invert(target_path(ONE), cmath.rect(gain, phase_rad))
    assert command.amplitude_um == pytest.approx(amplitude_um, abs=0.005)
    assert command.phase_deg == pytest.approx(ONE.lobe_phase_deg - lobe_lead_deg / 3, abs=0.005)
    assert command.mean_um == 100


@given(st.floats(0.125, 20), st.floats(-math.pi, math.pi), st.integers(2, 12), st.floats(-360, 360))
def test_an_axis_undoes_its_inverse(gain: float, phase: float, lobes: int, crest: float) -> None:
    target = LobedPath(mean_um=100, amplitude_um=20, lobes=lobes, phase_deg=crest)
    command = invert(target, cmath.rect(gain * 1.0001, phase))
    # The axis makes the sine larger by its gain and later by its lag.
    moved = replace(
        command,
        amplitude_um=command.amplitude_um * gain * 1.0001,
        phase_deg=command.phase_deg - math.degrees(phase) / lobes,
    )
    np.testing.assert_allclose(moved.at_um(TURN_DEG), target.at_um(TURN_DEG), atol=1e-6)


@pytest.mark.parametrize("response", [0j, 0.1249 + 0j, complex("nan")])
def test_an_axis_that_hardly_moves_has_no_inverse(response: complex) -> None:
    with pytest.raises(ProfileError) as caught:
        invert(target_path(ONE), response)
    assert caught.value.problems[0].code == "response.too_small"


@pytest.mark.parametrize(
    ("angle_deg", "of_55", "of_33"),
    [(0.05, 0.14, 0.09), (0.25, 0.72, 0.43), (1, 2.88, 1.73), (5, 14.36, 8.61), (20, 55, 33), (60, 110, 66)],
)
def test_alignment_error(angle_deg: float, of_55: float, of_33: float) -> None:
    c = misalignment(angle_deg, 3)
    assert residual_um_pp(55, c) == pytest.approx(of_55, abs=0.006)
    assert residual_um_pp(33, c) == pytest.approx(of_33, abs=0.006)


@pytest.mark.parametrize(
    ("percent", "degrees", "left"), [(1, 0, 0.0100), (2, 1, 0.0267), (5, 5, 0.1024), (10, 10, 0.2084)]
)
def test_an_identified_response_that_is_a_little_wrong(percent: float, degrees: float, left: float) -> None:
    c = cmath.rect(1 + percent / 100, math.radians(degrees))
    assert residual_um_pp(1, c) == pytest.approx(left, abs=6e-3 * left + 5e-5)


def test_a_sine_through_eq_9_and_through_the_measured_servo() -> None:
    for error, eq9, measured in ((55, 38.8, 14.0), (33, 23.3, 8.4)):
        assert residual_um_pp(error, cmath.rect(0.74546, -0.78226)) == pytest.approx(eq9, abs=0.05)
        assert residual_um_pp(error, cmath.rect(0.884, -0.241)) == pytest.approx(measured, abs=0.05)


@pytest.mark.parametrize("points", [8, 24, 46])
def test_chords_through_raised_points_keep_the_amplitude_and_their_error(points: int) -> None:
    """By straight lines of numpy; the fundamental of unraised ones at 24 points is 0.9943 of the sine."""
    angle = np.linspace(0.0, 2.0 * np.pi, 48_001)[:-1]
    knots = np.linspace(0.0, 2.0 * np.pi, points + 1)
    lines = np.interp(angle, knots, chord_scale(points) * np.cos(knots))
    assert 2.0 * np.mean(lines * np.cos(angle)) == pytest.approx(1.0, abs=1e-5)
    assert np.abs(lines - np.cos(angle)).max() == pytest.approx(chord_error(points), rel=1e-3)
    assert chord_scale(24) == pytest.approx(1.0 / 0.99430, abs=1e-4)


def test_a_delay_turns_the_response_and_leaves_its_gain() -> None:
    """One servo cycle of 442.7 us at 50 Hz: 0.1391 rad, 2.66 deg of the spindle with three lobes."""
    late = delayed(complex(0.5, -0.5), 50.0, 442.7e-6)
    assert abs(late) == pytest.approx(abs(complex(0.5, -0.5)))
    assert cmath.phase(late) == pytest.approx(-math.pi / 4 - 0.1391, abs=1e-4)
    assert math.degrees(0.1391) / 3 == pytest.approx(2.66, abs=0.01)


@given(
    mean_um=st.floats(-200.0, 200.0),
    harmonics=st.lists(st.tuples(st.floats(0.0, 60.0), st.floats(-360.0, 360.0)), min_size=3, max_size=3),
    growth=st.floats(-0.1, 0.1),
    by_deg=st.floats(-720.0, 720.0),
    past_middle_mm=st.floats(-20.0, 20.0),
)
def test_a_turned_path_has_at_the_turned_angle_what_it_had_before(
    mean_um: float, harmonics: list[tuple[float, float]], growth: float, by_deg: float, past_middle_mm: float
) -> None:
    lobe, *others = (
        PathHarmonic(lobes=n, amplitude_um=a, phase_deg=c) for n, (a, c) in zip((3, 6, 9), harmonics, strict=True)
    )
    path = LobedPath(
        mean_um=mean_um,
        amplitude_um=lobe.amplitude_um,
        lobes=3,
        phase_deg=lobe.phase_deg,
        overtones=tuple(others),
        growth_per_mm=growth,
    )
    turned = path.turned(by_deg)
    before_um = path.at_um(TURN_DEG, past_middle_mm)
    np.testing.assert_allclose(turned.at_um(TURN_DEG + by_deg, past_middle_mm), before_um, atol=1e-7)
    command = path.plus({3: 1.0 + 1.0j})
    both = CutPath(target=path, command=command).turned(by_deg)
    assert both.target == turned
    np.testing.assert_allclose(
        both.command.at_um(TURN_DEG), path.plus({3: 1.0 + 1.0j}).turned(by_deg).at_um(TURN_DEG)
    )
