"""Roundness of a measured trace: reference circles, filter, parameters and harmonics.

Angles are in degrees, deviations from any nominal radius in um, positive outwards. The circle is fitted in the
limacon model (deviation = R + x cos + y sin), which holds while eccentricity^2 / (2 radius) is small; beyond, a
part of known radius is taken about its own centre. Names after ISO 12181-1 (RONt, RONp, RONv, RONq; LSC: least
squares circle, MZC: minimum zone, MCC: minimum circumscribed, MIC: maximum inscribed) and ISO 16610-21 (the
Gaussian filter, here for a closed profile: no end effects; others are in `profiles.metrology.profile_filters`).
Where a circle may slide (MCC and MIC of an oval) the position with the least RONt is taken, then the one nearest
to LSC: see `profiles.metrology.circles`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats
from profiles.metrology.circles import LEAST_SQUARES, ReferenceCircle, least_squares, limacon_circle
from profiles.metrology.geometric import circles_about_axis, geometric_circle, polar
from profiles.metrology.harmonics import (
    Feature,
    Harmonic,
    at_equal_angles,
    bridge_gaps,
    bridging_order,
    features,
    harmonics,
    has_gap,
    interpolate_profile,
    suspects,
)
from profiles.metrology.points import (
    POINTS_PER_UNDULATION,
    angle_weights,
    check_points,
    equally_spaced,
    largest_gap,
    largest_gap_deg,
)
from profiles.metrology.profile_filters import FilterKind, filter_profile
from profiles.problem import Problem, refusal_error

# The ovality, p-p, that the limacon model may add before the part is taken about its own centre.
_MOST_OVALITY_UM = 0.05
OFF_AXIS = "trace.off_axis"  # code of the warning that a part is off the axis and its radius is not stated
SMALLEST_MM = 5.0  # smallest assumed part radius where a trace does not state it
_EXAMPLE_MM = 25.0  # the radius for which a warning gives the size of the oval
# Fraction of the radius: further off centre the angles about the axis say little about those of the part.
_MOST_ECCENTRIC = 0.1
_UNFILTERED_UPR = 50.0  # undulations that the points of a trace without a filter have to show
# Most by which interpolation may change RONt (choice): so many um, or this fraction of RONt.
MOST_INTERPOLATED_UM, MOST_INTERPOLATED_FRACTION = 0.5, 0.05
_TRIALS = 36  # places where a gap like that of the trace is tried, to see its effect
_ROOM = 1.25  # gaps, and a step: what is wider is such a gap beside that of the trace
_TRIAL_POINTS = 1800  # of so many points: more make it no better known
LEAST_SPIKE_UM = 5.0  # less makes no round part out of tolerance (choice)
FAR_SD = 8.0  # of the scatter from point to point; of 3600 points with noise alone none is as far
NEIGHBOURS = (-2, -1, 1, 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class RoundnessResult:
    """The parameters of one trace, with everything needed to compare them with another's.

    RONt, RONp, RONv and RONq are those of the least squares circle; `circles` has all four, each with its own
    centre. `centre_x_um` (towards angle 0), `centre_y_um` and `mean_deviation_um` are those of the unfiltered
    trace (robust filter: of the filtered one), from the axis of measurement. `harmonics` are n = 2 to 15 (or as
    many as the points allow) of the centred, filtered profile. `filter_upr` is the cut-off of the `filter_kind`
    in undulations per revolution, None without a filter, `above_upr` the lower cut-off of a band pass.
    `recentred` is whether the part was too far off for the limacon model and was taken about its own centre.
    `left_out` counts suspect points. `state` is the state in which the part was measured, such as "free" or
    "clamped". `features` are neighbouring suspect points, which stay in; `without_features` is the result
    without them. `warnings` do not invalidate the result.
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
    filter_kind: FilterKind = FilterKind.GAUSS
    above_upr: float | None = None
    circles: tuple[ReferenceCircle, ...] = ()
    recentred: bool = False
    left_out: int = 0
    features: tuple[Feature, ...] = ()
    without_features: RoundnessResult | None = None
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
class _CentredProfile:
    """A profile about its least squares circle, um, at angles about the axis, or about its own centre; (M,) each.

    In the gaps of the trace, and at equal angles once it is filtered, its points are interpolated.
    """

    angle_deg: Floats
    profile_um: Floats
    mean_um: float
    x_um: float
    y_um: float
    recentred: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class _Method:
    """How a trace is evaluated: see `evaluate`."""

    filter_upr: float | None
    above_upr: float | None = None
    radius_mm: float | None = None
    kind: FilterKind = FilterKind.GAUSS

    @property
    def widest_deg(self) -> float:
        """The widest step that still shows what passes the filter: wider ones are bridged, and told."""
        return 360.0 / (POINTS_PER_UNDULATION * (self.filter_upr or _UNFILTERED_UPR))

    def profile(self, angle: Floats, deviation: Floats) -> _CentredProfile:
        """Return the whole profile of M points, (M,) each: gaps bridged, centred, filtered."""
        if self.filter_upr is not None and not (math.isfinite(self.filter_upr) and self.filter_upr > 0.0):
            raise refusal_error(
                "value.out_of_range", key="filter_upr", value=f"{self.filter_upr:g}", limit="> 0 UPR"
            )
        if has_gap(angle, self.widest_deg):
            angle, deviation = bridge_gaps(angle, deviation, self.widest_deg)
        centred = _centre_profile(angle, deviation, self.radius_mm)
        if self.filter_upr is None and self.above_upr is None:
            return centred
        return _filter_profile(centred, self)


