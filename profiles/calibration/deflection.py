"""The stiffness of jaw contacts from forces and deflections at the chucked part (Lee & Lee 2001, Figs 2 to 5).

The jaws of one ring are those of `profiles.chucking.contact`: the clamping force F_c has pressed each together
by x0 = m F_c / k, with k ~ F_c^alpha and m = 1 / (1 - alpha). What a load P moves the part by in units of x0
depends on P / F_c, alpha and the angle alone, so that rows of any force are solved at once. A load at the distance
a in front of jaws of the length l is carried by two rings of half the stiffness and half the force each,
P (1 + a/l) in front and -P a/l behind, and the tip of the part moves by

u_tip = u_front (1 + a/l) - u_rear a/l,

plus the bending of the part as a cantilever, P a^3 / (3 E I) with I = pi d^4 / 64 (Timoshenko).

Fitted to M deflections are k of one jaw at 1000 N, alpha, and l, by least squares in (ln k, alpha, ln l); with the
Jacobian J and s^2 the variance of what is left, cov = s^2 (J' W J)^-1. Half-widths are for 95 %, by Student's t;
of k and l they are taken over from their logarithms to the first order.

A gauge is off by the same everywhere, a load or a contact by a fraction of the deflection. W is 1 or by the square
of the deflection, whichever is likelier; where they are about as likely, the half-widths hold what either says.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats, floats
from profiles.chucking.contact import Contact, deflection
from profiles.chucking.holding import REFERENCE_FORCE_N
from profiles.files import printable
from profiles.least_squares import ROUNDING, cofactors, outliers, student
from profiles.problem import ProfileError, refusal_error

LEAST_JAWS = 3
LEAST_SPARE = 3  # minimum measurements beyond the parameters: with fewer the confidence is a guess
# Between a contact that does not stiffen and one without bound; a fit at a limit determines neither.
LEAST_ALPHA, MOST_ALPHA = 0.02, 0.9
# Above this ratio of singular values (of normalised columns) the parameters cannot be separated.
_WORST_CONDITION = 100.0
# Loss of log-likelihood up to which the other kind of scatter is about as likely: chosen as in `wrench`.
_AS_LIKELY = 2.0
_STARTS_MM = (10.0, 20.0, 40.0, 80.0, 160.0)
_START_ALPHA = 0.4
_STEP = 1e-5
_VARIED_BY = ("load_n", "chucking_force_n, angle_deg", "overhang_mm")


@dataclass(frozen=True, slots=True, kw_only=True)
class Anisotropy:
    """Deflection under a rotating load: its mean, and its peak-to-peak value with the half-width, um."""

    mean_um: float
    pp_um: float
    pp_ci_um: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DeflectionFit:
    """The contacts of a chuck. `stiffness_n_per_um` is k of one jaw at `REFERENCE_FORCE_N`.

    `jaw_length_ci` is 0 where the length was given and not fitted. `covariance` is that of (ln k, alpha, ln l),
    row by row. `sd_um` is the scatter of one measurement; `outliers` are indices in the table.
    """

    jaws: int
    youngs_gpa: float
    stiffness_n_per_um: float
    stiffness_ci: float
    alpha: float
    alpha_ci: float
    jaw_length_mm: float
    jaw_length_ci: float
    covariance: tuple[float, ...]
    sd_um: float
    points: int
    freedom: int
    outliers: tuple[int, ...]

    def deflections_um(self, columns: Mapping[str, Floats]) -> Floats:
        """Return the deflections that the fit has for measurements; columns as for `fit_deflection`, um."""
        model = _Model(columns, self.jaws, self.youngs_gpa, REFERENCE_FORCE_N)
        return model.deflections_at(
            np.array([math.log(self.stiffness_n_per_um), self.alpha, math.log(self.jaw_length_mm)])
        )

    def anisotropy(
        self, *, chucking_force_n: float, load_n: float, overhang_mm: float, diameter_mm: float
    ) -> Anisotropy:
        """Return the deflection of a solid bar under a rotating load; the force is the total over all jaws."""
        angle = np.linspace(0.0, 360.0 / self.jaws, 25)
        sizes = {"chucking_force_n": chucking_force_n, "load_n": load_n}
        sizes |= {"overhang_mm": overhang_mm, "diameter_mm": diameter_mm}
        rows = {key: np.full_like(angle, value) for key, value in sizes.items()}
        model = _Model(rows | {"angle_deg": angle}, self.jaws, self.youngs_gpa, REFERENCE_FORCE_N)
        at = np.array([math.log(self.stiffness_n_per_um), self.alpha, math.log(self.jaw_length_mm)])
        round_um = model.deflections_at(at)
        slope = [
            np.ptp(model.deflections_at(at + h)) - np.ptp(model.deflections_at(at - h)) for h in _STEP * np.eye(3)
        ]
        gradient = np.array(slope) / (2 * _STEP)
        variance = float(gradient @ np.reshape(self.covariance, (3, 3)) @ gradient)
        return Anisotropy(
            mean_um=float(round_um[:-1].mean()),
            pp_um=float(np.ptp(round_um)),
            pp_ci_um=student(self.freedom) * math.sqrt(max(variance, 0.0)),
        )


def fit_deflection(
    columns: Mapping[str, Floats], *, jaws: int, youngs_gpa: float, jaw_length_mm: float | None = None
) -> DeflectionFit:
    """Return the contacts of a chuck from M measurements.

    `columns` have shape (M,) each: `chucking_force_n` (total), `load_n`, `angle_deg` (of the load past a jaw),
    `diameter_mm` of a solid bar, `overhang_mm` and `deflection_um` along the load. At least three `jaws`: two
    do not hold sideways. `youngs_gpa` is that of the bar. Where `jaw_length_mm` is known, it is not fitted.
    Raises `ProfileError`: `calibration.jaws`, `calibration.not_positive`, `calibration.few_points`;
    `calibration.load_over_force`; `calibration.bending`, the bar alone would bend more than was measured;
    `calibration.dependent`, measurements too similar for all parameters; `calibration.no_alpha`, no visible
    stiffening; `calibration.no_fit`.
    """
    free = 2 if jaw_length_mm is not None else 3
    _refuse_unfit(columns, jaws, youngs_gpa, free)
    measured = columns["deflection_um"]
    mean_n = float(np.exp(np.log(columns["chucking_force_n"] / jaws).mean()))
    model = _Model(columns, jaws, youngs_gpa, mean_n)  # there k and alpha are least correlated
    start = _start(model, measured, (jaw_length_mm,) if jaw_length_mm is not None else _STARTS_MM)
    same = _solve_least_squares(model, measured, start, free, np.ones_like(measured))
    sizes = model.deflections_at(same.at)
    try:
        grown = _solve_least_squares(model, measured, same.at, free, float(np.exp(np.log(sizes).mean())) / sizes)
    except ProfileError:  # one kind of scatter failing is no reason to refuse the other
        grown = same
    best, other = sorted((same, grown), key=lambda each: each.log_likelihood, reverse=True)
    freedom = measured.size - free
    to_reference = np.eye(3)
    to_reference[0, 1] = math.log(REFERENCE_FORCE_N / mean_n)
    best, other = best.change_parameters(to_reference), other.change_parameters(to_reference)
    at, covariance, sd = best.at, best.covariance, best.sd_um
    if other.log_likelihood > best.log_likelihood - _AS_LIKELY:
        covariance = covariance * best.widening_to(other, student(freedom)) ** 2
    half = student(freedom) * np.sqrt(np.diag(covariance))
    exact = sd <= ROUNDING * float(measured.max())
    return DeflectionFit(
        jaws=jaws,
        youngs_gpa=youngs_gpa,
        stiffness_n_per_um=math.exp(at[0]),
        stiffness_ci=math.exp(at[0]) * float(half[0]),
        alpha=float(at[1]),
        alpha_ci=float(half[1]),
        jaw_length_mm=math.exp(at[2]),
        jaw_length_ci=math.exp(at[2]) * float(half[2]),
        covariance=tuple(float(each) for each in covariance.flat),
        sd_um=sd,
        points=measured.size,
        freedom=freedom,
        outliers=() if exact else outliers(best.jacobian, best.left),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _DeflectionSolution:
    """Parameters (ln k, alpha, ln l) with their covariance; `jacobian` and `left` are weighted.

    `sd_um` is the scatter where the weight is 1.
    """

    at: Floats
    covariance: Floats
    sd_um: float
    jacobian: Floats
    left: Floats
    log_likelihood: float

    def change_parameters(self, by: Floats) -> _DeflectionSolution:
        """Return it in other parameters, `by` (3, 3) times these."""
        return replace(self, at=by @ self.at, covariance=by @ self.covariance @ by.T)

    def widening_to(self, other: _DeflectionSolution, reach: float) -> float:
        """Return the factor by which half-widths grow to include another solution."""
        own, its = (reach * np.sqrt(np.diag(each.covariance)) for each in (self, other))
        fitted = own > 0.0
        apart = np.abs(self.at - other.at) + its
        return float(np.max(apart[fitted] / own[fitted], initial=1.0))


def contact_um(
    stiffness_n_per_um: ArrayLike,
    alpha: float,
    jaw_length_mm: float,
    *,
    jaws: int,
    force_per_jaw_n: ArrayLike,
    load_n: ArrayLike,
    past_jaw_deg: ArrayLike,
    overhang_mm: ArrayLike,
) -> Floats:
    """Return the radial deflection at the load from the contacts alone, um along the load; broadcast shapes.

    `stiffness_n_per_um` is k of one jaw at `force_per_jaw_n`; at least three jaws.
    """
    each = (stiffness_n_per_um, force_per_jaw_n, load_n, past_jaw_deg, overhang_mm)
    k, force, load, angle, overhang = np.broadcast_arrays(*map(floats, each))
    lever = overhang / jaw_length_mm
    give_um = force / k / (1.0 - alpha)
    ratio = 2.0 * load / force  # each ring carries half of the force
    front = _ring(ratio * (1.0 + lever), angle, alpha, jaws)
    rear = _ring(-ratio * lever, angle, alpha, jaws)
    return floats(give_um * (front * (1.0 + lever) - rear * lever))


def bending_um(load_n: ArrayLike, overhang_mm: ArrayLike, diameter_mm: ArrayLike, youngs_gpa: float) -> Floats:
    """Return the deflection of a solid bar as a cantilever, um; broadcast shapes."""
    load, a, d = (floats(each) for each in (load_n, overhang_mm, diameter_mm))
    inertia_mm4 = math.pi * d**4 / 64
    return floats(load * a**3 / (3 * youngs_gpa * inertia_mm4))  # N mm^3 / (GPa mm^4) is um


def _ring(ratio: Floats, angle_deg: Floats, alpha: float, jaws: int) -> Floats:
    """Return the deflection of one ring along its load in units of x0; `ratio` is the load over a jaw's force."""
    unit = Contact(jaws=jaws, stiffness_n_per_um=1.0 / (1.0 - alpha), force_per_jaw_n=1.0, alpha=alpha)
    return deflection(unit, ratio, angle_deg).along_um


