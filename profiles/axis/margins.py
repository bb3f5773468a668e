"""How far a sampled loop is from instability: margins of gain, phase and delay, sensitivity, bandwidth.

With L the opened loop: the phase margin is the angle from -1 to L where |L| = 1, the delay margin that angle over
the angular frequency. The gain margins are the factors 1 / |L| where L is real and negative: above 1 how much more
gain, below 1 how much less, which an integrator may limit. The sensitivity peak Ms is the largest |1 / (1 + L)|:
1 / Ms is the distance of L from -1 (K. J. Astrom and R. M. Murray, Feedback Systems, chapter 10). Numpy alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from profiles.arrays import Floats
from profiles.axis.sampled_loop import SampledLoop

LEAST_GAIN_MARGIN, LEAST_PHASE_MARGIN_DEG, MOST_SENSITIVITY = 2.0, 45.0, 2.0
"""What is usual for a servo; the book recommends a gain margin of 2 to 5, 30 to 60 deg, and Ms of 1.2 to 2."""

_LOWEST_HZ = 1e-3
_POINTS = 4000
_HALVINGS = 60
_FINER = 200
_REAL = 1e-6  # imaginary part over the real one, below which a response is real

Curve = Callable[[Floats], Floats]


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopMargins:
    """The margins of one loop; what does not exist is None. Of several crossings the smallest margin counts.

    `gain_margin` is the factor above 1, `gain_reduction` the one below 1 at which the loop becomes unstable.
    `bandwidth_hz` is where the response to a command first falls to half its power, `peak` its maximum.
    """

    stable: bool
    crossover_hz: float | None
    phase_margin_deg: float | None
    delay_margin_ms: float | None
    gain_margin: float | None
    gain_margin_hz: float | None
    gain_reduction: float | None
    sensitivity_peak: float
    sensitivity_peak_hz: float
    bandwidth_hz: float | None
    peak: float
    peak_hz: float


def loop_margins(loop: SampledLoop) -> LoopMargins:
    """Return the margins of a loop, over all frequencies up to half its sampling rate."""
    hz = np.geomspace(_LOWEST_HZ, loop.nyquist_hz, _POINTS)
    crossings = _unity_crossings(loop, hz)
    least = min(crossings, key=lambda each: abs(each[1]), default=None)
    factors = _gain_factors(loop, hz)
    more = min(((factor, f) for factor, f in factors if factor > 1.0), default=None)
    sensitivity, sensitivity_hz = _maximum(hz, lambda f: 1.0 / np.abs(1.0 + loop.open_loop(f)))
    peak, peak_hz = _maximum(hz, lambda f: np.abs(loop.closed_loop(f)))
    return LoopMargins(
        stable=is_stable(loop),
        crossover_hz=None if least is None else least[0],
        phase_margin_deg=None if least is None else math.degrees(least[1]),
        delay_margin_ms=_delay_margin_ms(crossings),
        gain_margin=None if more is None else more[0],
        gain_margin_hz=None if more is None else more[1],
        gain_reduction=max((factor for factor, _ in factors if factor < 1.0), default=None),
        sensitivity_peak=sensitivity,
        sensitivity_peak_hz=sensitivity_hz,
        bandwidth_hz=bandwidth_hz(lambda f: np.abs(loop.closed_loop(f)), loop.nyquist_hz),
        peak=peak,
        peak_hz=peak_hz,
    )


def bandwidth_hz(
    gain: Curve, highest_hz: float, lowest_hz: float = _LOWEST_HZ, points: int = _POINTS
) -> float | None:
    """Return where a response to a command first falls to half its power; None if it does not within this band."""
    hz = np.geomspace(lowest_hz, highest_hz, points)
    return min(_crossings(hz, lambda f: gain(f) - math.sqrt(0.5)), default=None)


def sensitivity_peak(loop: SampledLoop) -> float:
    """Return Ms alone."""
    hz = np.geomspace(_LOWEST_HZ, loop.nyquist_hz, _POINTS)
    return _maximum(hz, lambda f: 1.0 / np.abs(1.0 + loop.open_loop(f)))[0]


def is_stable(loop: SampledLoop) -> bool:
    """Whether the closed loop is stable: by its poles, with an extra delay by how far 1 + L turns.

    Up to half the sampling rate 1 + L of a stable loop turns forward by a quarter turn for each integrator; with
    each pair of unstable poles it is a whole turn less (Nyquist).
    """
    if not loop.plant.delay_s:
        return bool((np.abs(loop.poles()) < 1.0).all())
    around = np.linspace(0.9, 1.1, _FINER)
    parts = [np.geomspace(_LOWEST_HZ, loop.nyquist_hz, _POINTS), *(mode.hz * around for mode in loop.plant.modes)]
    hz = np.unique(np.concatenate(parts))
    turned = np.unwrap(np.angle(1.0 + loop.open_loop(hz[hz <= loop.nyquist_hz])))
    integrators = 1 + (loop.gains.ki_v_per_m_s != 0.0) + (loop.plant.damping_per_s == 0.0)
    return bool(turned[-1] - turned[0] > (integrators / 2.0 - 1.0) * math.pi)


def _unity_crossings(loop: SampledLoop, hz: Floats) -> list[tuple[float, float]]:
    """Return where |L| = 1, with the phase margin there in rad, within half a turn."""
    found = _crossings(hz, lambda f: np.abs(loop.open_loop(f)) - 1.0)
    angles = np.angle(loop.open_loop(np.array(found)))
    return [
        (f, math.remainder(float(angle) - math.pi, 2.0 * math.pi)) for f, angle in zip(found, angles, strict=True)
    ]


def _delay_margin_ms(crossings: list[tuple[float, float]]) -> float | None:
    """Return the least delay that turns L onto -1 at a crossing, ms."""
    turns = ((angle % (2.0 * math.pi)) / (2.0 * math.pi * f) for f, angle in crossings)
    return min((1000.0 * turn for turn in turns), default=None)


def _gain_factors(loop: SampledLoop, hz: Floats) -> list[tuple[float, float]]:
    """Return 1 / |L| and the frequency wherever L is real and negative, up to half the sampling rate."""
    found = [
        f for f in _crossings(hz, lambda f: loop.open_loop(f).imag) if loop.open_loop(np.array([f]))[0].real < 0.0
    ]
    last = loop.open_loop(hz[-1:])[0]
    if last.real < 0.0 and abs(last.imag) <= _REAL * abs(last.real):  # there a sampled loop is real
        found.append(float(hz[-1]))
    return [(1.0 / float(np.abs(loop.open_loop(np.array([f]))[0])), f) for f in found]


def _crossings(hz: Floats, curve: Curve) -> list[float]:
    """Return where a curve passes through 0, by halving between the points of a grid, all at once."""
    values = curve(hz)
    places = np.flatnonzero(np.signbit(values[1:]) != np.signbit(values[:-1]))
    if not places.size:
        return []
    low, high, begins = hz[places], hz[places + 1], np.signbit(values[places])
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        before = np.signbit(curve(middle)) == begins
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return [float(each) for each in 0.5 * (low + high)]


def _maximum(hz: Floats, curve: Curve) -> tuple[float, float]:
    """Return the largest value and where it is; the grid is made finer about its highest point, twice."""
    for _ in range(2):
        place = int(np.argmax(curve(hz)))
        hz = np.linspace(hz[max(place - 1, 0)], hz[min(place + 1, len(hz) - 1)], _FINER)
    values = curve(hz)
    place = int(np.argmax(values))
    return float(values[place]), float(hz[place])
