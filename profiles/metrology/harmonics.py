"""The undulations of a profile, fitted together for any angles, alien points, and what is between.

Huber weights (1 within 1.345 sigma, falling with the distance beyond) limit the influence of chips and scratches
on the harmonics; sigma is 1.4826 times the median of the absolute residuals. Points further off than `FAR_SIGMA`
are suspect, and the results come from a second least squares fit without them. Dirt and chips are single points
or a few neighbours; more of them side by side are a feature of the part, such as a burr.

Between points a profile is its undulations, as many as the gaps allow to fit, and the rest of it by a monotone
cubic: that overshoots nowhere, however unequal the steps and however noisy the points are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profiles.arrays import Floats
from profiles.least_squares import Fit, fit, harmonic_columns, huber_distances, phasors
from profiles.metrology.points import HANDFUL, angle_weights, check_points, equally_spaced, largest_gap
from profiles.problem import refusal_error

HIGHEST_HARMONIC = 15
# Above this ratio of singular values the angles leave a gap in which harmonics cannot be separated.
_WORST_CONDITION = 100.0
SMALLEST_FACTOR = 0.5
TWO_POINT_DEG = 180.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Harmonic:
    """amplitude cos(n (angle - phase)), with `phase_deg` the first maximum, in [0, 360/n)."""

    n: int
    amplitude_um: float
    phase_deg: float

    def past_jaw_1_deg(self, jaw_1_deg: float, *, against_spindle: bool = False) -> float:
        """Return the angle of its first maximum past jaw 1 as the spindle counts, in [0, 360/n).

        `jaw_1_deg` is where jaw 1 is in the angles of the trace; `against_spindle` says that these run the other
        way round the part than the angles of the spindle.
        """
        past_deg = self.phase_deg - jaw_1_deg
        return _first_deg(-past_deg if against_spindle else past_deg, self.n)


def harmonics(angle_deg: Floats, profile_um: Floats) -> tuple[Harmonic, ...]:
    """Fit n = 1 to 15 together, or fewer where the points cannot separate them; return those from 2."""
    for highest in range(min(HIGHEST_HARMONIC, (angle_deg.size - 1) // 2), 1, -1):
        orders = range(1, highest + 1)
        found = fit(harmonic_columns(np.radians(angle_deg), orders), profile_um, np.sqrt(angle_weights(angle_deg)))
        if found.condition <= _WORST_CONDITION:
            waves = phasors(found.coefficients, orders)
            return tuple(harmonic(n, c.real, -c.imag) for n, c in waves.items() if n > 1)
    return ()


def harmonic(n: int, cosine_um: float, sine_um: float) -> Harmonic:
    """Return cosine cos(n angle) + sine sin(n angle) as amplitude and first maximum."""
    phase_deg = _first_deg(math.degrees(math.atan2(sine_um, cosine_um)) / n, n)
    return Harmonic(n=n, amplitude_um=math.hypot(cosine_um, sine_um), phase_deg=phase_deg)


def _first_deg(phase_deg: float, n: int) -> float:
    first_deg = phase_deg % (360 / n)
    # The remainder of a tiny negative number rounds up to the divisor.
    return 0.0 if first_deg >= 360 / n else first_deg


FAR_SIGMA = 4.5
"""A harmonic between the fitted ones has its maxima at 1 sigma / 0.95; of 3600 Gaussian points 0.02 lie beyond."""
LARGEST_FRACTION = 0.1
_SETTLED = 1e-3
MOST_DIRT_POINTS, MOST_DIRT_DEG = 3, 2.0
"""Up to so many suspect neighbours, within this angle, are dirt (choice); beyond they are a feature."""
_ROUNDING = 1e-9  # fraction of the peak-to-peak value below which a residual is arithmetic rounding


def suspects(angle_deg: Floats, deviation_um: Floats) -> NDArray[np.bool_]:
    """Return which points are suspect; shape (M,).

    Raises `ProfileError`: `trace.outliers`, they are more than `LARGEST_FRACTION` of all: then the part is rough,
    not dirty.
    """
    orders = range(1, min(HIGHEST_HARMONIC, (angle_deg.size - 1) // 4) + 1)
    columns = harmonic_columns(np.radians(angle_deg), orders)
    least_um = _ROUNDING * float(np.ptp(deviation_um))
    found = huber_distances(columns, deviation_um, np.ones_like(deviation_um), least_um, _SETTLED) > FAR_SIGMA
    if found.mean() > LARGEST_FRACTION:
        value, limit = f"{100 * found.mean():.0f} %", f"<= {100 * LARGEST_FRACTION:g} %"
        raise refusal_error("trace.outliers", value=value, limit=limit)
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Feature:
    """Neighbouring suspect points, from `first_deg` on to `last_deg`; the furthest is `height_um` off the rest."""

    first_deg: float
    last_deg: float
    points: int
    height_um: float


def features(
    angle_deg: Floats, deviation_um: Floats, suspect: NDArray[np.bool_]
) -> dict[Feature, NDArray[np.intp]]:
    """Return the features among suspect points (M,), each with the indices of its points.

    One sound point between two suspect ones does not part them.
    """
    order = np.argsort(np.mod(angle_deg, 360.0), kind="stable")
    places = np.flatnonzero(suspect[order])
    if not places.size:
        return {}
    ahead = np.diff(places, append=places[0] + order.size)
    ends = np.flatnonzero(ahead > 2)
    # The turn is opened after the end of a run: none crosses its seam.
    opened = np.roll(places, -(ends[-1] + 1)) if ends.size else places
    runs = np.split(opened, np.flatnonzero(np.mod(np.diff(opened), order.size) > 2) + 1)
    clean = ~suspect
    sound_um = interpolate_profile(angle_deg[clean], deviation_um[clean], angle_deg)
    found = {}
    for run in (order[each] for each in runs):
        first, last = (float(angle_deg[run[end]]) for end in (0, -1))
        if run.size == 1 or (run.size <= MOST_DIRT_POINTS and (last - first) % 360.0 <= MOST_DIRT_DEG):
            continue
        off_um = deviation_um[run] - sound_um[run]
        height_um = float(off_um[np.argmax(np.abs(off_um))])
        found[Feature(first_deg=first, last_deg=last, points=run.size, height_um=height_um)] = run
    return found


_BRIDGING_CONDITION = 5.0  # noise grows less than this in the undulations that bridge a gap (choice)
_HEAVIEST = 4.0  # most weight of a point in their fit: those at the edges of a gap stand for all of it
_WIDER = 1.5  # steps of the median one that make a gap: a point is missing


def interpolate_profile(
    angle_deg: Floats, profile_um: Floats, target_deg: Floats, highest: int = HIGHEST_HARMONIC
) -> Floats:
    """Return a closed profile at other angles, by undulations up to `highest` at most; shape as `target_deg`.

    Points at one angle count as their mean.
    """
    from scipy.interpolate import PchipInterpolator

    turned, place = np.unique(np.round(np.mod(angle_deg, 360.0), 9) % 360.0, return_inverse=True)
    found = _undulations(turned, np.bincount(place, profile_um) / np.bincount(place), highest)
    step = np.arange(-2, turned.size + 2)
    known = np.take(turned, step, mode="wrap") + 360.0 * np.floor_divide(step, turned.size)
    rest = PchipInterpolator(known, np.take(found.residuals, step, mode="wrap"))(np.mod(target_deg, 360.0))
    orders = range(1, len(found.coefficients) // 2 + 1)
    return np.asarray(harmonic_columns(np.radians(target_deg), orders) @ found.coefficients + rest)


def bridging_order(angle_deg: Floats) -> int:
    """Return the highest undulation that bridges the gaps between angles."""
    return len(_undulations(angle_deg, np.zeros(angle_deg.size), HIGHEST_HARMONIC).coefficients) // 2


def _undulations(angle_deg: Floats, profile_um: Floats, highest: int) -> Fit:
    highest = min(highest, (angle_deg.size - 1) // 4)
    columns = harmonic_columns(np.radians(angle_deg), range(1, highest + 1))
    root = np.sqrt(np.minimum(angle_weights(angle_deg), _HEAVIEST))
    found = fit(columns, profile_um, root)
    while found.condition > _BRIDGING_CONDITION and highest:
        highest -= 1
        found = fit(columns[:, : 1 + 2 * highest], profile_um, root)
    return found


def at_equal_angles(angle_deg: Floats, profile_um: Floats) -> tuple[Floats, Floats]:
    """Return the profile at equal angles, about as dense as the median step, from the first point on."""
    size, step_deg = angle_deg.size, largest_gap(angle_deg)[2]
    count = max(size, min(round(360.0 / max(step_deg, 1e-9)), 2 * size))
    target = np.mod(angle_deg[0] + np.arange(count) * (360.0 / count), 360.0)
    return target, interpolate_profile(angle_deg, profile_um, target)


def has_gap(angle_deg: Floats, widest_deg: float) -> bool:
    """Return whether a profile has a step above `widest_deg` and the others: it is bridged."""
    _, gap_deg, step_deg = largest_gap(angle_deg)
    return angle_deg.size >= HANDFUL and gap_deg > max(widest_deg, _WIDER * step_deg)


def bridge_gaps(angle_deg: Floats, profile_um: Floats, widest_deg: float) -> tuple[Floats, Floats]:
    """Return the points of a profile, followed by interpolated ones in its gaps, a third of `widest_deg` apart."""
    turned = np.sort(np.mod(angle_deg, 360.0))
    gaps = np.diff(turned, append=turned[0] + 360.0)
    step_deg = float(np.median(gaps))
    wide = np.flatnonzero(gaps > max(widest_deg, _WIDER * step_deg))
    counts = np.ceil(gaps[wide] / max(step_deg, widest_deg / 3.0) - _ROUNDING).astype(int)
    pieces = zip(turned[wide], gaps[wide], counts, strict=True)
    added = np.concatenate([first + gap * np.arange(1, count) / count for first, gap, count in pieces])
    return np.append(angle_deg, np.mod(added, 360.0)), np.append(
        profile_um, interpolate_profile(angle_deg, profile_um, added)
    )


def spectrum_um_pp(angle_deg: ArrayLike, profile_um: ArrayLike) -> Floats:
    """Return peak to peak um of each order, shape (M // 2 + 1,), index 0 for the mean.

    M points at equal angles, in any order; an empty array for unequal ones, whose orders are not separate.
    Raises as `profiles.metrology.points.checked`.
    """
    angle, profile = check_points(angle_deg, profile_um)
    if not equally_spaced(angle):
        return np.zeros(0)
    amplitude = 2.0 / profile.size * np.abs(np.fft.rfft(profile[np.argsort(np.mod(angle, 360.0), kind="stable")]))
    amplitude[0] /= 2.0
    return np.asarray(2.0 * amplitude, dtype=np.float64)


def v_block_factor(lobes: int, included_deg: float) -> float:
    """Return F_n, the reading's amplitude over the lobe's; the sign is that of a maximum under the indicator.

    The part turns in a V of included angle 2 h, the indicator is on the bisector opposite the V:
    F_n = 1 + (-1)^n cos(n (90 deg - h)) / sin h. A V of 180 deg is the measurement of a diameter: 0 for odd n.
    Raises `ProfileError`: `value.out_of_range`, fewer than 2 lobes, or an angle outside of 0 to 180 deg.
    """
    if lobes < 2:
        raise refusal_error("value.out_of_range", key="lobes", value=str(lobes), limit=">= 2")
    if not 0.0 < included_deg <= TWO_POINT_DEG:
        value, limit = f"{included_deg:g}", "> 0, < 180 deg"
        raise refusal_error("value.out_of_range", key="vblock", value=value, limit=limit)
    half = math.radians(included_deg / 2)
    sign = -1.0 if lobes % 2 else 1.0
    return 1.0 + sign * math.cos(lobes * (math.pi / 2 - half)) / math.sin(half)


def usable_factor(lobes: int, included_deg: float) -> float:
    """Return the factor by which a reading must be divided.

    Raises as `v_block_factor`; `trace.two_point`; `trace.v_block_blind`, the factor is below `SMALLEST_FACTOR`, so
    that the lobes would hardly be read.
    """
    factor = v_block_factor(lobes, included_deg)
    if included_deg == TWO_POINT_DEG:
        raise refusal_error("trace.two_point", key="vblock", value=f"{included_deg:g} deg")
    if abs(factor) < SMALLEST_FACTOR:
        key, limit = f"{lobes}, {included_deg:g} deg", f">= {SMALLEST_FACTOR:g}"
        raise refusal_error("trace.v_block_blind", key=key, value=f"{abs(factor):.3f}", limit=limit)
    return factor
