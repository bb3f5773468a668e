"""The motion that Prog. 1 really commands: alternating blended moves, as harmonics of a lobe.

Two moves +P and -P of a time TM whose corners are blended over TA <= TM. The result, as a fraction of P and
with its maximum at phase 0, is sum c_k cos(k phase) over odd k about its mean (PMAC, blended LINEAR moves):

c_k = 4 / (pi k)^2 for a triangle, times sin(x)/x, x = k pi TA / (2 TM), with linear ramps,
    times (sin(x/2)/(x/2))^2 with full S-curves.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

import numpy as np

HARMONICS = 201


class Ramps(StrEnum):
    """How the velocity passes from one move to the next: TS 0, or TA = 2 TS."""

    LINEAR = "linear"
    S_CURVE = "s_curve"


SINE: Mapping[int, float] = {1: 0.5}
"""The target path: its swing is P."""


def zigzag(ramps: Ramps, blend_share: float) -> dict[int, float]:
    """Return the c_k of a zigzag that blends over `blend_share` = TA / TM (0 to 1) of each move."""
    waves = {}
    for k in range(1, HARMONICS, 2):
        x = k * blend_share / 2  # numpy's sinc includes pi
        blend = np.sinc(x) if ramps is Ramps.LINEAR else np.sinc(x / 2) ** 2
        waves[k] = float(4 / (np.pi * k) ** 2 * blend)
    return waves


def stroke_share(ramps: Ramps, blend_share: float) -> float:
    """Return the swing over P: 1 - TA/(2 TM) with linear ramps, 1 - TA/(3 TM) with full S-curves."""
    return 1 - blend_share / (2 if ramps is Ramps.LINEAR else 3)


def fundamental_share(waves: Mapping[int, float]) -> float:
    """Return the swing of the first harmonic over P."""
    return 2 * waves[1]
