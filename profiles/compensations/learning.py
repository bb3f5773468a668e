"""Learn two numbers per harmonic: from the tool in air, from the tool in the cut, from the measured part.

A harmonic of order n (UPR) is a complex coefficient c in um: Re(c exp(j n angle)), angle from the spindle's
index. Tool motion is positive into the work, a part's deviation positive outwards, an error target minus
actual. The tool is learned from its own encoder: U <- U + gain E / T, with U the command, E the error and T the
nominal response. The error shrinks by |1 - gain T' / T| a pass, T' the true response; below 1 it converges
(iterative learning control in the frequency domain, Bristow, Tharayil and Alleyne 2006). The part is learned
from the gauge: where it stands high, the target goes deeper, W <- W + gain R.

A pass changes the error e to (1 - gain T'/T) e; from a factor of 1 on it makes it worse without notice. So each
harmonic is compared with its best pass so far, and one that has significantly grown is reverted to that and frozen
there: its residual never ends above the best one, except for noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import floats
from profiles.compensations.path import CutPath, LobedPath
from profiles.least_squares import fit, harmonic_columns, phasors
from profiles.problem import refusal_error

Value = TypeVar("Value")

# Standard deviations above which a harmonic is significant: 95 %, chi-square with two degrees of freedom.
SIGNIFICANT = 2.45
# The same of a height alone, such as that of a lobe in its place: 95 % of a normal distribution.
SURE = 1.96
STEADY_FRACTION = 0.02  # below this reciprocal condition number the angles cannot separate the harmonics


REPEATS_SD_UM = 0.1
"""Variation of a harmonic from pass to pass with the same path, beyond what a fit can see of it.

Twice the 0.05 um of tool and part on the simulated lathe `realistic`, from friction and non-repeatable spindle
error: a real one is hardly better.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class HarmonicFit:
    """Harmonics found in samples: the mean, coefficients by order, and the residual.

    `amplitude_sd_um` is the standard deviation of each amplitude if the residual is white.
    """

    mean_um: float
    coefficients_um: Mapping[int, complex]
    amplitude_sd_um: float

    def significant(self) -> dict[int, complex]:
        """Return the coefficients above the noise."""
        least = SIGNIFICANT * self.amplitude_sd_um
        return {n: c for n, c in self.coefficients_um.items() if abs(c) > least}


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """A deviation in um: its mean, and harmonics by order, with the standard error of each of their amplitudes."""

    mean_um: float = 0.0
    coefficients_um: Mapping[int, complex]
    sd_um: float = 0.0


def fit_harmonics(angle_deg: ArrayLike, values_um: ArrayLike, orders: Sequence[int]) -> HarmonicFit:
    """Fit mean and harmonics of `orders` by least squares; both inputs have shape (M,), angles in any order.

    Raises `ProfileError`: `learning.few_samples`, or angles that cannot separate the harmonics.
    """
    angle = np.radians(floats(angle_deg))
    values = floats(values_um)
    unknowns = 1 + 2 * len(orders)
    if values.size <= 2 * unknowns:
        raise refusal_error("learning.few_samples", value=str(values.size), limit=f"> {2 * unknowns}")
    found = fit(harmonic_columns(angle, orders), values)
    if found.condition * STEADY_FRACTION > 1.0:
        gap = f"{math.degrees(float(np.ptp(angle))):.3g} deg"
        raise refusal_error("learning.few_samples", key="angle_deg", value=gap, limit=">= 360 deg")
    return HarmonicFit(
        mean_um=float(found.coefficients[0]),
        coefficients_um=phasors(found.coefficients, orders),
        amplitude_sd_um=math.sqrt(2.0 * found.variance / values.size),
    )


def learned_command(
    path: CutPath, error_um: Mapping[int, complex], response: Callable[[int], complex], gain: float = 1.0
) -> CutPath:
    """Return the path with a command that removes the tool's error (target minus actual).

    `response` is the nominal one from command to tool, by order.
    """
    change = {n: gain * error / response(n) for n, error in error_um.items()}
    return CutPath(target=path.target, command=path.command.plus(change))


def learned_part(
    path: CutPath,
    part: Deviation,
    tool: Deviation,
    response: Callable[[int], complex],
    gain: float = 1.0,
    gains: Mapping[int, float] | None = None,
) -> CutPath:
    """Return the path for the next part, after one that deviates by `part` while the tool was off by `tool`.

    `gain` is that of the mean, and of each order that has no other one in `gains`.
    Both are positive where the part stands high or the tool was not deep enough. The tool's deviation corrects
    the command alone; the rest corrects the target, and the command follows by the nominal response.
    """
    of = gains or {}
    target = {n: of.get(n, gain) * (c - tool.coefficients_um.get(n, 0j)) for n, c in part.coefficients_um.items()}
    mean_um = gain * (part.mean_um - tool.mean_um)
    change = {
        n: (target.get(n, 0j) + tool.coefficients_um.get(n, 0j)) / response(n)
        for n in (*target, *tool.coefficients_um)
    }
    return CutPath(
        target=path.target.plus(target, mean_um), command=path.command.plus(change, mean_um + tool.mean_um)
    )


