"""What each order of a measured part teaches: the change of the path, its gain, and why an order is left alone.

The lobe, its overtones and what was asked for are learned from the first part on: the chuck makes them, and
holds the next part like this one. The other orders may be of the blank, so two parts have to show the same. One
that was learned and turns out to vary leaves the path again.

An order that comes with each blank, as through dry friction, is another one on each part: the path that removes
it from one part adds it to the next. Without learning, a part would have shown its error plus whatever the learned
motion removed. Over the parts the mean of that has to exceed its scatter, as for `console learn`; else the order
returns to the path of the first part, and may be learned again once it repeats.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from profiles.compensations.certificate import (
    CertifiedOrder,
    OrderEvidence,
    OrderStatus,
    ToolResponse,
    certify_order,
)
from profiles.compensations.change import UNCHANGED, OrderState, change_of
from profiles.compensations.learning import REPEATS_SD_UM, SIGNIFICANT, coefficient_of
from profiles.compensations.optimal_gain import (
    PRIOR_OTHERS_UM,
    PROCESS_LOSS_SD,
    Scatter,
    lobe_prior_um,
    optimal_gain,
    repeats,
    scatter_um,
)
from profiles.compensations.path import CutPath, LobedPath

STEP_UM = 1e-6  # a path step below this is only the rounding of its file
ENOUGH_PARTS = 3
"""Parts from which an order is judged: two that agree by less than F = 19 are no evidence that it varies."""

LEAST_UM = SIGNIFICANT * REPEATS_SD_UM
"""Scatter of an order from which it varies: less than that no lathe repeats, and to learn it does no harm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderSeen:
    """One order over the parts, um: its unexpected error on this part, and the standard deviation of a trace.

    `on_part_um` is what is on the part, None where that is the error. `path_um` is the order of the whole target.
    `shown_um` is what a path has to remove by each part so far, this one last; `steps_um` are those of the path
    before it. `state` is whether the parts have stepped or drift; the first `began` parts have not shown it.
    """

    order: int
    error_um: complex
    sd_um: float
    path_um: complex
    shown_um: Sequence[complex] = ()
    steps_um: Sequence[float] = ()
    on_part_um: complex | None = None
    state: OrderState = UNCHANGED
    began: int = 0

    @property
    def evidence(self) -> OrderEvidence:
        """What the certificate says that the part shows."""
        on_part_um = self.error_um if self.on_part_um is None else self.on_part_um
        return OrderEvidence(on_part_um=on_part_um, left_um=self.error_um)


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
    follows: Callable[[int], ToolResponse]

    def gain_of(self, seen: OrderSeen) -> float:
        """Return the gain for the step of an order."""
        if self.gain is not None:
            return self.gain
        spread = math.hypot(self.follows(seen.order).spread / SIGNIFICANT, PROCESS_LOSS_SD)
        prior_um, clamped_um = PRIOR_OTHERS_UM, self.clamped_um(seen)
        if seen.order == self.lobes:
            prior_um = math.hypot(lobe_prior_um(self.lobe_um, self.lobes), spread * self.lobe_um)
        varies_um = 0.0 if seen.order in self.chucked else scatter_um(seen.shown_um[seen.state.since :])
        scatter = Scatter(
            prior_um=max(prior_um, abs(seen.state.stepped_um)),
            part_um=math.hypot(seen.sd_um, clamped_um, varies_um),
            response=spread,
        )
        steps_um = seen.steps_um[seen.began + seen.state.since if seen.state.since else 0 :]
        return optimal_gain(scatter, [step for step in steps_um if step > STEP_UM], abs(seen.error_um))

    def clamped_um(self, seen: OrderSeen) -> float:
        """Return by how much an order differs from clamping to clamping: as the force, whatever the jaws make."""
        return self.scatter * (self.lobe_um if seen.order == self.lobes else abs(seen.path_um + seen.error_um))

    def standing_of(self, seen: OrderSeen) -> OrderStatus:
        """Return whether an order is learned, or why not."""
        if seen.order in self.frozen:
            return OrderStatus.GREW
        if seen.order not in self.chucked and not seen.state.is_settled(seen.shown_um):
            again = len(seen.shown_um) > seen.state.since + 1
            if again and abs(seen.path_um) > STEP_UM:
                return OrderStatus.VARIES
            if abs(seen.error_um) > SIGNIFICANT * seen.sd_um:
                return OrderStatus.VARIES if again else OrderStatus.ONE_PART
        teaches = seen.state.is_drifting or abs(seen.error_um) > SIGNIFICANT * seen.sd_um
        return OrderStatus.LEARNED if teaches else OrderStatus.NOISE


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderSteps:
    """The steps of all orders: changes of the target in um, the gains, and the certificate."""

    changes_um: Mapping[int, complex]
    gains: Mapping[int, float]
    certificate: tuple[CertifiedOrder, ...]

    @property
    def learned_orders(self) -> tuple[int, ...]:
        """The orders that are learned mid-cut."""
        rows = (each for each in self.certificate if not each.axial)
        return tuple(each.order for each in rows if each.standing is OrderStatus.LEARNED)


