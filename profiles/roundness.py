"""Roundness of a measured trace: reference circles, filter, parameters and harmonics.

Angles are in degrees, deviations from any nominal radius in um, positive outwards. The circle is fitted in the
limacon model (deviation = R + x cos + y sin), which holds while eccentricity^2 / (2 radius) is small; beyond, a
part of known radius is taken about its own centre. Names after ISO 12181-1 (RONt, RONp, RONv, RONq; LSC: least
squares circle, MZC: minimum zone, MCC: minimum circumscribed, MIC: maximum inscribed) and ISO 16610-21 (the
Gaussian filter, here for a closed profile: no end effects). Where a circle may slide (MCC and MIC of an oval)
the position with the least RONt is taken, then the one nearest to LSC: see `profiles.metrology.circles`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profiles.arrays import Floats
from profiles.metrology.circles import LEAST_SQUARES, ReferenceCircle, least_squares, limacon_circle
from profiles.metrology.filters import POINTS_PER_UNDULATION, gaussian_filter
from profiles.metrology.geometric import circles_about_axis, geometric_circle, polar
from profiles.metrology.harmonics import Harmonic, filled, harmonics, suspects
from profiles.metrology.points import at_equal_angles, checked, equally_spaced, largest_gap_deg
from profiles.metrology.spikes import spike
from profiles.problem import Problem, refused

# The ovality, p-p, that the limacon model may add before the part is taken about its own centre.
_MOST_OVALITY_UM = 0.05
OFF_AXIS = "trace.off_axis"  # code of the warning that a part is off the axis and its radius is not stated
SMALLEST_MM = 5.0  # smallest assumed part radius where a trace does not state it
_EXAMPLE_MM = 25.0  # the radius for which a warning gives the size of the oval
# Fraction of the radius: further off centre the angles about the axis say little about those of the part.
_MOST_ECCENTRIC = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class RoundnessResult:
    """The parameters of one trace, with everything needed to compare them with another's.

    RONt, RONp, RONv and RONq are those of the least squares circle; `circles` has all four, each with its own
    centre. `centre_x_um` (towards angle 0), `centre_y_um` and `mean_deviation_um` are those of the unfiltered
    trace, from the axis of measurement. `harmonics` are n = 2 to 15 (or as many as the points allow) of the
    centred, filtered profile. `filter_upr` is the cut-off in undulations per revolution, None without a filter,
    `above_upr` the lower cut-off of a band pass. `recentred` is whether the part was too far off for the
    limacon model and was taken about its own centre. `left_out` counts suspect points. `state` is the state in
    which the part was measured, such as "free" or "clamped". `warnings` do not invalidate the result.
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
    above_upr: float | None = None
    circles: tuple[ReferenceCircle, ...] = ()
    recentred: bool = False
    left_out: int = 0
    warnings: tuple[Problem, ...] = ()

    @property
    def eccentricity_um(self) -> float:
        """Distance of the centre from the axis of measurement; n = 1 of the unfiltered trace."""
        return math.hypot(self.centre_x_um, self.centre_y_um)

    def amplitude_um(self, n: int) -> float:
        """Return the amplitude of harmonic `n`, 0 where it was not evaluated."""
        return next((h.amplitude_um for h in self.harmonics if h.n == n), 0.0)

    def circle(self, kind: str) -> ReferenceCircle:
        """Return the reference circle of that kind ("LSC", "MZC", "MCC" or "MIC")."""
        return next(circle for circle in self.circles if circle.kind == kind)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Centred:
    """A profile about its least squares circle, um, at angles about the axis, or about its own centre; (M,) each.

    `out` are the excluded points.
    """

    angle_deg: Floats
    profile_um: Floats
    out: NDArray[np.bool_]
    mean_um: float
    x_um: float
    y_um: float
    recentred: bool = False