def convergence(true: complex, nominal: complex, gain: float = 1.0) -> float:
    """Return |1 - gain T' / T|, the factor of an error per pass; it converges below 1."""
    return abs(1.0 - gain * true / nominal)


def next_trim_um(trim_um: complex, error_um: complex, response: complex, gain: float, most_um: float) -> complex:
    """Return the next trim of a running cut: adaptive feedforward cancellation, once per batch of samples.

    Raises `ProfileError`: `learning.trim_limit`; the trim that is in effect stays.
    """
    target = trim_um + gain * error_um / response
    if not abs(target) <= most_um:
        raise refusal_error("learning.trim_limit", value=f"{abs(target):.2f} um", limit=f"<= {most_um:g} um")
    return target


@dataclass(frozen=True, slots=True, kw_only=True)
class GrownHarmonic:
    """A harmonic no longer learned: amplitudes in um at its best, and in the pass that was significantly worse."""

    order: int
    best_um: float
    grown_um: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BestResidual:
    """The best residual of a harmonic, in um with its standard deviation, and the path of that pass."""

    left: complex
    sd_um: float
    target: complex
    command: complex

    @property
    def left_um(self) -> float:
        """Its amplitude."""
        return abs(self.left)

    def is_exceeded(self, left_um: float, sd_um: float, allowed_um: float = 0.0) -> bool:
        """Whether a residual with this standard deviation is certainly larger."""
        return not left_um <= self.left_um + allowed_um + SIGNIFICANT * math.hypot(sd_um, self.sd_um)


@dataclass(frozen=True, slots=True, kw_only=True)
class HarmonicWatch:
    """The best pass of each harmonic so far, and the harmonics that have grown since."""

    best: Mapping[int, BestResidual] = field(default_factory=dict)
    grown: tuple[GrownHarmonic, ...] = ()

    def judge_pass(
        self,
        path: CutPath,
        left_um: Mapping[int, complex],
        sd_um: Callable[[int], float],
        allowed_um: Callable[[int], float] = lambda _: 0.0,
    ) -> HarmonicWatch:
        """Return the watch after a pass with `path` that left these harmonics, each with its standard deviation.

        `allowed_um` is how much a harmonic may grow for reasons other than learning.
        """
        best, grown = dict(self.best), list(self.grown)
        for n, coefficient in self.select_learned(left_um).items():
            now = BestResidual(
                left=coefficient,
                sd_um=_once_sd_um(sd_um(n)),
                target=coefficient_of(path.target, n),
                command=coefficient_of(path.command, n),
            )
            before = best.get(n)
            if before is None or now.left_um < before.left_um:
                best[n] = now
            elif before.is_exceeded(now.left_um, now.sd_um, allowed_um(n)):
                grown.append(GrownHarmonic(order=n, best_um=before.left_um, grown_um=now.left_um))
        return replace(self, best=best, grown=tuple(grown))

    def afresh(self) -> HarmonicWatch:
        """Return a new watch for passes not comparable with those so far; frozen harmonics stay frozen."""
        return replace(self, best={n: each for n, each in self.best.items() if n in self.frozen_orders})

    def not_back(self, left_um: Mapping[int, complex], sd_um: Callable[[int], float]) -> frozenset[int]:
        """Return the frozen harmonics that a pass with their best path leaves certainly otherwise than their best.

        Learning is not why they have grown, or not alone: the same path leaves something else.
        """
        seen = {n: c - self.best[n].left for n, c in left_um.items() if n in self.frozen_orders}
        return frozenset(
            n
            for n, off_um in seen.items()
            if abs(off_um) > SIGNIFICANT * math.hypot(_once_sd_um(sd_um(n)), self.best[n].sd_um)
        )

    def release_orders(self, orders: frozenset[int]) -> HarmonicWatch:
        """Return the watch with these harmonics forgotten: they are learned again, and watched anew."""
        return HarmonicWatch(
            best={n: each for n, each in self.best.items() if n not in orders},
            grown=tuple(each for each in self.grown if each.order not in orders),
        )

    @property
    def frozen_orders(self) -> frozenset[int]:
        """The harmonics that are no longer learned."""
        return frozenset(each.order for each in self.grown)

    def select_learned(self, harmonics: Mapping[int, Value]) -> dict[int, Value]:
        """Return the harmonics that are learned."""
        return {n: value for n, value in harmonics.items() if n not in self.frozen_orders}

    def keep_best(self, path: CutPath) -> CutPath:
        """Return a path with each frozen harmonic at its best."""
        back = {n: self.best[n] for n in self.frozen_orders}
        return CutPath(
            target=path.target.plus({n: each.target - coefficient_of(path.target, n) for n, each in back.items()}),
            command=path.command.plus(
                {n: each.command - coefficient_of(path.command, n) for n, each in back.items()}
            ),
        )


def _once_sd_um(sd_um: float) -> float:
    """Return the standard deviation of a harmonic in one pass, from that of its fit."""
    return math.hypot(sd_um, REPEATS_SD_UM)


def coefficient_of(path: LobedPath, order: int) -> complex:
    """Return the c of Re(c exp(j order angle)) of a path, in um; 0 where it has no such harmonic."""
    return next((harmonic.coefficient for harmonic in path.harmonics if harmonic.lobes == order), 0j)
