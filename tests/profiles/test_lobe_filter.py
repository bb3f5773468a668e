"""What is known of a lobe, part by part: against a general minimiser, and over many rows of parts."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from scipy.optimize import minimize

from profiles.fingerprint.lobe_filter import GAIN_SD, TURN_SD_DEG, ClampingScale, LobeFilter, Seen, lobe_filter

LOBE_UM, JAWS, AT_SPEED, AT_REST, FORCE_SD = 27.5, 3, 1.2, 1.1, 0.05
HEIGHT_SD, TURN_DEG, BESIDE_UM = 0.07, 3.0, 0.5


def known(phase: float = 0.7, force_sd: float = FORCE_SD) -> LobeFilter:
    scale = ClampingScale(at_speed=AT_SPEED, at_rest=AT_REST, sd=force_sd)
    lobe = cmath.rect(LOBE_UM, phase)
    return lobe_filter(lobe, JAWS, scale, height_sd=HEIGHT_SD, turn_sd_deg=TURN_DEG, beside_um=BESIDE_UM)


def test_without_a_fingerprint_the_height_is_learned_as_the_scatter_allows_and_the_angle_at_once() -> None:
    """By Kalman's gain for one number, P / (P + R): R is of force and gauge in height, of the gauge across."""
    sd_um, part = 0.2, LOBE_UM + 0.5 + 0.8j
    after = known(0.0).measured(Seen(value=part + 0j, sd_um=sd_um))
    prior = (HEIGHT_SD * LOBE_UM) ** 2 + BESIDE_UM**2
    height = prior / (prior + (AT_SPEED * FORCE_SD * LOBE_UM) ** 2 + sd_um**2)
    across = (JAWS * math.radians(TURN_DEG) * LOBE_UM) ** 2 + BESIDE_UM**2
    assert after.lobe_um.real - LOBE_UM == pytest.approx(0.5 * height, abs=0.03)
    assert after.lobe_um.imag == pytest.approx(0.8 * across / (across + sd_um**2), abs=0.02)


def test_the_state_is_the_most_likely_one() -> None:
    """A general minimiser of the same probabilities, written down here, finds the same state."""
    phase, felt, part = 0.7, cmath.rect(33.0, 0.78), cmath.rect(29.5, 0.85)
    first = known(phase).felt(Seen(value=felt, sd_um=0.4))
    both = first.measured(Seen(value=part, sd_um=0.15))

    def cost(x: np.ndarray, *, measured: bool) -> float:
        lobe, gain, s = complex(x[0], x[1]), cmath.exp(complex(x[2], x[3])), x[4]
        off = (lobe - cmath.rect(LOBE_UM, phase)) * cmath.rect(1.0, -phase)
        across_um = JAWS * math.radians(TURN_DEG) * LOBE_UM
        terms = [
            off.real / math.hypot(HEIGHT_SD * LOBE_UM, BESIDE_UM),
            off.imag / math.hypot(across_um, BESIDE_UM),
            x[2] / GAIN_SD,
            x[3] / (JAWS * math.radians(TURN_SD_DEG)),
            s / FORCE_SD,
            abs(AT_REST * lobe * gain * (1 + s) - felt) / 0.4,
        ]
        if measured:
            terms.append(abs(lobe * (1 + AT_SPEED * s) - part) / 0.15)
        return float(sum(each**2 for each in terms))

    begin = [LOBE_UM * math.cos(phase), LOBE_UM * math.sin(phase), 0.0, 0.0, 0.0]
    for state, measured in ((first, False), (both, True)):
        best = minimize(
            lambda x, m=measured: cost(x, measured=m),
            begin,
            method="Nelder-Mead",
            options={"maxiter": 40_000, "maxfev": 40_000, "xatol": 1e-9, "fatol": 1e-12},
        ).x
        lobe_um = complex(best[0], best[1])
        # The second observation comes on top of the first as a normal distribution: nearly, not exactly, the same.
        assert abs(state.lobe_um - lobe_um) < (0.15 if measured else 0.02)
        assert state.force_deviation == pytest.approx(best[4], abs=0.004 if measured else 0.001)
    assert abs(both.this_um - part) < 0.2