def evaluate(
    angle_deg: ArrayLike,
    deviation_um: ArrayLike,
    filter_upr: float | None = 50.0,
    *,
    state: str = "unknown",
    radius_mm: float | None = None,
    above_upr: float | None = None,
    robust: bool = False,
) -> RoundnessResult:
    """Return the roundness of a trace of M points against its reference circles.

    Both inputs have shape (M,). Unequal angles are taken without a filter only; with one they are refused
    (`trace.unequal_angles`), because a closed profile is filtered by its spectrum. A gap between neighbouring
    angles above 60 deg is refused (`trace.narrow_angles`), filter or not: nothing in it was measured, and lobes
    of half its width would be missing from the result unnoticed. With `above_upr` the filter is a band pass
    from there. With the radius of the part the circles are those of its points in the plane, and a part too
    eccentric for the limacon model is taken about its own centre; `trace.eccentric` refuses one that is off by
    more than a tenth of its radius. Without it `trace.off_axis`, a warning, says that an eccentricity may show
    as an oval, and of which radii. `robust` excludes suspect points (chips, scratches) and counts them.
    """
    angle, deviation = checked(angle_deg, deviation_um)
    spiked = _spikes(angle, deviation)
    out = suspects(angle, deviation) if robust else np.zeros(angle.shape, dtype=bool)
    centred = _centred(angle, deviation, ~out, radius_mm)
    if filter_upr is not None or above_upr is not None:
        centred = _filtered(angle, centred, filter_upr, above_upr)
    angle, profile = centred.angle_deg[~centred.out], centred.profile_um[~centred.out]
    peak, valley = float(profile.max()), 0.0 - float(profile.min())
    circles = circles_about_axis(angle, profile, None if radius_mm is None else 1000.0 * radius_mm)
    return RoundnessResult(
        ront_um=peak + valley,
        ronp_um=peak,
        ronv_um=valley,
        ronq_um=math.sqrt(float(np.mean(profile**2))),
        centre_x_um=centred.x_um,
        centre_y_um=centred.y_um,
        mean_deviation_um=centred.mean_um,
        reference_circle=LEAST_SQUARES,
        filter_upr=filter_upr,
        above_upr=above_upr,
        state=state,
        points=out.size,
        harmonics=harmonics(angle, profile),
        circles=tuple(_from_axis(circle, centred) for circle in circles),
        recentred=centred.recentred,
        left_out=int(out.sum()),
        warnings=(*_sampling(out.size, filter_upr), *_off_axis(centred, radius_mm), *(() if robust else spiked)),
    )


def centred_profile(angle_deg: ArrayLike, deviation_um: ArrayLike, filter_upr: float | None = 50.0) -> Floats:
    """Return the local deviations from the least squares circle, filtered, in the given order; shape (M,)."""
    return profile_of(angle_deg, deviation_um, filter_upr)[1]


def profile_of(
    angle_deg: ArrayLike,
    deviation_um: ArrayLike,
    filter_upr: float | None = 50.0,
    *,
    kind: str = LEAST_SQUARES,
    radius_mm: float | None = None,
) -> tuple[Floats, Floats]:
    """Return the filtered deviations from a reference circle, um, and their angles, deg; shape (M,) each.

    `kind` is one of `CIRCLES`. The angles are those given but for a part that is taken about its own centre: see
    `evaluate`, also for `radius_mm` and what is raised.
    """
    angle, deviation = checked(angle_deg, deviation_um)
    centred = _centred(angle, deviation, np.ones(angle.shape, dtype=bool), radius_mm)
    if filter_upr is not None:
        centred = _filtered(angle, centred, filter_upr, None)
    angle, profile = centred.angle_deg, centred.profile_um
    if kind == LEAST_SQUARES:
        return angle, profile
    circle, theta = limacon_circle(kind, angle, profile), np.radians(angle)
    x_um, y_um = circle.centre_x_um, circle.centre_y_um
    return angle, profile - circle.deviation_um - x_um * np.cos(theta) - y_um * np.sin(theta)


def _centred(
    angle_deg: Floats, deviation_um: Floats, kept: NDArray[np.bool_], radius_mm: float | None
) -> _Centred:
    """Subtract the circle of the points that are kept from all points."""
    mean_um, x_um, y_um = least_squares(angle_deg[kept], deviation_um[kept])
    theta = np.radians(angle_deg)
    profile = deviation_um - mean_um - x_um * np.cos(theta) - y_um * np.sin(theta)
    centred = _Centred(angle_deg=angle_deg, profile_um=profile, out=~kept, mean_um=mean_um, x_um=x_um, y_um=y_um)
    if radius_mm is None or seen_oval_um_pp(math.hypot(x_um, y_um), radius_mm) <= _MOST_OVALITY_UM:
        return centred
    if math.hypot(x_um, y_um) > 1000 * _MOST_ECCENTRIC * radius_mm:
        value, limit = f"{math.hypot(x_um, y_um):.0f} um", f"<= {1000 * _MOST_ECCENTRIC * radius_mm:.0f} um"
        raise refused("trace.eccentric", key="eccentricity", value=value, limit=limit)
    distance = 1000 * radius_mm + deviation_um
    x, y = distance * np.cos(theta), distance * np.sin(theta)
    circle = geometric_circle(LEAST_SQUARES, x[kept], y[kept], (x_um, y_um))
    centre = (circle.centre_x_um, circle.centre_y_um)
    angle, own_um = polar(x, y, centre)
    return _Centred(
        angle_deg=angle,
        profile_um=own_um - circle.deviation_um,
        out=~kept,
        mean_um=circle.deviation_um - 1000 * radius_mm,
        x_um=centre[0],
        y_um=centre[1],
        recentred=True,
    )