class _Model:
    def __init__(self, rows: Mapping[str, Floats], jaws: int, youngs_gpa: float, reference_n: float) -> None:
        self._rows = rows
        self._jaws = jaws
        self._force = rows["chucking_force_n"] / jaws
        self._reference_n = reference_n
        self.bending_um = bending_um(rows["load_n"], rows["overhang_mm"], rows["diameter_mm"], youngs_gpa)

    def deflections_at(self, parameters: Floats) -> Floats:
        """Return the deflections, um."""
        log_k, alpha, log_l = (float(each) for each in parameters)
        found = contact_um(
            math.exp(log_k) * (self._force / self._reference_n) ** alpha,
            alpha,
            math.exp(log_l),
            jaws=self._jaws,
            force_per_jaw_n=self._force,
            load_n=self._rows["load_n"],
            past_jaw_deg=self._rows["angle_deg"],
            overhang_mm=self._rows["overhang_mm"],
        )
        return found + self.bending_um


def _refuse_unfit(columns: Mapping[str, Floats], jaws: int, youngs_gpa: float, free: int) -> None:
    if jaws < LEAST_JAWS:
        raise refusal_error("calibration.jaws", value=str(jaws), limit=f">= {LEAST_JAWS}")
    positive = {key: column for key, column in columns.items() if key not in ("angle_deg", "overhang_mm")}
    for key, column in {**positive, "youngs_modulus_gpa": np.array([youngs_gpa])}.items():
        worst = column[~((column > 0) & np.isfinite(column))]
        if worst.size:
            raise refusal_error("calibration.not_positive", key=key, value=f"{worst[0]:g}", limit="> 0")
    points = columns["deflection_um"].size
    if points < free + LEAST_SPARE:
        limit = f">= {free + LEAST_SPARE}"
        raise refusal_error("calibration.few_points", value=str(points), limit=limit)
    loads_n, forces_n = columns["load_n"], columns["chucking_force_n"]
    at = int(np.argmax(loads_n / forces_n))
    if loads_n[at] > forces_n[at]:
        value, limit = f"{loads_n[at]:g} N", f"{forces_n[at]:g} N"
        raise refusal_error("calibration.load_over_force", key="load_n", value=value, limit=limit)


