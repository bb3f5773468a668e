"""How fast the minimum zone circle of 3600 points is found, against the plain linear programme over all of them.

The baseline is HiGHS, by `scipy.optimize.linprog`, with two rows a point and the four variables of the circle.
Both find the zone of the same profiles, in turn; the last column is the difference between their zones.

    python -m benchmarks.roundness
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from benchmarks.measure import extent, print_table, seconds
from profiles.metrology.circles import MINIMUM_ZONE, limacon_circle

POINTS = 3600
RUNS = extent(15, 1)
AIM = 20.0

Floats = NDArray[np.float64]
ANGLE_DEG: Floats = np.arange(POINTS) * 360.0 / POINTS
THETA: Floats = np.radians(ANGLE_DEG)


def profiles_um() -> Mapping[str, Floats]:
    """Return the profiles by name: lobes as the chuck leaves them, rough ones, noise, and few distinct values."""
    random = np.random.default_rng(2001)
    lobes = 27.5 * np.sin(3 * THETA) + 12.0 * np.cos(THETA)
    return {
        "three lobes": lobes,
        "three lobes, 1 um of noise": lobes + random.normal(0.0, 1.0, POINTS),
        "noise alone": random.normal(0.0, 1.0, POINTS),
        "noise in whole um": np.round(random.normal(0.0, 1.0, POINTS)),
    }


def plain_zone_um(deviation_um: Floats) -> float:
    """Return the zone by the linear programme over all points: min hi - lo, lo <= deviation - x cos - y sin <= hi.

    Raises:
        RuntimeError: it found none, so that its time means nothing.
    """
    x, y, one, none = np.cos(THETA), np.sin(THETA), np.ones(POINTS), np.zeros(POINTS)
    rows = np.vstack((np.column_stack((-x, -y, -one, none)), np.column_stack((x, y, none, one))))
    limits = np.concatenate((-deviation_um, deviation_um))
    found = linprog([0, 0, 1, -1], A_ub=rows, b_ub=limits, bounds=(None, None), method="highs")
    if not found.success:
        raise RuntimeError(found.message)
    left = deviation_um - found.x[0] * x - found.x[1] * y
    return float(np.ptp(left))


def exchanged_zone_um(deviation_um: Floats) -> float:
    """Return the zone as the console finds it."""
    return limacon_circle(MINIMUM_ZONE, ANGLE_DEG, deviation_um).ront_um


WAYS: Mapping[str, Callable[[Floats], float]] = {
    "plain programme (baseline)": plain_zone_um,
    "exchange of contacts": exchanged_zone_um,
}


def main() -> None:
    """Measure and print."""
    rows = []
    for name, deviation_um in profiles_um().items():
        taken: dict[str, list[float]] = {way: [] for way in WAYS}
        for run in range(RUNS + 1):
            for way, zone in WAYS.items():
                one_s = seconds(lambda zone=zone, profile=deviation_um: zone(profile))  # type: ignore[misc]
                if run:  # the first one warms up
                    taken[way].append(one_s)
        middle = {way: statistics.median(times) for way, times in taken.items()}
        baseline_s = next(iter(middle.values()))
        apart_um = math.fabs(plain_zone_um(deviation_um) - exchanged_zone_um(deviation_um))
        for way, one_s in middle.items():
            apart = f"{apart_um:.0e} um" if way == "exchange of contacts" else ""
            rows.append((f"{name}, {way}", f"{1e3 * one_s:.2f} ms", f"{baseline_s / one_s:.1f}", apart))
    title = (
        f"Minimum zone of {POINTS} points, median of {RUNS}; the aim is {AIM:.0f} times as fast, equal to 1e-9 um"
    )
    print_table(title, ("", "time", "x as fast", "apart"), rows)


if __name__ == "__main__":
    main()