def order_steps(parts: Sequence[OrderSeen], rules: OrderRules) -> OrderSteps:
    """Return what a part teaches of each order."""
    changes, gains, certificate = {}, {}, []
    for seen in parts:
        standing = rules.standing_of(seen)
        gains[seen.order] = gain = rules.gain_of(seen)
        if standing is OrderStatus.LEARNED:
            step_um = gain * seen.error_um / (1.0 - seen.state.lost)
            changes[seen.order] = seen.state.follow(seen.path_um + step_um) - seen.path_um
        elif standing is OrderStatus.VARIES and abs(seen.path_um) > STEP_UM:  # it would be cut into the next part
            changes[seen.order] = -seen.path_um
        how = gain, seen.evidence, rules.follows(seen.order), standing
        of_order = certify_order(seen.order, *how, clamped_um=rules.clamped_um(seen))
        certificate.append(replace(of_order, change=change_of(seen.state, seen.order, seen.began)))
    return OrderSteps(changes_um=changes, gains=gains, certificate=tuple(certificate))


@dataclass(frozen=True, slots=True, kw_only=True)
class RepeatHistory:
    """The path that the first part was `begun` with, and what each part has shown of each order since, in um."""

    begun: CutPath
    shown_um: Mapping[int, tuple[complex, ...]] = field(default_factory=dict)

    def add_part(self, shown_um: Mapping[int, complex]) -> RepeatHistory:
        """Return this with one more part, by its harmonics without the learned motion."""
        every = {n: (*self.shown_um.get(n, ()), c) for n, c in shown_um.items()}
        return RepeatHistory(begun=self.begun, shown_um={**self.shown_um, **every})

    def target_moved_um(self, path: CutPath, order: int) -> complex:
        """Return by how much the target of an order was learned, in um."""
        return coefficient_of(path.target, order) - coefficient_of(self.begun.target, order)

    def command_moved_um(self, path: CutPath, order: int) -> complex:
        """Return by how much the command of an order was learned, in um."""
        return coefficient_of(path.command, order) - coefficient_of(self.begun.command, order)

    def varying(self, lobes: int, states: Mapping[int, OrderState] | None = None) -> frozenset[int]:
        """Return the orders that do not repeat since they have stepped, if they do not drift, by these states.

        Multiples of the lobe are of the chuck, which holds each part. Where another order has stepped, friction
        makes something else of the motion from the next part on.
        """
        found = set[int]()
        coupled = max((state.since + 1 for n, state in (states or {}).items() if n and state.since), default=0)
        for n, parts in self.shown_um.items():
            state = (states or {}).get(n, UNCHANGED)
            since = parts[state.since or coupled :]
            if n % lobes and len(since) >= ENOUGH_PARTS and scatter_um(since) > LEAST_UM:
                found |= set() if state.is_drifting or repeats(since) else {n}
        return frozenset(found)

    def withdrawn(self, path: CutPath, orders: Iterable[int]) -> CutPath:
        """Return a path with each of these orders as the first part had it."""
        back = tuple(orders)
        return CutPath(
            target=_subtract_orders(path.target, {n: self.target_moved_um(path, n) for n in back}),
            command=_subtract_orders(path.command, {n: self.command_moved_um(path, n) for n in back}),
        )


def _subtract_orders(path: LobedPath, less_um: Mapping[int, complex]) -> LobedPath:
    return path.plus({n: -c for n, c in less_um.items()})
