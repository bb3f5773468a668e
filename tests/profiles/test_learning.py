"""Learning two numbers for each harmonic, against the figures of frequency-domain learning."""

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from profiles.compensations.learning import (
    Deviation,
    convergence,
    fit_harmonics,
    learned_command,
    learned_part,
    trimmed,
)
from profiles.compensations.path import CutPath, LobedPath, PathHarmonic, invert
from profiles.problem import ProfileError

WANTED = LobedPath(mean_um=100.0, amplitude_um=27.5, lobes=3, phase_deg=90.0)
LAG = cmath.rect(0.884, -0.241)
"""Table 5 of the paper at 50 Hz, as a loss of the peak-to-peak value."""


def untouched() -> CutPath:
    """A cut that knows nothing yet."""
    return CutPath(target=WANTED, command=LobedPath(mean_um=100.0, amplitude_um=0.0, lobes=3, phase_deg=0.0))


def passes_um_pp(true: complex, nominal: complex, gain: float, count: int) -> list[float]:
    """Errors of the tool, peak to peak, of passes in a row."""
    path, errors = untouched(), []
    for _ in range(count):
        off = WANTED.harmonics[0].coefficient - true * path.command.harmonics[0].coefficient
        errors.append(2.0 * abs(off))
        path = learned_command(path, {3: off}, lambda _: nominal, gain)
    return errors


# Residuals of E = 55 um by pass: simulated figures of frequency-domain learning, rounded as printed.
@pytest.mark.parametrize(
    ("true", "nominal", "gain", "expected"),
    [
        (LAG, 1.0, 1.0, [55.0, 14.0, 3.55, 0.90, 0.23]),
        (LAG, cmath.rect(1.0, -0.241), 1.0, [55.0, 6.38, 0.74, 0.09]),
        (LAG, LAG * 1.1 * cmath.rect(1.0, math.radians(10.0)), 1.0, [55.0, 10.4, 1.97, 0.37, 0.07]),
        (LAG, LAG * 1.1 * cmath.rect(1.0, math.radians(10.0)), 0.7, [55.0, 21.4, 8.34, 3.25, 1.26, 0.49]),
    ],
)
def test_the_tool_is_learned_as_fast_as_its_response_is_known(
    true: complex, nominal: complex, gain: float, expected: list[float]
) -> None:
    assert passes_um_pp(true, nominal, gain, len(expected)) == pytest.approx(expected, rel=0.01, abs=0.006)


@given(st.floats(0.3, 1.5), st.floats(-1.5, 1.5), st.floats(0.1, 1.0))
def test_it_converges_where_its_condition_says(size: float, turn: float, gain: float) -> None:
    true = cmath.rect(size, turn)
    factor = convergence(true, 1.0, gain)
    first, *_, last = passes_um_pp(true, 1.0, gain, 6)
    assert last == pytest.approx(first * factor**5, rel=1e-6, abs=1e-9)


def test_at_full_gain_sixty_degrees_of_phase_are_the_limit() -> None:
    assert convergence(cmath.rect(1.0, math.radians(59.9)), 1.0) < 1.0
    assert convergence(cmath.rect(1.0, math.radians(60.1)), 1.0) > 1.0
    assert convergence(cmath.rect(1.0, math.radians(89.0)), 1.0, gain=0.01) < 1.0


def test_the_fit_of_one_turn_is_as_uncertain_as_the_noise_makes_it() -> None:
    """360 points of 3 um: sd of the amplitude 0.224 um in theory, 0.222 in a simulation of 2000 runs."""
    random, angle = np.random.default_rng(7), np.arange(360.0)
    true = PathHarmonic(lobes=3, amplitude_um=27.5, phase_deg=17.0)
    fits = [
        fit_harmonics(angle, 5.0 + true.at_um(angle) + random.normal(0.0, 3.0, 360), (1, 2, 3, 6, 9))
        for _ in range(300)
    ]
    amplitudes = [abs(fit.coefficients_um[3]) for fit in fits]
    assert np.mean([fit.amplitude_sd_um for fit in fits]) == pytest.approx(0.224, rel=0.02)
    assert np.std(amplitudes) == pytest.approx(0.222, rel=0.12)
    assert np.mean(amplitudes) == pytest.approx(27.5, abs=0.05)
    assert np.mean([len(fit.significant()) for fit in fits]) == pytest.approx(1.0 + 4 * 0.05, abs=0.1)


def test_a_fit_needs_a_turn() -> None:
    angle = np.linspace(0.0, 20.0, 200)
    with pytest.raises(ProfileError, match=r"learning\.few_samples"):
        fit_harmonics(angle, np.cos(angle), (1, 2, 3, 6, 9))


def test_what_the_tool_missed_is_not_wanted_deeper() -> None:
    """The same part: once the tool did what was wanted and that was wrong, once it did not do it."""
    high = {3: 2.0 + 1.0j}
    path = CutPath(target=WANTED, command=invert(WANTED, LAG))
    misjudged = learned_part(path, Deviation(coefficients_um=high), Deviation(coefficients_um={}), lambda _: LAG)
    missed = learned_part(path, Deviation(coefficients_um=high), Deviation(coefficients_um=high), lambda _: LAG)
    lobe = WANTED.harmonics[0].coefficient
    assert misjudged.target.harmonics[0].coefficient == pytest.approx(lobe + high[3])
    assert missed.target.harmonics[0].coefficient == pytest.approx(lobe)
    for learned in (misjudged, missed):
        assert LAG * learned.command.harmonics[0].coefficient == pytest.approx(lobe + high[3])


def test_a_part_that_is_too_large_is_cut_deeper() -> None:
    path = CutPath(target=WANTED, command=WANTED)
    none = Deviation(coefficients_um={})
    large = Deviation(mean_um=10.0, coefficients_um={})
    learned = learned_part(path, large, none, lambda _: LAG, gain=0.7)
    assert (learned.target.mean_um, learned.command.mean_um) == (107.0, 107.0)


def test_a_trim_takes_a_steady_disturbance_away_and_has_its_limit() -> None:
    disturbance, trim = 3.0 - 2.0j, 0j
    for _ in range(8):
        trim = trimmed(trim, disturbance - LAG * trim, LAG, 0.7, 8.0)
    assert LAG * trim == pytest.approx(disturbance, abs=1e-3)
    with pytest.raises(ProfileError, match=r"learning\.trim_limit"):
        trimmed(trim, 5.0 + 0j, LAG, 1.0, 8.0)
    with pytest.raises(ProfileError, match=r"learning\.trim_limit"):
        trimmed(trim, complex(math.nan), LAG, 1.0, 8.0)