def evaluate(
    angle_deg: ArrayLike,
    deviation_um: ArrayLike,
    filter_upr: float | None = 50.0,
    *,
    state: str = "unknown",
    radius_mm: float | None = None,
    above_upr: float | None = None,
    robust: bool = False,
    filter_kind: FilterKind = FilterKind.GAUSS,
) -> RoundnessResult:
    """Return the roundness of a trace of M points against its reference circles.

    Both inputs have shape (M,). Points weigh by the angle that they stand for; for a filter, unequal steps are
    interpolated to equal ones. A step too wide for what passes the filter is bridged by the undulations, and what
    that may change is found out at other places of the trace: told (`trace.interpolated`), refused (`trace.gap`)
    above `MOST_INTERPOLATED_UM` and `MOST_INTERPOLATED_FRACTION` of RONt. A gap between neighbouring angles above
    60 deg is refused (`trace.narrow_angles`): lobes of half its width would be missing from the result unnoticed.
    With `above_upr` the filter is a band pass from there. With the radius of the part the circles are those of its
    points in the plane, and a part too eccentric for the limacon model is taken about its own centre;
    `trace.eccentric` refuses one that is off by more than a tenth of its radius. Without it `trace.off_axis`, a
    warning, says that an eccentricity may show as an oval, and of which radii. `robust` excludes dirt (suspect
    points by themselves or few together) and counts it; more neighbours are features, and stay.
    """
    angle, deviation = check_points(angle_deg, deviation_um)
    method = _Method(filter_upr=filter_upr, above_upr=above_upr, radius_mm=radius_mm, kind=filter_kind)
    spiked = () if robust else _spikes(angle, deviation)
    suspect = suspects(angle, deviation) if robust else np.zeros(angle.shape, dtype=bool)
    found = features(angle, deviation, suspect)
    dirt = suspect.copy()
    for places in found.values():
        dirt[places] = False
    result = _result(angle[~dirt], deviation[~dirt], method)
    return replace(
        result,
        state=state,
        points=angle.size,
        left_out=int(dirt.sum()),
        features=tuple(found),
        without_features=_result(angle[~suspect], deviation[~suspect], method) if found else None,
        warnings=(
            *_sampling(angle.size, filter_upr),
            *result.warnings,
            *_gap(angle, deviation, method, result.ront_um),
            *spiked,
        ),
    )


def _result(angle: Floats, deviation: Floats, method: _Method) -> RoundnessResult:
    centred = method.profile(angle, deviation)
    angle, profile = centred.angle_deg, centred.profile_um
    peak, valley = float(profile.max()), 0.0 - float(profile.min())
    radius_um = None if method.radius_mm is None else 1000.0 * method.radius_mm
    return RoundnessResult(
        ront_um=peak + valley,
        ronp_um=peak,
        ronv_um=valley,
        ronq_um=math.sqrt(float(np.average(profile**2, weights=angle_weights(angle)))),
        centre_x_um=centred.x_um,
        centre_y_um=centred.y_um,
        mean_deviation_um=centred.mean_um,
        reference_circle=LEAST_SQUARES,
        filter_upr=method.filter_upr,
        filter_kind=method.kind,
        above_upr=method.above_upr,
        state="unknown",
        points=deviation.size,
        harmonics=harmonics(angle, profile),
        circles=tuple(_from_axis(circle, centred) for circle in circles_about_axis(angle, profile, radius_um)),
        recentred=centred.recentred,
        warnings=_off_axis(centred, method.radius_mm),
    )