def _filtered(
    measured_deg: Floats, centred: _Centred, filter_upr: float | None, above_upr: float | None
) -> _Centred:
    if filter_upr is None:
        raise refused("value.out_of_range", key="filter_upr", value="none", limit=f"> {above_upr} UPR")
    if not equally_spaced(measured_deg):
        value, limit = f"{largest_gap_deg(measured_deg):g} deg", f"{360 / measured_deg.size:g} deg"
        raise refused("trace.unequal_angles", key="angle_deg", value=value, limit=limit)
    if centred.out.any():
        centred = replace(centred, profile_um=filled(centred.angle_deg, centred.profile_um, centred.out))
    if centred.recentred:
        out = centred.out.astype(np.float64)
        angle, profile = at_equal_angles(centred.angle_deg, centred.profile_um)
        gone = np.interp(angle, centred.angle_deg, out, period=360.0) > 0.0
        centred = replace(centred, angle_deg=angle, profile_um=profile, out=gone)
    order = np.argsort(np.mod(centred.angle_deg, 360.0), kind="stable")
    profile = np.empty_like(centred.profile_um)
    profile[order] = gaussian_filter(centred.profile_um[order], filter_upr, above_upr=above_upr)
    return replace(centred, profile_um=profile)


def _from_axis(circle: ReferenceCircle, centred: _Centred) -> ReferenceCircle:
    return replace(
        circle,
        centre_x_um=circle.centre_x_um + centred.x_um,
        centre_y_um=circle.centre_y_um + centred.y_um,
        deviation_um=circle.deviation_um + centred.mean_um,
    )


def seen_oval_um_pp(eccentricity_um: float, radius_mm: float) -> float:
    """Return the ovality that a circle of a radius shows about an axis this far off its centre: e^2 / (2 R)."""
    return eccentricity_um**2 / (2000.0 * radius_mm)


def _spikes(angle_deg: Floats, deviation_um: Floats) -> tuple[Problem, ...]:
    order = np.argsort(angle_deg, kind="stable")
    if (found := spike(deviation_um[order])) is None:
        return ()
    place, outside_um, allowed_um = found
    key, value = f"{angle_deg[order][place]:.6g} deg", f"{outside_um:+.1f} um"
    return (Problem(code="trace.spike", key=key, value=value, limit=f"{allowed_um:.1f} um"),)


def _off_axis(centred: _Centred, radius_mm: float | None) -> tuple[Problem, ...]:
    """Warn of a part of unknown radius that may look oval only because it is off the axis."""
    eccentricity_um = math.hypot(centred.x_um, centred.y_um)
    if radius_mm is not None or seen_oval_um_pp(eccentricity_um, SMALLEST_MM) <= _MOST_OVALITY_UM:
        return ()
    needed_mm = seen_oval_um_pp(eccentricity_um, 1.0) / _MOST_OVALITY_UM
    value, limit = f"{eccentricity_um:.3g} um", f"{needed_mm:.3g} mm"
    size = f"{seen_oval_um_pp(eccentricity_um, _EXAMPLE_MM):.3g} um (R = {_EXAMPLE_MM:g} mm)"
    return (Problem(code=OFF_AXIS, key=size, value=value, limit=limit),)


def _sampling(points: int, filter_upr: float | None) -> tuple[Problem, ...]:
    if filter_upr is None or points >= POINTS_PER_UNDULATION * filter_upr:
        return ()
    limit = f">= {POINTS_PER_UNDULATION * filter_upr:g}"
    return (Problem(code="trace.few_points", key="filter_upr", value=str(points), limit=limit),)
