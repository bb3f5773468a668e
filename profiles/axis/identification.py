"""The response of an axis to a sine: gain, phase, their confidence and the coherence, from samples alone.

In a segment of whole periods each signal is fitted by least squares with

x(t) = a cos(w t) + b sin(w t) + c + d (t - tm),    w = 2 pi f, tm the middle of the segment,

so that an offset and a drift (an integrator that settles) do not leak into the sine. Its phasor is X = a - j b,
with x(t) = Re{X exp(j w t)}. Of the K segments with phasors R_k of the reference and Y_k of the response

H  = sum Y_k conj(R_k) / sum |R_k|^2                                     least squares over the segments
    g2 = |sum Y_k conj(R_k)|^2 / (sum |R_k|^2 sum |Y_k|^2)                   coherence, magnitude squared, 0 to 1

(J. S. Bendat and A. G. Piersol, Random Data: the estimator H1 and its coherence, at one frequency). A lag is a
negative phase. The coherence of K segments without any relation has the mean 1/K, not 0. It is over the segments,
and shows what differs between them; what is the same in all of them, such as a wrong gain, leaves it at 1.

The confidence is the larger of two, because each is blind to something. By the scatter of the segments, with
e_k = Y_k - H R_k, a component of H has the variance sum |e_k|^2 / (2 (K - 1)) / sum |R_k|^2, of 2 (K - 1) degrees
of freedom: that sees what changes from one segment to the next. By the residuals of the fits, a sample of the
variance s^2, it has s^2 times that of the normal equations: that sees what a handful of segments may hide by
chance. Half-widths are for 95 %, by Student's t.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Complexes, Floats, floats
from profiles.least_squares import fit, harmonic_columns, harmonic_slice, phasors, student
from profiles.problem import refusal_error

MOST_SEGMENTS = 10  # maximum segments of a record; each has as many whole periods as that requires
LEAST_SEGMENTS = 2  # one segment always has a coherence of 1
PARAMETERS = 4
LEAST_SAMPLES = 2 * PARAMETERS  # per segment: twice the fitted parameters, for a meaningful residual
LEAST_SAMPLES_A_PERIOD = 2.499  # above two, or the sine is aliased


@dataclass(frozen=True, slots=True, kw_only=True)
class SineFit:
    """A sine in samples: `phasor` X in Re{X exp(j w t)}, `residual` the standard deviation of the residuals.

    `phasor_variance` is that of a component of the phasor if the residuals are white.
    """

    phasor: complex
    offset: float
    drift_per_s: float
    residual: float
    phasor_variance: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FrequencyResponse:
    """The response at one frequency. `reference` is the amplitude of the reference, in its unit.

    `gain_ci` and `phase_ci_deg` are half-widths for 95 %. The phase is in -180 to 180 deg.
    """

    frequency_hz: float
    gain: float
    phase_deg: float
    gain_ci: float
    phase_ci_deg: float
    coherence: float
    reference: float
    segments: int

    @property
    def response(self) -> complex:
        """Gain and phase as one complex number."""
        return cmath.rect(self.gain, math.radians(self.phase_deg))


def fit_sine(
    time_s: ArrayLike, values: ArrayLike, frequency_hz: float, carrier_hz: float | None = None
) -> SineFit:
    """Fit a sine of known frequency with offset and drift, and the slow one that carries it; times start anywhere.

    Raises `ProfileError` (`identification.too_short`, `identification.not_finite`).
    """
    time, samples = _columns(time_s, values)
    if len(time) < LEAST_SAMPLES:
        limit = f">= {LEAST_SAMPLES}"
        raise refusal_error("identification.too_short", value=f"{len(time)}", limit=limit)
    angle = 2.0 * np.pi * frequency_hz * time
    middle = 0.5 * (time[0] + time[-1])
    slow = 2.0 * np.pi * (carrier_hz or 0.0) * time
    others = [time - middle] if carrier_hz is None else [time - middle, np.cos(slow), np.sin(slow)]
    found = fit(harmonic_columns(angle, (1,), *others), samples)
    offset, drift_per_s = found.coefficients[:2]
    sine = harmonic_slice(0, trends=len(others))
    return SineFit(
        phasor=phasors(found.coefficients, (1,), trends=len(others))[1],
        offset=float(offset),
        drift_per_s=float(drift_per_s),
        residual=found.residual_sd,
        phasor_variance=0.5 * float(np.trace(found.covariance[sine, sine])),
    )


def frequency_response(
    time_s: ArrayLike,
    reference: ArrayLike,
    response: ArrayLike,
    frequency_hz: float,
    carrier_hz: float | None = None,
) -> FrequencyResponse:
    """Return the response of `response` to `reference` at one frequency, from simultaneous samples.

    The sine of a carrier is midway between two of its multiples, and each segment has whole periods of both.

    Raises `ProfileError`: `identification.too_short`, less than two segments of whole periods;
    `identification.not_finite`; `identification.no_reference`, it contains nothing at that frequency.
    """
    time, given = _columns(time_s, reference)
    _, answered = _columns(time_s, response)
    pieces = _segments(time, frequency_hz, carrier_hz)
    references = [fit_sine(time[piece], given[piece], frequency_hz, carrier_hz) for piece in pieces]
    responses = [fit_sine(time[piece], answered[piece], frequency_hz, carrier_hz) for piece in pieces]
    r = np.array([fit.phasor for fit in references])
    y = np.array([fit.phasor for fit in responses])
    energy = float(np.sum(np.abs(r) ** 2))
    if math.sqrt(energy / len(r)) <= _rounding(given):
        raise refusal_error("identification.no_reference", value=f"{frequency_hz:g} Hz")
    found = complex(np.sum(y * r.conj())) / energy
    gain_ci = max(_by_scatter(r, y, found, energy), _by_residuals(r, responses, energy))
    return FrequencyResponse(
        frequency_hz=frequency_hz,
        gain=abs(found),
        phase_deg=math.degrees(cmath.phase(found)),
        gain_ci=gain_ci,
        # The half-angle subtended by the confidence circle; one that contains 0 determines no phase.
        phase_ci_deg=math.degrees(math.asin(gain_ci / abs(found))) if gain_ci < abs(found) else 180.0,
        coherence=_coherence(r, y, energy, _rounding(answered)),
        reference=math.sqrt(energy / len(r)),
        segments=len(pieces),
    )


def reference_swing(
    time_s: ArrayLike, reference: ArrayLike, frequency_hz: float, carrier_hz: float | None = None
) -> float:
    """Return the largest relative deviation of the reference amplitude from its mean over the segments.

    Raises as for `frequency_response`.
    """
    time, given = _columns(time_s, reference)
    pieces = _segments(time, frequency_hz, carrier_hz)
    sizes = np.abs([fit_sine(time[piece], given[piece], frequency_hz, carrier_hz).phasor for piece in pieces])
    mean = float(sizes.mean())
    return float(np.abs(sizes - mean).max()) / mean if mean else math.inf


def _columns(time_s: ArrayLike, values: ArrayLike) -> tuple[Floats, Floats]:
    time, samples = floats(time_s), floats(values)
    if not (np.isfinite(time).all() and np.isfinite(samples).all()):
        raise refusal_error("identification.not_finite")
    return time, samples


def _segments(time: Floats, frequency_hz: float, carrier_hz: float | None) -> list[slice]:
    """Return the segments of a record, each as near to whole periods as the samples allow."""
    if len(time) < LEAST_SEGMENTS * LEAST_SAMPLES:
        limit = f">= {LEAST_SEGMENTS * LEAST_SAMPLES}"
        raise refusal_error("identification.too_short", value=f"{len(time)}", limit=limit)
    step_s = (time[-1] - time[0]) / (len(time) - 1)
    # The sample after the last one would end its period.
    periods = math.floor(len(time) * step_s * frequency_hz + 0.5 * step_s * frequency_hz)
    whole = 1 if carrier_hz is None else round(2.0 * frequency_hz / carrier_hz)
    each = whole * max(1, math.ceil(periods / whole / MOST_SEGMENTS))
    edges = [round(k * each / frequency_hz / step_s) for k in range(periods // each + 1)]
    pieces = [slice(first, min(last, len(time))) for first, last in pairwise(edges)]
    samples = 1.0 / frequency_hz / step_s
    shortest = min((piece.stop - piece.start for piece in pieces), default=0)
    if len(pieces) < LEAST_SEGMENTS or shortest < LEAST_SAMPLES or samples < LEAST_SAMPLES_A_PERIOD:
        value = f"{periods} periods of {samples:.3g} samples"
        limit = f">= {LEAST_SEGMENTS} periods of {LEAST_SAMPLES} samples"
        raise refusal_error("identification.too_short", value=value, limit=limit)
    return pieces


def _by_scatter(r: Complexes, y: Complexes, found: complex, energy: float) -> float:
    freedom = 2 * (len(r) - 1)
    variance = float(np.sum(np.abs(y - found * r) ** 2)) / freedom / energy
    return student(freedom) * math.sqrt(variance)


def _by_residuals(r: Complexes, responses: list[SineFit], energy: float) -> float:
    variances = np.array([fit.phasor_variance for fit in responses])
    variance = float(np.sum(np.abs(r) ** 2 * variances)) / energy**2
    return student(math.inf) * math.sqrt(variance)


def _rounding(samples: Floats) -> float:
    """Return the amplitude below which a phasor is only rounding of the samples, identical in all."""
    return 1e-12 * float(np.abs(samples).max())


def _coherence(r: Complexes, y: Complexes, energy: float, least: float) -> float:
    answered = float(np.sum(np.abs(y) ** 2))
    if math.sqrt(answered / len(y)) <= least:
        return 0.0
    return min(1.0, abs(complex(np.sum(y * r.conj()))) ** 2 / (energy * answered))