def rows(fingerprint: bool, force_sd: float, stated_sd: float, seed: int) -> np.ndarray:
    """Return what is left of the lobe, um p-p, of four parts of 300 rows; the chuck scatters by `force_sd`."""
    rng, left = np.random.default_rng(seed), np.zeros((300, 4))
    for row in left:
        lobe = LOBE_UM * math.exp(0.07 * rng.normal()) * cmath.rect(1.0, 0.7 + 0.157 * rng.normal())
        gain = math.exp(GAIN_SD * rng.normal()) * cmath.rect(1.0, JAWS * math.radians(TURN_SD_DEG) * rng.normal())
        state = known(force_sd=stated_sd)
        for number in range(4):
            s = force_sd * rng.normal()
            part = lobe * (1 + AT_SPEED * s)
            state = state.clamped(0.1)
            if fingerprint:
                shown = AT_REST * lobe * gain * (1 + s) + complex(*rng.normal(0.0, 0.4, 2))
                state = state.felt(Seen(value=shown, sd_um=0.4))
            row[number] = 2.0 * abs(part - state.this_um)
            state = state.measured(Seen(value=part + complex(*rng.normal(0.0, 0.1, 2)), sd_um=0.15))
    return left


def test_a_fingerprint_removes_what_no_earlier_part_can() -> None:
    """5 % of force are 3.3 um p-p, of which the median part has 2.2 whatever was learned."""
    without = np.median(rows(False, 0.05, 0.05, 1), axis=0)
    felt = np.median(rows(True, 0.05, 0.05, 1), axis=0)
    assert without[3] > 2.0
    assert felt[0] < 0.6 * without[0] and felt[2] < 1.0 and felt[3] < 1.0


@pytest.mark.long
def test_on_a_chuck_that_hardly_scatters_a_fingerprint_does_no_harm() -> None:
    without = np.median(rows(False, 0.005, 0.005, 2), axis=0)
    felt = np.median(rows(True, 0.005, 0.005, 2), axis=0)
    assert felt[3] <= without[3] + 0.1


def test_a_set_up_that_was_changed_is_learned_anew() -> None:
    state = known(0.0)
    for _ in range(6):
        state = state.clamped(0.1).measured(Seen(value=LOBE_UM + 0j, sd_um=0.15))
    turned = cmath.rect(LOBE_UM, 1.0)
    state = state.clamped(0.1).measured(Seen(value=turned, sd_um=0.15))
    assert abs(state.lobe_um - turned) < 3.0


def test_the_uncertainty_is_that_of_many_rows() -> None:
    felt = rows(True, 0.05, 0.05, 3)[:, 2] / 2.0
    state = known()
    for _ in range(3):
        state = state.clamped(0.1).felt(Seen(value=AT_REST * cmath.rect(LOBE_UM, 0.7), sd_um=0.4))
        said_um = state.sd_um
        state = state.measured(Seen(value=cmath.rect(LOBE_UM, 0.7), sd_um=0.15))
    assert said_um == pytest.approx(math.sqrt(float(np.mean(felt**2))), rel=0.25)


def left_with(process_gain: float, lost_sd: float, seed: int) -> np.ndarray:
    """Return what is left of the lobe, um p-p, of five parts of 300 rows, each cut by what those before it taught.

    The first has the lobe of the job; of its path `process_gain` arrives in the surface.
    """
    rng, left = np.random.default_rng(seed), np.zeros((300, 5))
    for row in left:
        lobe = LOBE_UM * math.exp(0.07 * rng.normal()) * cmath.rect(1.0, 0.157 * rng.normal())
        scale = ClampingScale(at_speed=AT_SPEED, at_rest=AT_REST, sd=0.03)
        state = lobe_filter(
            LOBE_UM + 0j,
            JAWS,
            scale,
            height_sd=HEIGHT_SD,
            turn_sd_deg=TURN_DEG,
            beside_um=BESIDE_UM,
            lost_sd=lost_sd,
        )
        path = LOBE_UM + 0j
        for number in range(5):
            state = state.clamped(0.1)
            part = lobe * (1.0 + AT_SPEED * 0.03 * rng.normal()) - process_gain * path
            row[number] = 2.0 * abs(lobe - process_gain * path)
            seen = part + complex(*rng.normal(0.0, 0.1, 2))
            state = state.measured(Seen(value=seen + path, sd_um=0.15), path)
            path = state.path_um
    return left


@pytest.mark.parametrize("process_gain", [0.8, 0.9, 1.0])
def test_a_cut_in_which_not_all_arrives_is_learned_as_fast(process_gain: float) -> None:
    """The scatter of the wrench, 3 % of force, lets the mean of two parts be known within 1.4 um p-p."""
    found = np.median(left_with(process_gain, 0.1, 4), axis=0)
    assert found[0] > 3.0
    assert found[2] < 1.4 and found[4] < 1.1
    assert all(later <= found[0] for later in found)


def test_a_filter_that_knows_of_no_loss_is_late() -> None:
    found, without = (np.median(left_with(0.8, lost_sd, 4), axis=0) for lost_sd in (0.1, 0.0))
    assert found[1] < 0.7 * without[1] and found[2] < without[2]