def centred_profile(angle_deg: ArrayLike, deviation_um: ArrayLike, filter_upr: float | None = 50.0) -> Floats:
    """Return the local deviations from the least squares circle, filtered, in the given order; shape (M,)."""
    angle, deviation = check_points(angle_deg, deviation_um)
    found = _Method(filter_upr=filter_upr).profile(angle, deviation)
    if found.angle_deg is angle:
        return found.profile_um
    return interpolate_profile(found.angle_deg, found.profile_um, angle)


def profile_of(
    angle_deg: ArrayLike,
    deviation_um: ArrayLike,
    filter_upr: float | None = 50.0,
    *,
    kind: str = LEAST_SQUARES,
    radius_mm: float | None = None,
    filter_kind: FilterKind = FilterKind.GAUSS,
) -> tuple[Floats, Floats]:
    """Return the filtered deviations from a reference circle, um, and their angles, deg; shape (N,) each.

    `kind` is one of `CIRCLES`. The angles are those given but for a part that is taken about its own centre, and
    for a trace that is interpolated: see `evaluate`, also for `radius_mm` and what is raised.
    """
    method = _Method(filter_upr=filter_upr, radius_mm=radius_mm, kind=filter_kind)
    centred = method.profile(*check_points(angle_deg, deviation_um))
    angle, profile = centred.angle_deg, centred.profile_um
    if kind == LEAST_SQUARES:
        return angle, profile
    circle, theta = limacon_circle(kind, angle, profile), np.radians(angle)
    x_um, y_um = circle.centre_x_um, circle.centre_y_um
    return angle, profile - circle.deviation_um - x_um * np.cos(theta) - y_um * np.sin(theta)


def _centre_profile(angle_deg: Floats, deviation_um: Floats, radius_mm: float | None) -> _CentredProfile:
    """Subtract the circle of the points."""
    mean_um, x_um, y_um = least_squares(angle_deg, deviation_um)
    theta = np.radians(angle_deg)
    profile = deviation_um - mean_um - x_um * np.cos(theta) - y_um * np.sin(theta)
    centred = _CentredProfile(angle_deg=angle_deg, profile_um=profile, mean_um=mean_um, x_um=x_um, y_um=y_um)
    if radius_mm is None or seen_oval_um_pp(math.hypot(x_um, y_um), radius_mm) <= _MOST_OVALITY_UM:
        return centred
    if math.hypot(x_um, y_um) > 1000 * _MOST_ECCENTRIC * radius_mm:
        value, limit = f"{math.hypot(x_um, y_um):.0f} um", f"<= {1000 * _MOST_ECCENTRIC * radius_mm:.0f} um"
        raise refusal_error("trace.eccentric", key="eccentricity", value=value, limit=limit)
    distance = 1000 * radius_mm + deviation_um
    x, y = distance * np.cos(theta), distance * np.sin(theta)
    circle = geometric_circle(LEAST_SQUARES, x, y, (x_um, y_um))
    centre = (circle.centre_x_um, circle.centre_y_um)
    angle, own_um = polar(x, y, centre)
    return _CentredProfile(
        angle_deg=angle,
        profile_um=own_um - circle.deviation_um,
        mean_um=circle.deviation_um - 1000 * radius_mm,
        x_um=centre[0],
        y_um=centre[1],
        recentred=True,
    )


