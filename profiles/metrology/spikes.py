"""A single point that stands apart from its neighbours: a wrong digit of a reading, or dirt under the probe."""

from __future__ import annotations

import math

import numpy as np

from profiles.arrays import Floats

LEAST_SPIKE_UM = 5.0  # less makes no round part out of tolerance (choice)
FAR_SD = 8.0  # of the scatter from point to point; of 3600 points with noise alone none is as far
NEIGHBOURS = (-2, -1, 1, 2)


def spike(deviation_um: Floats) -> tuple[int, float, float] | None:
    """Return the point of a closed turn, shape (M,), that is furthest outside the range of its four neighbours.

    The result is its index, how far outside it is, um (positive outwards), and what is allowed, um; None where no
    point is further outside than that. A step is no spike, and neither is a lobe, however few the points are.
    """
    around = np.stack([np.roll(deviation_um, places) for places in NEIGHBOURS])
    outside = deviation_um - np.clip(deviation_um, around.min(axis=0), around.max(axis=0))
    bent = deviation_um - 0.5 * (np.roll(deviation_um, 1) + np.roll(deviation_um, -1))
    scatter_um = 1.4826 * float(np.median(np.abs(bent))) / math.sqrt(1.5)
    allowed_um = max(LEAST_SPIKE_UM, FAR_SD * scatter_um)
    worst = int(np.argmax(np.abs(outside)))
    return (worst, float(outside[worst]), allowed_um) if abs(outside[worst]) > allowed_um else None
