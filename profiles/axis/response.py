"""The response of a tool axis with its uncertainty: by the machine's model, or as identified.

Responses are complex, from commanded to actual position, at frequencies in Hz; a lag is a negative phase. Its
uncertainty is a disc around it: with 95 % confidence |T - T_hat| <= r |T_hat|. Inverting T_hat then leaves |1 -
T / T_hat| <= r of a lobe (inverse feedforward at the lobe frequency).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Complexes, Floats, complexes, floats
from profiles.axis.servo import sampled_response
from profiles.machine import MachineProfile
from profiles.problem import refusal_error

AMPLIFICATION_LIMIT = 8.0
"""The highest ratio of a command to the motion that it should produce.

A compensation table whose correction has no feedforward responds with 0.162 at 50 Hz: a cut through it needs
6.2, and must be allowed. Beyond 8 each 1 % of error in the response would leave 8 % of the lobe, and the
command would be mostly lag.
"""

# Fraction by which moving mass and loop gain of a machine are assumed to differ from its profile.
MODEL_TOLERANCE = 0.1
# How far the phase may turn between two identified points; beyond that, interpolation is a guess.
MOST_TURN_DEG = 45.0
_SAME_HZ = 1e-9
_WITHIN = 17  # points at which the curves between two points are compared


class ResponseSource(StrEnum):
    """The source of a response."""

    MODEL = "model"
    IDENTIFIED = "identified"


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoResponse:
    """A response over a band of frequencies. `name` is that of the machine, or of the identification.

    `curve` is the response and `spread` the radius r of its disc, both of a frequency within the band.
    `amplitude_um` is the commanded motion during identification, None for a model: with dry friction it is
    valid for no other.
    """

    source: ResponseSource
    name: str
    lowest_hz: float
    highest_hz: float
    curve: Callable[[float], complex]
    spread: Callable[[float], float]
    amplitude_um: float | None = None

    def response_at(self, frequency_hz: float) -> complex:
        """Return T_hat. Raises `ProfileError` (`response.outside_band`, `response.too_sparse`)."""
        self._refuse_outside(frequency_hz)
        return self.curve(frequency_hz)

    def relative_95(self, frequency_hz: float) -> float:
        """Return r, the radius of the disc over |T_hat|. Raises as `response_at`."""
        self._refuse_outside(frequency_hz)
        return self.spread(frequency_hz)

    def invertible(self, frequency_hz: float) -> complex:
        """Return T_hat where it may be inverted.

        Raises as `response_at`, and `response.amplified`, the command would be more than `AMPLIFICATION_LIMIT`
        times the motion.
        """
        here = self.response_at(frequency_hz)
        if not abs(here) * AMPLIFICATION_LIMIT >= 1.0:
            value, limit = f"{1.0 / abs(here):.3g}" if here else "inf", f"<= {AMPLIFICATION_LIMIT:g}"
            raise refusal_error("response.amplified", where=f"{frequency_hz:.4g} Hz", value=value, limit=limit)
        return here

    def _refuse_outside(self, frequency_hz: float) -> None:
        if self.lowest_hz * (1 - _SAME_HZ) <= frequency_hz <= self.highest_hz * (1 + _SAME_HZ):
            return
        limit = f"{self.lowest_hz:g} … {self.highest_hz:g} Hz"
        raise refusal_error("response.outside_band", where=self.name, value=f"{frequency_hz:.4g} Hz", limit=limit)


def model_response(machine: MachineProfile, curve: Callable[[float], complex]) -> ServoResponse:
    """Return the response by the profile of a machine: at any frequency, with the profile's uncertainty.

    `curve` is the sampled loop with the delay of its path, which machine tolerances do not affect.
    """
    return ServoResponse(
        source=ResponseSource.MODEL,
        name=machine.name,
        lowest_hz=0.0,
        highest_hz=math.inf,
        curve=curve,
        spread=lambda frequency_hz: model_spread(machine, frequency_hz),
    )


def model_spread(machine: MachineProfile, frequency_hz: float) -> float:
    """Return the largest |T / T_model - 1| when mass and loop gain are each `MODEL_TOLERANCE` off.

    This is an assumption, not a confidence: this machine was not measured. Friction and cutting force are not
    included.
    """
    tool, nominal = machine.tool, complex(sampled_response(machine, frequency_hz))
    off = (1.0 - MODEL_TOLERANCE, 1.0 + MODEL_TOLERANCE)
    mass_kg, gain = tool.moving_mass_kg, tool.amplifier_gain_a_per_v
    tools = (
        replace(tool, moving_mass_kg=of_mass * mass_kg, amplifier_gain_a_per_v=of_gain * gain)
        for of_mass, of_gain in product(off, off)
    )
    others = (complex(sampled_response(replace(machine, tool=each), frequency_hz)) for each in tools)
    return max(abs(other / nominal - 1.0) for other in others)


def identified_response(
    *,
    frequency_hz: ArrayLike,
    gain: ArrayLike,
    phase_deg: ArrayLike,
    gain_ci: ArrayLike,
    phase_ci_deg: ArrayLike,
    amplitude_um: float,
    name: str,
) -> ServoResponse:
    """Return the response through identified points: columns of shape (n,) in any order, ci half-widths at 95 %.

    Between two points gain and unwrapped phase follow shape-preserving cubics (Fritsch-Carlson), which keep to the
    values of the two. The radius is that of the less certain of the two, plus twice the deviation of the cubics
    from straight lines between them, for what the axis may do there. Raises `ProfileError`: `response.bad_points`:
    none, twice the same frequency, or what is no gain, phase or interval.
    """
    columns = (frequency_hz, gain, phase_deg, gain_ci, phase_ci_deg)
    table = np.array([floats(column) for column in columns])
    table = table[:, np.argsort(table[0], kind="stable")]
    _refuse_points(table, name)
    points = _Points(table=table, name=name)
    return ServoResponse(
        source=ResponseSource.IDENTIFIED,
        name=name,
        lowest_hz=float(table[0, 0]),
        highest_hz=float(table[0, -1]),
        curve=points.response_at,
        spread=points.spread,
        amplitude_um=amplitude_um,
    )


def monotone_cubic(x: Floats, y: Floats, at: ArrayLike) -> Floats:
    """Return the curve through two or more points of rising `x`, at places between the first and the last.

    It keeps to the values beside it (Fritsch-Carlson, slopes of Fritsch and Butland). The same as
    `scipy.interpolate.PchipInterpolator`, whose import takes half a second: too long for a key and the threads.
    """
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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Points:
    """Rows of frequency, gain, phase and the two half-widths, in rising frequency."""

    table: Floats
    name: str

    def response_at(self, frequency_hz: float) -> complex:
        """Return the response by the cubics."""
        self._neighbours(frequency_hz)
        return complex(self._cubics(floats(frequency_hz)))

    def spread(self, frequency_hz: float) -> float:
        """Return the radius over |T|."""
        low, high = self._neighbours(frequency_hz)
        hz, gain, _, gain_ci, phase_ci_deg = self.table
        of_phase = 2.0 * np.sin(np.radians(np.minimum(phase_ci_deg, 180.0)) / 2.0)
        radii = np.maximum(gain_ci / gain, of_phase)
        within_hz = np.linspace(hz[low], hz[high], _WITHIN)
        curved, straight = self._cubics(within_hz), self._lines(within_hz)
        return float(max(radii[low], radii[high])) + 2.0 * float(np.max(np.abs(straight / curved - 1.0)))

    def _cubics(self, frequency_hz: Floats) -> Complexes:
        hz, gain, *_ = self.table
        if hz.size == 1:
            return self._lines(frequency_hz)
        gains, phases_rad = (monotone_cubic(hz, each, frequency_hz) for each in (gain, self._phase_rad))
        return _phasor(gains, phases_rad)

    def _lines(self, frequency_hz: Floats) -> Complexes:
        hz, gain, *_ = self.table
        return _phasor(np.interp(frequency_hz, hz, gain), np.interp(frequency_hz, hz, self._phase_rad))

    @property
    def _phase_rad(self) -> Floats:
        return np.unwrap(np.radians(self.table[2]))

    def _neighbours(self, frequency_hz: float) -> tuple[int, int]:
        """Return the points below and above, the same one twice on a point."""
        hz = self.table[0]
        nearest = int(np.argmin(np.abs(hz - frequency_hz)))
        if math.isclose(hz[nearest], frequency_hz, rel_tol=_SAME_HZ):
            return nearest, nearest
        high = int(np.searchsorted(hz, frequency_hz))
        turn_deg = abs(math.degrees(self._phase_rad[high] - self._phase_rad[high - 1]))
        if turn_deg > MOST_TURN_DEG:
            raise refusal_error(
                "response.too_sparse",
                where=self.name,
                key=f"{hz[high - 1]:g} … {hz[high]:g} Hz",
                value=f"{turn_deg:.0f} deg",
                limit=f"<= {MOST_TURN_DEG:g} deg",
            )
        return high - 1, high


def _phasor(gain: Floats, phase_rad: Floats) -> Complexes:
    return complexes(gain * np.exp(1j * phase_rad))


def _refuse_points(table: Floats, name: str) -> None:
    hz, gain, _, gain_ci, phase_ci_deg = table
    value = ""
    if not hz.size:
        value = "0"
    elif not (np.isfinite(table).all() and hz[0] > 0.0 and (gain > 0.0).all()):
        value = "T = 0"
    elif (gain_ci < 0.0).any() or (phase_ci_deg < 0.0).any():
        value = "±95% < 0"
    elif (twice := hz[:-1][np.diff(hz) <= _SAME_HZ * hz[:-1]]).size:
        value = f"2 x {twice[0]:g} Hz"
    if value:
        raise refusal_error("response.bad_points", where=name, value=value)
