"""How often a stated 95 % interval holds the truth: noise that is alike at neighbours, scatter in proportion.

The baseline is plain least squares with equal, independent residuals and Student's t, by numpy alone.

    python -m benchmarks.confidence
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import t as student_t

from benchmarks.measure import extent, print_table
from profiles.axis.identification import frequency_response
from profiles.calibration.wrench import fit_wrench
from profiles.lobe.lobe_fit import fit_lobe

DRAWS = extent(400, 4)
RATE_HZ = 1.0 / 442e-6
SLOPE = 377.0  # N per N m
TORQUE = np.repeat([10.0, 20.0, 30.0, 40.0, 50.0], 3)

Floats = NDArray[np.float64]
Held = tuple[bool, bool]
"""Whether the plain interval held the truth, and whether ours did."""


def coloured(random: np.random.Generator, memory: float, sd: float, count: int) -> Floats:
    """Return AR(1) noise of a standard deviation; each sample keeps the fraction `memory` of the last."""
    drawn = random.normal(0.0, sd * math.sqrt(1.0 - memory**2), count + 1000)
    return np.asarray(lfilter([1.0], [1.0, -memory], drawn)[1000:])


def plain(columns: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return coefficients and 95 % half-widths by equal, independent residuals."""
    known = np.linalg.inv(columns.T @ columns)
    found = known @ columns.T @ values
    left = values - columns @ found
    freedom = values.size - columns.shape[1]
    sd = np.sqrt(np.diag(known) * float(left @ left) / freedom)
    return found, sd * float(student_t.ppf(0.975, freedom))


def lobe(random: np.random.Generator, memory: float, points: int) -> Held:
    """Draw a trace with 27.5 um of lobe: its amplitude. The lobe is a cosine, so that one coefficient has it."""
    angle = 2.0 * np.pi * np.arange(points) / points
    deviation = 27.5 * np.cos(3 * angle) + 12.0 * np.cos(angle) + coloured(random, memory, 1.0, points)
    waves = [wave(n * angle) for n in (1, 2, 3, 6, 9) for wave in (np.cos, np.sin)]
    found, half = plain(np.stack([np.ones(points), *waves], axis=1), deviation)
    ours = fit_lobe(np.degrees(angle), deviation, 3).lobe
    return bool(abs(found[5] - 27.5) < half[5]), abs(ours.amplitude_um - 27.5) < ours.ci_um


def response(random: np.random.Generator, memory: float, periods: int) -> Held:
    """Draw a record of 50 Hz with noise of a fifth of the sine: its gain, 0.88 with no lag."""
    time = np.arange(round(periods / 50.0 * RATE_HZ)) / RATE_HZ
    sine, quarter = np.cos(100.0 * np.pi * time), np.sin(100.0 * np.pi * time)
    answer = 22.0 * sine + coloured(random, memory, 4.4, time.size)
    found, half = plain(np.stack([sine, quarter, np.ones_like(time), time], axis=1), answer)
    ours = frequency_response(time, 25.0 * sine, answer, 50.0)
    return bool(abs(found[0] - 22.0) < half[0]), abs(ours.gain - 0.88) < ours.gain_ci


def wrench(random: np.random.Generator, percent: float, newtons: float) -> Held:
    """Draw fifteen clampings at five torques: the force of the next one at 48 N m."""

    def clamped(torque: Floats) -> Floats:
        sd = np.hypot(newtons, 0.01 * percent * SLOPE * torque)
        return np.asarray(SLOPE * torque + sd * random.normal(0.0, 1.0, torque.size))

    force, at = clamped(TORQUE), 48.0
    coming = float(clamped(np.array([at]))[0])
    slope = float(TORQUE @ force) / float(TORQUE @ TORQUE)
    left = force - slope * TORQUE
    freedom = TORQUE.size - 1
    sd = math.sqrt(float(left @ left) / freedom * (1.0 + at**2 / float(TORQUE @ TORQUE)))
    band = fit_wrench(TORQUE, force).force_n(at)
    half = float(student_t.ppf(0.975, freedom)) * sd
    return abs(slope * at - coming) < half, band.low < coming < band.high


CASES: tuple[tuple[str, Callable[[np.random.Generator], Held]], ...] = (
    ("lobe, 360 points, white noise", lambda random: lobe(random, 0.0, 360)),
    ("lobe, 360 points, AR(1) of 0.5", lambda random: lobe(random, 0.5, 360)),
    ("lobe, 360 points, AR(1) of 0.95", lambda random: lobe(random, 0.95, 360)),
    ("lobe, 72 points, AR(1) of 0.9", lambda random: lobe(random, 0.9, 72)),
    ("response, 20 periods, white noise", lambda random: response(random, 0.0, 20)),
    ("response, 20 periods, AR(1) of 0.9", lambda random: response(random, 0.9, 20)),
    ("response, 3 periods, AR(1) of 0.97", lambda random: response(random, 0.97, 3)),
    ("next clamping, 400 N everywhere", lambda random: wrench(random, 0.0, 400.0)),
    ("next clamping, 5 % of the force", lambda random: wrench(random, 5.0, 0.0)),
)


def shares(cases: Iterable[tuple[str, Callable[[np.random.Generator], Held]]]) -> list[tuple[str, str, str]]:
    """Return a row for each case."""
    rows = []
    for name, draw in cases:
        random = np.random.default_rng(2001)
        plain_share, ours = np.mean([draw(random) for _ in range(DRAWS)], axis=0)
        rows.append((name, f"{100 * plain_share:.0f} %", f"{100 * ours:.0f} %"))
    return rows


def main() -> None:
    """Draw and print."""
    title = f"95 % intervals that hold the truth, of {DRAWS} draws"
    print_table(title, ("", "plain (baseline)", "as stated"), shares(CASES))


if __name__ == "__main__":
    main()
