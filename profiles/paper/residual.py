"""The motion that Prog. 1 really commands, as harmonics of a lobe, and what it leaves through a servo.

Two moves +P and -P of a time TM whose corners are blended over TA <= TM. The result, as a fraction of P and
with its maximum at phase 0, is sum c_k cos(k phase) over odd k about its mean (PMAC, blended LINEAR moves):

c_k = 4 / (pi k)^2 for a triangle, times sin(x)/x, x = k pi TA / (2 TM), with linear ramps,
    times (sin(x/2)/(x/2))^2 with full S-curves.

The part stands high by (E/2) cos(phase); the tool goes in by E sum c_k Re(T(k f) exp(j k phase)).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Complexes, Floats, floats

Servo = Callable[[ArrayLike], Complexes]
"""From frequencies in Hz to responses."""

HARMONICS, PLACES = 201, 3600


class Ramps(StrEnum):
    """How the velocity passes from one move to the next: TS 0, or TA = 2 TS."""

    LINEAR = "linear"
    S_CURVE = "s_curve"


SINE: Mapping[int, float] = {1: 0.5}  # the target path: its swing is P


def zigzag(ramps: Ramps, blend_fraction: float) -> dict[int, float]:
    """Return the c_k of a zigzag that blends over `blend_fraction` = TA / TM (0 to 1) of each move."""
    harmonics = {}
    for k in range(1, HARMONICS, 2):
        x = k * blend_fraction / 2  # numpy's sinc includes pi
        blend = np.sinc(x) if ramps is Ramps.LINEAR else np.sinc(x / 2) ** 2
        harmonics[k] = float(4 / (np.pi * k) ** 2 * blend)
    return harmonics


def stroke_fraction(ramps: Ramps, blend_fraction: float) -> float:
    """Return the swing over P: 1 - TA/(2 TM) with linear ramps, 1 - TA/(3 TM) with full S-curves."""
    return 1 - blend_fraction / (2 if ramps is Ramps.LINEAR else 3)


def fundamental_fraction(harmonics: Mapping[int, float]) -> float:
    """Return the swing of the first harmonic over P."""
    return 2 * harmonics[1]


def ideal_servo(frequency_hz: ArrayLike) -> Complexes:
    """Return 1 at every frequency."""
    return np.ones(np.shape(frequency_hz), dtype=np.complex128)


def left_um(
    error_um_pp: float, harmonics: Mapping[int, float], servo: Servo, lobe_hz: float, phase_rad: ArrayLike
) -> Floats:
    """Return the deviation of the part at phases of the lobe, in their shape; positive where it stands high."""
    phase = floats(phase_rad)
    moved = np.zeros(phase.shape)
    responses = servo(np.array(list(harmonics), dtype=np.float64) * lobe_hz)
    for (k, fraction), response in zip(harmonics.items(), responses, strict=True):
        moved += fraction * np.real(response * np.exp(1j * k * phase))
    return floats(error_um_pp * (0.5 * np.cos(phase) - moved))


def left_um_pp(error_um_pp: float, harmonics: Mapping[int, float], servo: Servo, lobe_hz: float) -> float:
    """Return the remaining roundness error: order N does not move the centre of a circle."""
    phase = 2 * np.pi * np.arange(PLACES) / PLACES
    return float(np.ptp(left_um(error_um_pp, harmonics, servo, lobe_hz, phase)))


def left_by_compliance_um_pp(error_um_pp: float, depth_um: float, mean_shift_um: float) -> float:
    """Return the lobe that a perfect sine leaves where the error is caused by compliance, in proportion to depth.

    removed = s (depth + shift - tool), s = s0 + (E / 2 D) sin(3 angle), and s0 = 1 - E / (2 D), because nothing
    is cut deeper than the tool goes: E (1 - s0) + E shift / D are left.
    """
    fraction = error_um_pp / (2 * depth_um)
    return error_um_pp * fraction + error_um_pp * mean_shift_um / depth_um