def _filter_profile(centred: _CentredProfile, method: _Method) -> _CentredProfile:
    filter_upr, above_upr = method.filter_upr, method.above_upr
    if filter_upr is None:
        raise refusal_error("value.out_of_range", key="filter_upr", value="none", limit=f"> {above_upr} UPR")
    if not equally_spaced(centred.angle_deg):
        angle, profile = at_equal_angles(centred.angle_deg, centred.profile_um)
        centred = replace(centred, angle_deg=angle, profile_um=profile)
    order = np.argsort(np.mod(centred.angle_deg, 360.0), kind="stable")
    profile = np.empty_like(centred.profile_um)
    profile[order] = filter_profile(centred.profile_um[order], method.kind, filter_upr, above_upr)
    centred = replace(centred, profile_um=profile)
    if method.kind is not FilterKind.ROBUST:
        return centred
    # What it leaves out had drawn the circle of the unfiltered points towards it.
    again = _centre_profile(centred.angle_deg, profile, None)
    return replace(
        again,
        mean_um=centred.mean_um + again.mean_um,
        x_um=centred.x_um + again.x_um,
        y_um=centred.y_um + again.y_um,
        recentred=centred.recentred,
    )


def _gap(angle: Floats, deviation: Floats, method: _Method, ront_um: float) -> tuple[Problem, ...]:
    """Tell a gap with its effect on RONt; raises `ProfileError`: `trace.gap`, that is too much."""
    first_deg, gap_deg, step_deg = largest_gap(angle)
    if not has_gap(angle, method.widest_deg):
        return ()
    effect_um = _effect_um(angle, deviation, gap_deg, _ROOM * gap_deg + step_deg, method)
    allowed_um = max(MOST_INTERPOLATED_UM, MOST_INTERPOLATED_FRACTION * ront_um)
    last_deg = (first_deg + gap_deg) % 360.0 or 360.0
    key, value = f"{first_deg:.6g} - {last_deg:.6g} deg", f"{max(effect_um, 0.01):.2f} um"
    if effect_um > allowed_um:
        raise refusal_error("trace.gap", key=key, value=value, limit=f"<= {allowed_um:.2g} um")
    return (Problem(code="trace.interpolated", key=key, value=value, limit=f"{allowed_um:.2g} um"),)


def _effect_um(angle: Floats, deviation: Floats, gap_deg: float, room_deg: float, method: _Method) -> float:
    """Return by how much such a gap, bridged, is off where the trace has points.

    Of all places but the worst: a single one may hide a single point. Where such a gap has no room without that of
    the trace, all of the profile. Noise that a filter of the trace does not pass is no error of the bridge.
    """
    filtered = replace(method, filter_upr=method.filter_upr or _UNFILTERED_UPR, radius_mm=None)
    whole = filtered.profile(angle, deviation)
    thinned = slice(None, None, 1 + whole.angle_deg.size // _TRIAL_POINTS)
    whole_deg, whole_um = whole.angle_deg[thinned], whole.profile_um[thinned]
    order, errors_um = bridging_order(angle), []
    for place in whole_deg[:: 1 + whole_deg.size // _TRIALS]:
        gone = np.mod(whole_deg - place, 360.0) < gap_deg
        beside = np.mod(angle - place, 360.0) < gap_deg
        if largest_gap_deg(angle[~beside]) <= room_deg and gone.any():
            bridge_um = interpolate_profile(whole_deg[~gone], whole_um[~gone], whole_deg[gone], order)
            errors_um.append(float(np.abs(bridge_um - whole_um[gone]).max()))
    return sorted(errors_um)[-2] if len(errors_um) > 1 else float(np.ptp(whole_um))


def _from_axis(circle: ReferenceCircle, centred: _CentredProfile) -> ReferenceCircle:
    return replace(
        circle,
        centre_x_um=circle.centre_x_um + centred.x_um,
        centre_y_um=circle.centre_y_um + centred.y_um,
        deviation_um=circle.deviation_um + centred.mean_um,
    )


def seen_oval_um_pp(eccentricity_um: float, radius_mm: float) -> float:
    """Return the ovality that a circle of a radius shows about an axis this far off its centre: e^2 / (2 R)."""
    return eccentricity_um**2 / (2000.0 * radius_mm)


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


def _spikes(angle_deg: Floats, deviation_um: Floats) -> tuple[Problem, ...]:
    order = np.argsort(angle_deg, kind="stable")
    if (found := spike(deviation_um[order])) is None:
        return ()
    place, outside_um, allowed_um = found
    key, value = f"{angle_deg[order][place]:.6g} deg", f"{outside_um:+.1f} um"
    return (Problem(code="trace.spike", key=key, value=value, limit=f"{allowed_um:.1f} um"),)


def _off_axis(centred: _CentredProfile, radius_mm: float | None) -> tuple[Problem, ...]:
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
