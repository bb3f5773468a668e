"""The 95 % that a fingerprint prints: how often the lobe of the part is within them, over lots drawn by chance.

What is drawn is what the console says that it does not know: height and angle of the lobe, what of that order is
no lobe, the gain of the indicator, the force of the clamping, finger-tight, and the noise of each reading.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from console.text.part_sentences import limit_um_pp
from profiles.chucking.holding import FORCE_SD_PERCENT
from profiles.compensations.path import CutPath, target_path
from profiles.fingerprint.readings import ClampReadings
from profiles.fingerprint.this_clamping import (
    Clamped,
    blank_over_part,
    clamped_by,
    clamping_scale,
    felt,
    known_lobe,
)
from profiles.problem import ProfileError
from profiles.store import load_job, load_machine

JOB = replace(load_job("lee-2001-experiment-1").job, lobe_phase_deg=0.0)
MACHINE = load_machine("lee-2001-lathe").machine
LOBE_UM, JAWS, READING_UM = 27.5, 3, 0.6
HEIGHT_UM, TURN_UM, BESIDE_UM = 0.07 * LOBE_UM, JAWS * math.radians(3.0) * LOBE_UM, 0.5
GAIN, GAIN_TURN, FINGER = 0.05, JAWS * math.radians(1.0), 0.01
DRAWN = 600


def drawn(places: int, seed: int) -> tuple[np.ndarray, list[Clamped]]:
    """Return the true lobes of so many parts, amplitudes in um, and what a fingerprint of each says."""
    chance, scale = np.random.default_rng(seed), clamping_scale(JOB, MACHINE)
    height, turn, gain, gain_turn, force, finger = chance.normal(size=(6, DRAWN))
    beside = BESIDE_UM * (chance.normal(size=DRAWN) + 1j * chance.normal(size=DRAWN))
    lobe = LOBE_UM + HEIGHT_UM * height + 1j * TURN_UM * turn + beside
    pull = scale.sd * force
    shown = scale.at_rest * lobe * np.exp(GAIN * gain + 1j * GAIN_TURN * gain_turn) * (1.0 + pull)
    shown *= (0.95 + FINGER * finger) * blank_over_part(JOB)
    angles = 360.0 * np.arange(places) / places
    sprung = np.real(shown[:, None] * np.exp(1j * JAWS * np.radians(angles)))
    noise = READING_UM * chance.normal(size=(2, DRAWN, places))
    path = CutPath(target=target_path(JOB), command=target_path(JOB))
    known = known_lobe(LOBE_UM + 0j, JOB, MACHINE, 0.07, 3.0).clamped()
    true_um, found = [], []
    for part, tight, full in zip(lobe * (1.0 + scale.at_speed * pull), noise[0], noise[1] - sprung, strict=True):
        read = ClampReadings(
            angle_deg=tuple(angles), finger_um=tuple(tight), full_um=tuple(full), graduation_um=READING_UM
        )
        with suppress(ProfileError):  # more than half of the lobe off: some in a thousand are refused
            found.append(clamped_by(known, replace(felt(read, JOB), others={}), path, JAWS)[1])
            true_um.append(abs(part))
    return np.array(true_um), found


@pytest.mark.parametrize("places", [6, 7, 12])
def test_the_lobe_of_the_part_is_within_the_printed_limits_in_95_of_100(places: int) -> None:
    assert JOB.jaws == JAWS and JOB.lobe_amplitude_um == LOBE_UM and FORCE_SD_PERCENT == 5.0
    true_um, found = drawn(places, seed=places)
    off_um_pp = np.array([2.0 * abs(each.lobe_um) for each in found]) - 2.0 * true_um
    limits_um_pp = np.array([limit_um_pp(each) for each in found])
    assert np.mean([each.weight for each in found]) > 0.6, "six places show the height as well as twelve"
    assert 0.93 <= np.mean(np.abs(off_um_pp) <= limits_um_pp) <= 0.97