def _start(model: _Model, measured: Floats, lengths_mm: tuple[float, ...]) -> Floats:
    """Return the best start among a few lengths; deflection goes with 1 / k, which determines k."""
    target = measured - model.bending_um
    if target.mean() <= 0:
        value, limit = f"{model.bending_um.mean():.4g} um", f"< {measured.mean():.4g} um"
        raise refusal_error("calibration.bending", value=value, limit=limit)
    found: list[tuple[float, Floats]] = []
    for length_mm in lengths_mm:
        at = np.array([0.0, _START_ALPHA, math.log(length_mm)])
        soft = model.deflections_at(at) - model.bending_um
        k = float(soft @ soft) / max(float(soft @ target), ROUNDING)
        at[0] = math.log(k)
        found.append((float(np.sum((target - soft / k) ** 2)), at))
    return min(found, key=lambda pair: pair[0])[1]


def _solve_least_squares(
    model: _Model, measured: Floats, start: Floats, free: int, root_weight: Floats
) -> _DeflectionSolution:
    """Return the weighted least squares of the free parameters; `root_weight` has shape (M,)."""
    from scipy.optimize import least_squares

    def left(parameters: Floats) -> Floats:
        return root_weight * (model.deflections_at(np.concatenate([parameters, start[free:]])) - measured)

    low, high = [-20.0, LEAST_ALPHA, -5.0][:free], [20.0, MOST_ALPHA, 10.0][:free]
    done = least_squares(
        left, start[:free], jac="3-point", bounds=(low, high), x_scale="jac", xtol=1e-12, ftol=1e-12
    )
    if not done.success:
        raise refusal_error("calibration.no_fit", value=printable(str(done.message)))
    jacobian = floats(done.jac)
    _refuse_dependent(jacobian)
    if not LEAST_ALPHA + _STEP < done.x[1] < MOST_ALPHA - _STEP:
        value, limit = f"{done.x[1]:.3g}", f"> {LEAST_ALPHA:g}, < {MOST_ALPHA:g}"
        raise refusal_error("calibration.no_alpha", key="alpha", value=value, limit=limit)
    variance = float(done.fun @ done.fun) / (measured.size - free)
    covariance = np.zeros((3, 3))
    covariance[:free, :free] = variance * cofactors(jacobian)
    scatter = measured.size * math.log(variance) if variance > 0.0 else -math.inf
    return _DeflectionSolution(
        at=np.concatenate([done.x, start[free:]]),
        covariance=covariance,
        sd_um=math.sqrt(variance),
        jacobian=jacobian,
        left=-floats(done.fun),
        log_likelihood=float(np.log(root_weight).sum()) - 0.5 * scatter,
    )


def _refuse_dependent(jacobian: Floats) -> None:
    sizes = np.linalg.norm(jacobian, axis=0)
    _, values, directions = np.linalg.svd(jacobian / np.where(sizes > 0, sizes, 1.0), full_matrices=False)
    if values[-1] * _WORST_CONDITION < values[0]:
        weakest = np.abs(directions[-1])
        varied = _VARIED_BY[1 + int(np.argmax(weakest[1:]))]  # k itself never needs to be varied
        condition = values[0] / values[-1] if values[-1] else math.inf
        raise refusal_error(
            "calibration.dependent", key=varied, value=f"{condition:.3g}", limit=f"<= {_WORST_CONDITION:g}"
        )
