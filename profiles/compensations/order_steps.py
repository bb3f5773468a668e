"""What each order of a measured part teaches: the change of the path, its gain, and why an order is left alone.

The lobe, its overtones and what was asked for are learned from the first part on: the chuck makes them, and
holds the next part like this one. The other orders may be of the blank, so two parts have to show the same. One
that was learned and turns out to vary leaves the path again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from profiles.compensations.certificate import Certified, Follows, Shown, Standing, certified
from profiles.compensations.learning import SIGNIFICANT
from profiles.compensations.optimal_gain import (
    PRIOR_OTHERS_UM,
    PROCESS_LOSS_SD,
    Scatter,
    lobe_prior_um,
    optimal_gain,
    repeats,
    scatter_um,
)

STEP_UM = 1e-6  # a path step below this is only the rounding of its file


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderSeen:
    """One order as parts show it, in um: what was not expected of this part, and how well a trace shows it.

    `on_part_um` is what is on the part, None where that is the error. `path_um` is the order of the whole target.
    `shown_um` is what a path has to remove by each part so far, this one last; `steps_um` are those of the path
    before it.
    """

    order: int
    error_um: complex
    sd_um: float
    path_um: complex
    shown_um: Sequence[complex] = ()
    steps_um: Sequence[float] = ()
    on_part_um: complex | None = None

    @property
    def shown(self) -> Shown:
        """What the certificate says that the part shows."""
        on_part_um = self.error_um if self.on_part_um is None else self.on_part_um
        return Shown(on_part_um=on_part_um, left_um=self.error_um)


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderRules:
    """What applies to every order of a job: its `lobe_um`, order `lobes`, and by which fraction clampings scatter.

    `chucked` are the orders that one part may teach, `frozen` those that are learned no more. `gain` is that of
    every order, None for the optimal one of each. `follows` is the response of the tool.
    """

    lobes: int
    lobe_um: float
    scatter: float
    chucked: frozenset[int]
    frozen: frozenset[int]
    gain: float | None
    follows: Callable[[int], Follows]

    def gain_of(self, seen: OrderSeen) -> float:
        """Return the gain for the step of an order."""
        if self.gain is not None:
            return self.gain
        spread = math.hypot(self.follows(seen.order).spread / SIGNIFICANT, PROCESS_LOSS_SD)
        if seen.order == self.lobes:
            prior_um = math.hypot(lobe_prior_um(self.lobe_um, self.lobes), spread * self.lobe_um)
            clamped_um = self.scatter * self.lobe_um
        else:
            prior_um, clamped_um = PRIOR_OTHERS_UM, self.scatter * abs(seen.path_um + seen.error_um)
        varies_um = 0.0 if seen.order in self.chucked else scatter_um(seen.shown_um)
        scatter = Scatter(
            prior_um=prior_um, part_um=math.hypot(seen.sd_um, clamped_um, varies_um), response=spread
        )
        return optimal_gain(scatter, [step for step in seen.steps_um if step > STEP_UM], abs(seen.error_um))

    def standing_of(self, seen: OrderSeen) -> Standing:
        """Return whether an order is learned, or why not."""
        if seen.order in self.frozen:
            return Standing.GREW
        if seen.order not in self.chucked:
            if len(seen.shown_um) > 1 and not repeats(seen.shown_um) and abs(seen.path_um) > STEP_UM:
                return Standing.VARIES
            if abs(seen.error_um) > SIGNIFICANT * seen.sd_um:
                if len(seen.shown_um) < 2:
                    return Standing.ONE_PART
                return Standing.LEARNED if repeats(seen.shown_um) else Standing.VARIES
        return Standing.LEARNED if abs(seen.error_um) > SIGNIFICANT * seen.sd_um else Standing.NOISE


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderSteps:
    """The steps of all orders: changes of the target in um, the gains, and the certificate."""

    changes_um: Mapping[int, complex]
    gains: Mapping[int, float]
    certificate: tuple[Certified, ...]

    @property
    def learned(self) -> tuple[int, ...]:
        """The orders that are learned."""
        return tuple(each.order for each in self.certificate if each.standing is Standing.LEARNED)


def order_steps(parts: Sequence[OrderSeen], rules: OrderRules) -> OrderSteps:
    """Return what a part teaches of each order."""
    changes, gains, certificate = {}, {}, []
    for seen in parts:
        standing = rules.standing_of(seen)
        gains[seen.order] = gain = rules.gain_of(seen)
        if standing is Standing.LEARNED:
            changes[seen.order] = gain * seen.error_um
        elif standing is Standing.VARIES and abs(seen.path_um) > STEP_UM:
            changes[seen.order] = -seen.path_um
        certificate.append(certified(seen.order, gain, seen.shown, rules.follows(seen.order), standing))
    return OrderSteps(changes_um=changes, gains=gains, certificate=tuple(certificate))
