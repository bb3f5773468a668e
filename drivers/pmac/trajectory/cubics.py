"""Many cubics of one motor at once: positions, extents and speeds, in counts and ms.

Apart from `pieces`, so that the first page of the screens needs no numpy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.pmac.trajectory.pieces import Piece

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class CubicMotion:
    """The cubics of one motor, coefficients of shape (4, n), and the duration of each, ms, of shape (n,)."""

    cubics: Floats
    duration_ms: Floats

    def positions_at(self, t_ms: Floats) -> Floats:
        """Return the positions at these times after the start of each cubic, counts."""
        c0, c1, c2, c3 = self.cubics
        return np.asarray(((c3 * t_ms + c2) * t_ms + c1) * t_ms + c0, dtype=np.float64)

    def extent(self) -> tuple[float, float]:
        """Return the lowest and highest position: at an end, or where the velocity passes zero; counts."""
        _, c1, c2, c3 = self.cubics
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(c2 * c2 - 3.0 * c1 * c3)
            cubic = ((-c2 + root) / (3.0 * c3), (-c2 - root) / (3.0 * c3))
            instants = [np.where(c3 == 0.0, -c1 / (2.0 * c2), each) for each in cubic]
        places = [self.positions_at(self._clip_times(each)) for each in (*instants, self.duration_ms)]
        places.append(self.cubics[0])
        return float(np.min(places)), float(np.max(places))

    def peak_velocity(self) -> float:
        """Return the greatest speed: at an end, or where the acceleration passes zero; counts/ms."""
        _, c1, c2, c3 = self.cubics
        with np.errstate(divide="ignore", invalid="ignore"):
            instant = self._clip_times(-c2 / (3.0 * c3))
        instants = np.array([np.zeros_like(instant), instant, self.duration_ms])
        return float(np.max(np.abs((3.0 * c3 * instants + 2.0 * c2) * instants + c1)))

    def _clip_times(self, t_ms: Floats) -> Floats:
        """Return the instants inside each cubic; its start replaces an instant outside it, or nan."""
        return np.where((t_ms >= 0.0) & (t_ms <= self.duration_ms), t_ms, 0.0)


def motion_of(pieces: Sequence[Piece], index: int) -> CubicMotion:
    """Return the motion of one motor over some pieces."""
    return CubicMotion(
        cubics=np.array([piece.cubics[index] for piece in pieces]).T,
        duration_ms=np.array([piece.duration_ms for piece in pieces]),
    )


def shift_cubics(cubic: Floats, by_ms: Floats) -> Floats:
    """Return cubics, shape (4, n), with their time counted from `by_ms` on."""
    c0, c1, c2, c3 = cubic
    return np.array(
        [
            ((c3 * by_ms + c2) * by_ms + c1) * by_ms + c0,
            c1 + (2.0 * c2 + 3.0 * c3 * by_ms) * by_ms,
            c2 + 3.0 * c3 * by_ms,
            c3,
        ]
    )


def interpolate_cubics(start: Floats, before: Floats, end: Floats, after: Floats, duration_ms: Floats) -> Floats:
    """Return the cubics, shape (4, n), through both values with both slopes."""
    slope = (end - start) / duration_ms
    c2 = (3.0 * slope - 2.0 * before - after) / duration_ms
    c3 = (before + after - 2.0 * slope) / duration_ms**2
    return np.array([start, before, c2, c3])
