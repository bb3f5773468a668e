"""Roundness of a measured trace: reference circle, filter, parameters and harmonics.

Angles are in degrees, deviations from any nominal radius in um, positive outwards. The circle is fitted in
the limacon model (deviation = R + x cos + y sin), which holds while eccentricity^2 / (2 radius) is small.
Names after ISO 12181-1 (RONt, RONp, RONv, RONq; LSC: least squares circle) and ISO 16610-21 (the Gaussian
filter, here for a closed profile: no end effects).

Problem codes: `trace.columns`, `trace.not_finite`, `trace.few_points`, `trace.unequal_angles`,
`trace.narrow_angles`, `value.out_of_range` (of the filter); as a warning also `trace.eccentric`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profiles.problem import Problem, ProfileError

FloatArray = NDArray[np.float64]

FEWEST_POINTS = 4
HIGHEST_HARMONIC = 15
POINTS_PER_UNDULATION = 7
LARGEST_GAP_DEG = 60.0
"""Half the wave of a three-lobe, crest to valley: in a larger gap all of it can hide."""
# sqrt(ln 2 / pi): the transmission at the cut-off is one half.
_ALPHA = math.sqrt(math.log(2) / math.pi)
# Share of a step by which the angles of an equally spaced trace may be off, such as by rounding in a file.
_SPACING_TOLERANCE = 0.01
# Above this ratio of singular values the angles leave a gap in which harmonics can be traded for each other.
_WORST_CONDITION = 100.0
_GAP_TOLERANCE_DEG = 1e-6
# The ovality, p-p, that the limacon model may add to an eccentric trace before it is mentioned.
_MOST_OVALITY_UM = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Harmonic:
    """amplitude cos(n (angle - phase)), with `phase_deg` the first crest, in [0, 360/n)."""

    n: int
    amplitude_um: float
    phase_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RoundnessResult:
    """The parameters of one trace, with everything that is needed to compare them with another's.

    `centre_x_um` (towards angle 0), `centre_y_um` and `mean_deviation_um` are those of the unfiltered trace.
    `harmonics` are n = 2 to 15 (or as many as the points allow) of the centred, filtered profile.
    `filter_upr` is the cut-off in undulations per revolution, None without a filter. `state` says in which
    state the part was measured, such as "free" or "clamped". `warnings` do not spoil the result.
    """

    ront_um: float
    ronp_um: float
    ronv_um: float
    ronq_um: float
    centre_x_um: float
    centre_y_um: float
    mean_deviation_um: float
    reference_circle: str
    filter_upr: float | None
    state: str
    points: int
    harmonics: tuple[Harmonic, ...]
    warnings: tuple[Problem, ...] = ()

    @property
    def eccentricity_um(self) -> float:
        """Distance of the centre from the axis of measurement; n = 1 of the unfiltered trace."""
        return math.hypot(self.centre_x_um, self.centre_y_um)

    def amplitude_um(self, n: int) -> float:
        """Return the amplitude of harmonic `n`, 0 where it was not evaluated."""
        return next((h.amplitude_um for h in self.harmonics if h.n == n), 0.0)


def evaluate(
    angle_deg: ArrayLike,
    deviation_um: ArrayLike,
    filter_upr: float | None = 50.0,
    *,
    state: str = "unknown",
    radius_mm: float | None = None,
) -> RoundnessResult:
    """Return the roundness of a trace of M points against its least squares circle.

    Both inputs have shape (M,). Unequal angles are taken without a filter only; with one they are refused
    (`trace.unequal_angles`), because a closed profile is filtered by its spectrum. A gap between neighbouring
    angles above `LARGEST_GAP_DEG` is refused (`trace.narrow_angles`), filter or not: what stands in it was not
    measured, and lobes of half its width would be missing from the result without a trace. With the radius of the
    part a warning says when the trace is too eccentric for the limacon model (`trace.eccentric`).
    """
    angle, deviation = _checked(angle_deg, deviation_um)
    mean_um, x_um, y_um = _circle(angle, deviation)
    profile = centred_profile(angle, deviation, filter_upr)
    peak, valley = float(profile.max()), 0.0 - float(profile.min())
    return RoundnessResult(
        ront_um=peak + valley,
        ronp_um=peak,
        ronv_um=valley,
        ronq_um=math.sqrt(float(np.mean(profile**2))),
        centre_x_um=x_um,
        centre_y_um=y_um,
        mean_deviation_um=mean_um,
        reference_circle="LSC",
        filter_upr=filter_upr,
        state=state,
        points=angle.size,
        harmonics=_harmonics(angle, profile),
        warnings=(*_sampling(angle.size, filter_upr), *_centring(math.hypot(x_um, y_um), radius_mm)),
    )


def centred_profile(angle_deg: ArrayLike, deviation_um: ArrayLike, filter_upr: float | None = 50.0) -> FloatArray:
    """Return the local deviations from the least squares circle, filtered, in the given order; shape (M,)."""
    angle, deviation = _checked(angle_deg, deviation_um)
    mean_um, x_um, y_um = _circle(angle, deviation)
    theta = np.radians(angle)
    centred = deviation - mean_um - x_um * np.cos(theta) - y_um * np.sin(theta)
    if filter_upr is None:
        return np.asarray(centred, dtype=np.float64)
    if not equally_spaced(angle):
        value, limit = f"{largest_gap_deg(angle):g} deg", f"{360 / angle.size:g} deg"
        raise ProfileError(Problem(code="trace.unequal_angles", key="angle_deg", value=value, limit=limit))
    order = np.argsort(np.mod(angle, 360.0), kind="stable")
    filtered = np.empty_like(centred)
    filtered[order] = gaussian_filter(centred[order], filter_upr)
    return filtered


def gaussian_transmission(undulations: ArrayLike, cutoff_upr: float) -> FloatArray:
    """Return exp(-pi (alpha n / n_c)^2), the low-pass of ISO 16610-21: one half at the cut-off."""
    n = np.asarray(undulations, dtype=np.float64)
    return np.asarray(np.exp(-math.pi * (_ALPHA * n / cutoff_upr) ** 2), dtype=np.float64)


def gaussian_filter(profile_um: ArrayLike, cutoff_upr: float) -> FloatArray:
    """Return a closed profile, equally spaced and in the order of its angles, through the low-pass."""
    if not (math.isfinite(cutoff_upr) and cutoff_upr > 0):
        raise ProfileError(
            Problem(code="value.out_of_range", key="filter_upr", value=f"{cutoff_upr:g}", limit="> 0 UPR")
        )
    profile = np.asarray(profile_um, dtype=np.float64)
    spectrum = np.fft.rfft(profile)
    return np.fft.irfft(spectrum * gaussian_transmission(np.arange(spectrum.size), cutoff_upr), profile.size)


def equally_spaced(angle_deg: ArrayLike) -> bool:
    """Return whether the angles, in any order and from any start, divide the turn into equal steps."""
    gaps = _gaps_deg(angle_deg)
    step = 360.0 / gaps.size
    return bool(np.all(np.abs(gaps - step) <= _SPACING_TOLERANCE * step))


def largest_gap_deg(angle_deg: ArrayLike) -> float:
    """Return the largest step between neighbouring angles, in any order and from any start."""
    return float(_gaps_deg(angle_deg).max())


def _gaps_deg(angle_deg: ArrayLike) -> FloatArray:
    angle = np.sort(np.mod(np.asarray(angle_deg, dtype=np.float64), 360.0))
    return np.diff(angle, append=angle[0] + 360.0)


def _checked(angle_deg: ArrayLike, deviation_um: ArrayLike) -> tuple[FloatArray, FloatArray]:
    angle = np.asarray(angle_deg, dtype=np.float64)
    deviation = np.asarray(deviation_um, dtype=np.float64)
    if angle.ndim != 1 or angle.shape != deviation.shape:
        value = f"{angle.shape} {deviation.shape}"
        raise ProfileError(Problem(code="trace.columns", value=value, limit="(M,) (M,)"))
    if angle.size < FEWEST_POINTS:
        raise ProfileError(Problem(code="trace.few_points", value=str(angle.size), limit=f">= {FEWEST_POINTS}"))
    for key, values in (("angle_deg", angle), ("deviation_um", deviation)):
        if not np.isfinite(values).all():
            value = f"{values[~np.isfinite(values)][0]:g}"
            raise ProfileError(Problem(code="trace.not_finite", key=key, value=value))
    gap_deg = largest_gap_deg(angle)
    if gap_deg > LARGEST_GAP_DEG + _GAP_TOLERANCE_DEG:
        value, limit = f"{gap_deg:g} deg", f"<= {LARGEST_GAP_DEG:g} deg"
        raise ProfileError(Problem(code="trace.narrow_angles", key="angle_deg", value=value, limit=limit))
    return angle, deviation


def _circle(angle_deg: FloatArray, deviation_um: FloatArray) -> tuple[float, float, float]:
    """Return mean, x and y of the least squares circle."""
    theta = np.radians(angle_deg)
    design = np.column_stack((np.ones_like(theta), np.cos(theta), np.sin(theta)))
    solution = np.linalg.lstsq(design, deviation_um, rcond=None)[0]
    return float(solution[0]), float(solution[1]), float(solution[2])


def _harmonics(angle_deg: FloatArray, profile_um: FloatArray) -> tuple[Harmonic, ...]:
    """Fit n = 1 to 15 together, or fewer where the points cannot tell them apart; return those from 2."""
    for highest in range(min(HIGHEST_HARMONIC, (angle_deg.size - 1) // 2), 1, -1):
        n = np.arange(1, highest + 1)
        waves = np.radians(angle_deg)[:, np.newaxis] * n
        design = np.hstack((np.ones((angle_deg.size, 1)), np.cos(waves), np.sin(waves)))
        solution, _, _, singular = np.linalg.lstsq(design, profile_um, rcond=None)
        if singular[-1] * _WORST_CONDITION >= singular[0]:
            pairs = zip(n[1:], solution[2 : highest + 1], solution[highest + 2 :], strict=True)
            return tuple(_harmonic(int(k), float(cosine), float(sine)) for k, cosine, sine in pairs)
    return ()


def _harmonic(n: int, cosine_um: float, sine_um: float) -> Harmonic:
    phase_deg = math.degrees(math.atan2(sine_um, cosine_um)) / n % (360 / n)
    if phase_deg >= 360 / n:  # the remainder of a tiny negative number rounds up to the divisor
        phase_deg = 0.0
    return Harmonic(n=n, amplitude_um=math.hypot(cosine_um, sine_um), phase_deg=phase_deg)


def _sampling(points: int, filter_upr: float | None) -> tuple[Problem, ...]:
    if filter_upr is None or points >= POINTS_PER_UNDULATION * filter_upr:
        return ()
    limit = f">= {POINTS_PER_UNDULATION * filter_upr:g}"
    return (Problem(code="trace.few_points", key="filter_upr", value=str(points), limit=limit),)


def _centring(eccentricity_um: float, radius_mm: float | None) -> tuple[Problem, ...]:
    """The limacon of an eccentricity e has a second harmonic of e^2 / (2 R), peak to peak."""
    if radius_mm is None:
        return ()
    ovality_um = eccentricity_um**2 / (2000 * radius_mm)
    if ovality_um <= _MOST_OVALITY_UM:
        return ()
    limit = f"<= {_MOST_OVALITY_UM:g} um"
    return (Problem(code="trace.eccentric", key="eccentricity", value=f"{ovality_um:.3g} um", limit=limit),)
