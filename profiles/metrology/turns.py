"""Several turns of one part (what repeats with the angle belongs to it, the rest is random), and its size."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats, floats
from profiles.problem import refusal_error

_SAME_ANGLE = 0.01  # fraction of a step by which the angles of a turn may differ from those of the first one
_TURN_DEG = 360.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Turns:
    """K turns of M points, um: `each_um` (K, M) at `angle_deg` (M,), in [0, 360), rising.

    `repeatable_um` (M,) is their mean. `random_um` is the standard deviation of one turn's point from it (K - 1 of
    K turns are free), so that of the mean is `random_um` / sqrt(K).
    """

    angle_deg: Floats
    each_um: Floats
    repeatable_um: Floats
    random_um: float

    def amplitude_sd_um(self, n: int) -> float:
        """Return the standard deviation, from turn to turn, of the amplitude of undulation `n`.

        Divided by sqrt(K) it is the standard error of the mean turn's amplitude.
        """
        waves = np.exp(-1j * n * np.radians(self.angle_deg))
        amplitudes = 2.0 * np.abs(self.each_um @ waves) / self.angle_deg.size
        return float(amplitudes.std(ddof=1))


def several_turns(angle_deg: ArrayLike, deviation_um: ArrayLike, turns: int) -> Turns:
    """Return the turns of a trace whose angles run on from 0 to 360 `turns`; at least 2, shape (K M,) each.

    Raises `ProfileError`: `trace.turns`, the turns do not have the same angles.
    """
    angle = floats(angle_deg)
    deviation = floats(deviation_um)
    if turns < 2 or angle.size % turns:
        raise refusal_error("trace.turns", value=str(angle.size), limit=f"{turns} x N")
    order = np.argsort(angle, kind="stable")
    stood = angle[order].reshape(turns, -1) - _TURN_DEG * np.arange(turns)[:, np.newaxis]
    allowed_deg = _SAME_ANGLE * _TURN_DEG / stood.shape[1]
    apart_deg = float(np.abs(stood - stood[0]).max())
    if apart_deg > allowed_deg:
        raise refusal_error("trace.turns", value=f"{apart_deg:.3g} deg", limit=f"<= {allowed_deg:.3g} deg")
    each = deviation[order].reshape(turns, -1)
    mean = each.mean(axis=0)
    return Turns(
        angle_deg=stood[0],
        each_um=each,
        repeatable_um=mean,
        random_um=math.sqrt(float(np.sum((each - mean) ** 2)) / (stood.shape[1] * (turns - 1))),
    )


def mean_diameter_mm(radius_mm: float, mean_deviation_um: float) -> float:
    """Return 2 (R + mean deviation): R is where the deviation is 0, the mean that of the least squares circle."""
    return 2.0 * (radius_mm + mean_deviation_um / 1000.0)


def tool_offset_um(mean_diameter_mm: float, target_diameter_mm: float) -> float:
    """Return half of the oversize: how far the tool has to move, positive into the work."""
    return 500.0 * (mean_diameter_mm - target_diameter_mm)
