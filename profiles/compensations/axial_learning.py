"""What the sections of a part teach along its length: each order times the slope and the curvature of s.

An order of a section at s is a complex number, as is that in the middle (`LobedPath`, `AlongCut`). What the middle
has left is carried along the cut by what is known of the lobe, so that the force of one clamping is not taken for
a slope; the rest is 1, s and s^2 by least squares. The constant of it is learned from the middle, as ever. Two
sections determine a slope alone, one neither; what they do not determine is not learned.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from profiles.compensations.certificate import (
    RIGID,
    CertifiedOrder,
    OrderEvidence,
    OrderStatus,
    ToolResponse,
    certify_order,
)
from profiles.compensations.learning import REPEATS_SD_UM, SIGNIFICANT
from profiles.compensations.optimal_gain import PRIOR_OTHERS_UM, PROCESS_LOSS_SD, Scatter, optimal_gain, repeats
from profiles.compensations.part_harmonics import PartHarmonics
from profiles.compensations.path import AXIAL_POWERS, AlongCut, CutPath, LobedPath, axial_um
from profiles.trace_files.sections import JITTER_MM

SLOPE_SECTIONS = 2
MISFIT_UM = 1.0
"""Standard deviation about their curve from which sections contradict each other; no lobe of a shell needs it."""

MEAN = 0
Key = tuple[int, int]  # an order, 0 for the mean, and a power of s


@dataclass(frozen=True, slots=True, kw_only=True)
class AxialFit:
    """What sections show beside what is carried along from the middle, um, with the standard error of each."""

    coefficients_um: Mapping[Key, complex] = field(default_factory=dict)
    sd_um: Mapping[Key, float] = field(default_factory=dict)


NO_SECTIONS = AxialFit()


def fit_axial(
    parts: Sequence[tuple[float, PartHarmonics]], along: AlongCut, orders: Iterable[int], *, sized: bool = True
) -> AxialFit:
    """Return slope and curvature of these orders and of the mean, if the sections are `sized`.

    `parts` are sections of a part, each with its s, anywhere along the cut; with fewer than two nothing is found.
    Those within `JITTER_MM` of each other are one height: they are the same section, measured again. Sections off
    their curve by more than `MISFIT_UM`, as one that was turned on the gauge, make its terms as uncertain as that.
    """
    s = np.array([place for place, _ in parts])
    heights = 1 + int(np.sum(np.diff(np.sort(s)) * along.half_length_mm > JITTER_MM)) if parts else 0
    powers = AXIAL_POWERS[: max(0, heights - 1)] if heights >= SLOPE_SECTIONS else ()
    if not powers:
        return NO_SECTIONS
    rows = np.vander(s, len(powers) + 1, increasing=True)
    solve = np.linalg.pinv(rows)
    middle = solve[0]  # of an order, the value in the middle
    found: dict[Key, complex] = {}
    sd_um: dict[Key, float] = {}
    for n in (*((MEAN,) if sized else ()), *orders):
        if n and not all(n in part.coefficients_um for _, part in parts):
            continue
        left = np.array([part.coefficients_um[n] if n else complex(part.mean_um) for _, part in parts])
        noise_um = max(part.sd_um[n] for _, part in parts) if n else 0.0
        shown = solve
        if n:
            shown = solve @ (np.eye(s.size) - np.outer(along.factor(n, s * along.half_length_mm) - 1.0, middle))
        noise_um = math.hypot(noise_um, REPEATS_SD_UM)
        if (spare := s.size - len(solve)) > 0:
            own = left - (along.factor(n, s * along.half_length_mm) - 1.0) * (middle @ left) if n else left
            misfit_um = float(np.linalg.norm(own - rows @ (solve @ own))) / math.sqrt(spare)
            noise_um = max(noise_um, misfit_um if misfit_um > MISFIT_UM else 0.0)
        for power in powers:
            found[n, power] = complex(shown[power] @ left)
            sd_um[n, power] = noise_um * float(np.linalg.norm(shown[power]))
    return AxialFit(coefficients_um=found, sd_um=sd_um)


@dataclass(frozen=True, slots=True, kw_only=True)
class AxialRules:
    """What applies to the terms of a job with this lobe: which orders are learned, and how the tool follows them.

    `chucked` are those that one part may teach, of the other `orders` two must show the same. `scatter` is that of
    the force of clampings, a fraction; `known_within` is how well slope and curvature of the lobe are known
    without sections, over the lobe. A program of segments changes the lobe `in_phase` with itself alone.
    """

    lobes: int
    orders: frozenset[int]
    chucked: frozenset[int]
    frozen: frozenset[int]
    scatter: float
    follows: Callable[[int], ToolResponse]
    in_phase: bool = False
    known_within: tuple[float, ...] = ()

    def standing(
        self, key: Key, error_um: complex, sd_um: float, shown_um: Sequence[complex], had_um: complex
    ) -> OrderStatus:
        """Return whether a term of which the path `had_um` is learned, or why not."""
        order, _ = key
        if order in self.frozen:
            return OrderStatus.GREW
        of_blank, again = order > 0 and order not in self.chucked, len(shown_um) > 1
        if of_blank and again and had_um and not repeats(shown_um):
            return OrderStatus.VARIES
        if abs(error_um) <= SIGNIFICANT * sd_um:
            return OrderStatus.NOISE
        if not of_blank:
            return OrderStatus.LEARNED
        if not again:
            return OrderStatus.ONE_PART
        return OrderStatus.LEARNED if repeats(shown_um) else OrderStatus.VARIES


@dataclass(frozen=True, slots=True, kw_only=True)
class AxialHistory:
    """What a path has had to remove of each term by each part so far, and the steps that it made, um."""

    shown_um: Mapping[Key, tuple[complex, ...]] = field(default_factory=dict)
    steps_um: Mapping[Key, tuple[float, ...]] = field(default_factory=dict)

    def add(self, steps: AxialSteps) -> AxialHistory:
        """Return this with one more part."""
        shown = {key: (*self.shown_um.get(key, ()), c) for key, c in steps.shown_um.items()}
        moved = {key: (*self.steps_um.get(key, ()), abs(steps.changes_um.get(key, 0j))) for key in steps.shown_um}
        return AxialHistory(shown_um={**self.shown_um, **shown}, steps_um={**self.steps_um, **moved})


@dataclass(frozen=True, slots=True, kw_only=True)
class AxialSteps:
    """The changes of the target, um, and the certificate; `shown_um` is what a path has to remove by this part."""

    changes_um: Mapping[Key, complex] = field(default_factory=dict)
    shown_um: Mapping[Key, complex] = field(default_factory=dict)
    certificate: tuple[CertifiedOrder, ...] = ()

    def applied(self, path: CutPath, follows: Callable[[int], ToolResponse]) -> CutPath:
        """Return the path with its changes; the command follows by the nominal response."""
        command = {key: c / _response(key[0], follows).response for key, c in self.changes_um.items()}
        return CutPath(target=path.target.plus_axial(self.changes_um), command=path.command.plus_axial(command))


def axial_steps(
    fit: AxialFit,
    target: LobedPath,
    rules: AxialRules,
    history: AxialHistory,
    fraction: float = 1.0,
) -> AxialSteps:
    """Return what a part teaches, which was cut with this fraction of the harmonics of a target, after others."""
    had = axial_um(target.axial)
    changes: dict[Key, complex] = {}
    plain: dict[Key, complex] = {}
    certificate = []
    for order in (MEAN, *sorted(rules.orders)):
        follows = _response(order, rules.follows)
        for power in AXIAL_POWERS:
            key = (order, power)
            if key not in fit.coefficients_um:
                if order == rules.lobes and rules.known_within:
                    unseen = certify_order(order, 0.0, OrderEvidence(), follows, OrderStatus.UNSEEN, axial=power)
                    within_um = rules.known_within[power - 1] * target.amplitude_um
                    certificate.append(replace(unseen, known_within_um=within_um))
                continue
            spared_um = (1.0 - fraction) * had.get(key, 0j) if order else 0j
            error_um = _followed(fit.coefficients_um[key] - spared_um, order, target, rules)
            sd_um, plain[key] = fit.sd_um[key], error_um + had.get(key, 0j)
            shown_um = (*history.shown_um.get(key, ()), plain[key])
            standing = rules.standing(key, error_um, sd_um, shown_um, had.get(key, 0j))
            clamped_um = rules.scatter * abs(plain[key]) if order else 0.0
            scatter = Scatter(
                prior_um=PRIOR_OTHERS_UM, part_um=math.hypot(sd_um, clamped_um), response=PROCESS_LOSS_SD
            )
            gain = optimal_gain(scatter, history.steps_um.get(key, ()), abs(error_um))
            if standing is OrderStatus.LEARNED:
                changes[key] = gain * error_um
            elif standing is OrderStatus.VARIES and key in had:  # it would be cut into the next part
                changes[key] = -had[key]
            shown = OrderEvidence(on_part_um=fit.coefficients_um[key], left_um=error_um)
            certificate.append(certify_order(order, gain, shown, follows, standing, axial=power))
    return AxialSteps(changes_um=changes, shown_um=plain, certificate=tuple(certificate))


def _followed(error_um: complex, order: int, target: LobedPath, rules: AxialRules) -> complex:
    """Return the part of an error that the program can follow; of the mean that is real."""
    if not order:
        return complex(error_um.real)
    lobe = target.harmonics[0].coefficient
    if not rules.in_phase or not lobe:
        return error_um
    return (error_um / lobe).real * lobe


def _response(order: int, follows: Callable[[int], ToolResponse]) -> ToolResponse:
    return follows(order) if order else RIGID
