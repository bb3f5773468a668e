"""The tool error over the spindle angle: what repeats from turn to turn, and how far single turns scatter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from console.session.station.progress import CutProgress
from console.tui.plot.frame import nice_limits
from console.tui.plot.trace_view import Series
from console.tui.theme import Token

Floats = NDArray[np.float64]

SECTORS = 24  # of a turn: 15 degrees, an eighth of a lobe of three
LEAST_IN_SECTOR = 3  # samples from which the scatter of a sector is told
LEAST_LIMIT_UM = 2.0  # minimum scale of the error axis, so that it does not change in normal operation
SPREAD = 2.0  # half width of the band in standard deviations: 95 of 100 samples


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ErrorBand:
    """The error by sector of the turn: centres (deg), mean and half width of the band (um), each of shape (M,).

    `repeats_um` is the largest mean, which a learned correction can take away; `random_um` is the half width over
    all sectors (root mean square), which none can.
    """

    angle_deg: Floats
    mean_um: Floats
    spread_um: Floats

    @property
    def repeats_um(self) -> float:
        """Largest mean of any sector, either way."""
        return float(np.abs(self.mean_um).max())

    @property
    def random_um(self) -> float:
        """Half width of the band, root mean square over the sectors."""
        return float(np.sqrt(np.mean(self.spread_um**2)))


def error_band(cut: CutProgress) -> ErrorBand | None:
    """Return the band of the last samples in the part, None before each sector of a turn has enough of them.

    The mean of a sector is that of a straight line through its samples, at its centre: where the error is steep,
    the width of the sector itself is no scatter.
    """
    if not cut.judged or len(cut.angles_deg) < SECTORS * LEAST_IN_SECTOR:
        return None
    width = 360.0 / SECTORS
    sector = np.minimum((cut.angles_deg / width).astype(int), SECTORS - 1)
    mean, spread = np.empty(SECTORS), np.empty(SECTORS)
    for each in range(SECTORS):
        inside = sector == each
        if inside.sum() < LEAST_IN_SECTOR:
            return None
        off_deg = cut.angles_deg[inside] - (each + 0.5) * width
        columns = np.stack([np.ones_like(off_deg), off_deg], axis=1)
        found, *_ = np.linalg.lstsq(columns, cut.errors_um[inside], rcond=None)
        left = cut.errors_um[inside] - columns @ found
        mean[each] = found[0]
        spread[each] = SPREAD * np.sqrt(np.sum(left**2) / max(inside.sum() - 2, 1))
    centres: Floats = (np.arange(SECTORS, dtype=np.float64) + 0.5) * width
    return ErrorBand(angle_deg=centres, mean_um=mean, spread_um=spread)


def band_series(
    cut: CutProgress, band: ErrorBand | None, unit_um: float = 1.0
) -> tuple[tuple[Series, ...], tuple[float, float]]:
    """Return mean and edges of the band, before they are known the samples, with the limits of their axis.

    Both are in units of `unit_um`.

    Without compensation nothing is judged, and there is no series.
    """
    if not cut.judged:
        return (), (-LEAST_LIMIT_UM / unit_um, LEAST_LIMIT_UM / unit_um)
    if band is None:
        most = float(np.max(np.abs(cut.errors_um), initial=LEAST_LIMIT_UM))
        samples = Series(x=cut.angles_deg, y=cut.errors_um / unit_um, token=Token.AFTER, dots=True)
        return (samples,), nice_limits(-most / unit_um, most / unit_um)
    angle, mean, spread = _close_band(band)
    most = max(float(np.abs(mean).max() + spread.max()), LEAST_LIMIT_UM)
    edges = [
        Series(
            x=angle, y=(mean + side * spread) / unit_um, token=Token.DIM, dashed=True
        )  # told apart without colour
        for side in (1.0, -1.0)
    ]
    return (*edges, Series(x=angle, y=mean / unit_um, token=Token.AFTER)), nice_limits(
        -most / unit_um, most / unit_um
    )


def _close_band(band: ErrorBand) -> tuple[Floats, Floats, Floats]:
    """Return the sectors with their neighbours across the zero of the turn."""
    angle = np.concatenate([[band.angle_deg[-1] - 360.0], band.angle_deg, [band.angle_deg[0] + 360.0]])
    mean, spread = (
        np.concatenate([[values[-1]], values, [values[0]]]) for values in (band.mean_um, band.spread_um)
    )
    return angle, mean, spread
