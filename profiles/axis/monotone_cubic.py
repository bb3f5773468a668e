"""Shape-preserving cubics through points (Fritsch-Carlson), with the slopes of Fritsch and Butland.

Between two points the curve keeps to their values. The same as `scipy.interpolate.PchipInterpolator`, whose import
takes half a second: too long for a key, and for the threads beside it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats, floats


def monotone_cubic(x: Floats, y: Floats, at: ArrayLike) -> Floats:
    """Return the curve through two or more points of rising `x`, at places between the first and the last."""
    place = floats(at)
    piece = np.clip(np.searchsorted(x, place, side="right") - 1, 0, x.size - 2)
    step, slopes = np.diff(x), _slopes(x, y)
    t = (place - x[piece]) / step[piece]
    value = y[piece] * (1.0 + 2.0 * t) * (1.0 - t) ** 2 + y[piece + 1] * t**2 * (3.0 - 2.0 * t)
    bend = slopes[piece] * t * (1.0 - t) ** 2 - slopes[piece + 1] * t**2 * (1.0 - t)
    return floats(value + step[piece] * bend)


def _slopes(x: Floats, y: Floats) -> Floats:
    """Return the slope at each point: 0 at an extreme, else the weighted harmonic mean of those beside it."""
    step = np.diff(x)
    rise = np.diff(y) / step
    if rise.size == 1:
        return np.repeat(rise, 2)
    before, after = 2.0 * step[1:] + step[:-1], step[1:] + 2.0 * step[:-1]
    rises = rise[:-1] * rise[1:] > 0.0
    one, two = (np.where(rises, each, 1.0) for each in (rise[:-1], rise[1:]))
    inner = np.where(rises, (before + after) / (before / one + after / two), 0.0)
    ends = _end(step[0], step[1], rise[0], rise[1]), _end(step[-1], step[-2], rise[-1], rise[-2])
    return np.concatenate(([ends[0]], inner, [ends[1]]))


def _end(near: float, far: float, rise: float, next_rise: float) -> float:
    """Return the slope at an end: that of a parabola through three points, as far as it keeps the shape."""
    slope = ((2.0 * near + far) * rise - near * next_rise) / (near + far)
    if slope * rise <= 0.0:
        return 0.0
    return 3.0 * rise if rise * next_rise <= 0.0 and abs(slope) > 3.0 * abs(rise) else slope
