"""The force of a half-stage cut against signals that are written down here: a mass, its friction, and a chip.

A tool of 4.7 kg and 200 N s/m moves x = m + a cos(3 angle - p) um, angle = w t. Its motor has to give what moves
the mass, 4/pi F of the fundamental of a dry friction F against the speed, and, from the face on, k (x - lobe): the
force of the chip, in a surface that the jaws press in by the lobe.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest

from profiles.arrays import Floats
from profiles.compensations.force_null import (
    ExpectedForce,
    ForceNull,
    ForceRecord,
    Sign,
    Why,
    force_null,
)

CYCLE_S, HZ, LOBES = 0.000442, 1000.0 / 60.0, 3
MASS_KG, DAMPING, FRICTION_N = 4.7, 200.0, 3.0
WHOLE_UM, DEPTH_UM, K = 27.5 * cmath.exp(0.7j), 90.0, 0.03  # N/um
GIVES_WAY = 0.03j  # of its path a tool is pushed off by the cut
EXPECTED = ExpectedForce(
    lobes=LOBES,
    whole_um=WHOLE_UM,
    passive_n=2.7,
    mass_kg=MASS_KG,
    damping_n_s_per_m=DAMPING,
    cycle_s=CYCLE_S,
    turns_hz=HZ,
)


def waves(value: complex, lobe_rad: Floats) -> Floats:
    return np.asarray((value * np.exp(1j * lobe_rad)).real, dtype=np.float64)


def needed(path_um: complex, lobe_rad: Floats, backwards: bool) -> Floats:
    """The force that the motion itself needs, 1.5 cycles before it acts: M a + B v + F sign(v)."""
    omega = 2.0 * math.pi * LOBES * HZ * (-1.0 if backwards else 1.0)
    now_rad = lobe_rad + 1.5 * CYCLE_S * omega
    speed = waves(1e-6j * omega * path_um, now_rad)
    return np.asarray(
        MASS_KG * waves(-1e-6 * omega**2 * path_um, now_rad) + DAMPING * speed + FRICTION_N * np.sign(speed)
    )


def cut(
    *,
    lobe_um: complex = WHOLE_UM,
    stiffness: float = K,
    noise_um: float = 0.0,
    seed: int = 0,
    air_turns: float = 5.0,
    backwards: bool = False,
    gain: float = 1.0,
) -> ForceRecord:
    """A half stage: from `air_turns` before the face to 8 turns behind it, in a surface with a lobe."""
    turns = np.arange(-air_turns, 8.0, HZ * CYCLE_S)
    lobe_rad = 2.0 * math.pi * LOBES * (turns + 0.123) * (-1.0 if backwards else 1.0)
    path_um = 0.5 * WHOLE_UM
    pushed_um = path_um * (1.0 - GIVES_WAY)
    inside = turns >= 0.0
    infeed_um = np.where(inside, DEPTH_UM + waves(pushed_um, lobe_rad), 100.0 + waves(path_um, lobe_rad))
    omega = 2.0 * math.pi * LOBES * HZ * (-1.0 if backwards else 1.0)
    ahead_rad = lobe_rad + 1.5 * CYCLE_S * omega
    chip_n = stiffness * (DEPTH_UM + waves(pushed_um - lobe_um, ahead_rad))
    thrust_n = np.where(
        inside, needed(pushed_um, lobe_rad, backwards) + chip_n, needed(path_um, lobe_rad, backwards)
    )
    read_um = np.random.default_rng(seed).normal(0.0, 1.0, turns.size + 1) * noise_um
    # A derivative of what is read makes the noise of the output: 1.5 N rms of 0.3 um.
    noise_n = np.diff(read_um) * 1.5 / (0.3 * math.sqrt(2.0))
    return ForceRecord(
        angle_deg=np.degrees(lobe_rad) / LOBES,
        infeed_um=infeed_um + read_um[1:],
        thrust_n=gain * (thrust_n - noise_n),
        face_deg=360.0 * 0.123 * (-1.0 if backwards else 1.0),
    )


def found(**cutting: object) -> ForceNull:
    return force_null(cut(**cutting), EXPECTED)  # type: ignore[arg-type]


def turned(by_deg: float) -> complex:
    """The lobe, so many degrees of spindle further on."""
    return WHOLE_UM * cmath.exp(-1j * LOBES * math.radians(by_deg))


def test_a_right_compensation_leaves_half_of_the_lobe_in_the_chip() -> None:
    said = found()
    assert (said.sign, said.alarms, said.why) == (Sign.AGREES, False, Why.NONE)
    assert abs(said.force_n) == pytest.approx(K * 0.5 * abs(WHOLE_UM), rel=0.05)
    assert abs(said.ratio - 1.0) < 0.03
    assert abs(said.turned_deg) < 1.0
    assert abs(said.right_n - said.force_n) < 0.03


def test_with_the_sign_wrong_the_chip_has_one_and_a_half_lobes() -> None:
    said = found(lobe_um=-WHOLE_UM)
    assert (said.sign, said.alarms) == (Sign.WRONG_SIGN, True)
    assert abs(said.force_n) == pytest.approx(K * 1.5 * abs(WHOLE_UM), rel=0.05)
    assert abs(said.wrong_n - said.force_n) < 0.05


@pytest.mark.parametrize("by_deg", [-40.0, -20.0, 20.0, 30.0, 45.0])
def test_a_lobe_that_is_turned_is_found_with_its_angle(by_deg: float) -> None:
    said = found(lobe_um=turned(by_deg), noise_um=0.3)
    assert said.sign is Sign.TURNED
    assert said.turned_deg == pytest.approx(by_deg, abs=2.0 * said.turned_sd_deg)
    assert said.turned_sd_deg < 4.0


@pytest.mark.parametrize("by_deg", [0.0, 30.0])
def test_a_spindle_that_turns_backwards_is_no_other_lobe(by_deg: float) -> None:
    said = found(lobe_um=turned(by_deg), backwards=True)
    assert said.turned_deg == pytest.approx(by_deg, abs=1.5)


@pytest.mark.parametrize("gain", [0.8, 1.25])
def test_a_drive_that_is_stronger_than_its_profile_changes_no_verdict(gain: float) -> None:
    said = found(lobe_um=turned(30.0), gain=gain)
    assert said.sign is Sign.TURNED and said.turned_deg == pytest.approx(30.0, abs=2.0)


def test_the_standard_deviation_is_at_least_that_of_many_cuts() -> None:
    """Of forty cuts with a scale of 0.3 um rms; neighbouring turns share a reading, so that it is too wide."""
    cuts = [found(noise_um=0.3, seed=seed) for seed in range(40)]
    scatter_n = math.sqrt(float(np.var([each.force_n for each in cuts])) / 2.0)
    said_n = math.sqrt(float(np.mean([each.force_sd_n**2 for each in cuts])))
    assert 0.25 * said_n < scatter_n < said_n
    assert {each.sign for each in cuts} == {Sign.AGREES}


def test_a_blank_that_was_turned_in_the_same_clamping_tells_nothing() -> None:
    for seed in range(20):
        said = found(lobe_um=0j, noise_um=0.3, seed=seed)
        assert (said.sign, said.why) == (Sign.UNKNOWN, Why.ROUND)


@pytest.mark.parametrize(
    ("cutting", "why"),
    [
        ({"stiffness": 0.0}, Why.NO_FORCE),
        ({"stiffness": 0.0, "noise_um": 0.3}, Why.NO_FORCE),
        ({"air_turns": 1.5}, Why.NO_REFERENCE),
        ({"noise_um": 2.5}, Why.NOISE),
        ({"lobe_um": 3.0 * WHOLE_UM}, Why.TOO_LARGE),
    ],
)
def test_what_cannot_be_told_says_why(cutting: dict[str, object], why: Why) -> None:
    said = found(**cutting)
    assert (said.sign, said.why, said.alarms) == (Sign.UNKNOWN, why, False)


def test_nothing_gathered_is_no_verdict() -> None:
    nothing = ForceRecord(angle_deg=np.empty(0), infeed_um=np.empty(0), thrust_n=np.empty(0), face_deg=0.0)
    assert force_null(nothing, EXPECTED).why is Why.NOT_GATHERED
    assert force_null(cut(), replace(EXPECTED, whole_um=0j)).why is Why.NOT_GATHERED
