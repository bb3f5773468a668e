"""Which orders of a row of parts repeat, and the path without what was learned of those that do not.

An order that comes with each blank, as through dry friction, is another one on each part: the path that removes
it from one part adds it to the next. With nothing learned a part would have shown what it shows, and what the
learned motion has removed of it. Over the parts its mean has to stand out of its scatter, as for `console
learn`; else the order returns to the path of the first part, and may be learned again once it repeats.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from profiles.compensations.learning import REPEATS_SD_UM, SIGNIFICANT, coefficient_of
from profiles.compensations.optimal_gain import repeats, scatter_um
from profiles.compensations.path import CutPath, LobedPath

ENOUGH_PARTS = 3
"""Parts from which an order is judged: two that agree by less than F = 19 are no evidence that it varies."""

LEAST_UM = SIGNIFICANT * REPEATS_SD_UM
"""Scatter of an order from which it varies: less than that no lathe repeats, and to learn it does no harm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeating:
    """The path that the first part was `begun` with, and what each part has shown of each order since, in um."""

    begun: CutPath
    shown_um: Mapping[int, tuple[complex, ...]] = field(default_factory=dict)

    def seen(self, shown_um: Mapping[int, complex]) -> Repeating:
        """Return this with one part more, by what it would have shown of each order with nothing learned."""
        every = {n: (*self.shown_um.get(n, ()), c) for n, c in shown_um.items()}
        return Repeating(begun=self.begun, shown_um={**self.shown_um, **every})

    def target_moved_um(self, path: CutPath, order: int) -> complex:
        """Return by how much the target of an order was learned, in um."""
        return coefficient_of(path.target, order) - coefficient_of(self.begun.target, order)

    def command_moved_um(self, path: CutPath, order: int) -> complex:
        """Return by how much the command of an order was learned, in um."""
        return coefficient_of(path.command, order) - coefficient_of(self.begun.command, order)

    def varying(self, lobes: int) -> frozenset[int]:
        """Return the orders that do not repeat; multiples of the lobe are of the chuck, which holds each part."""
        judged = {n: parts for n, parts in self.shown_um.items() if n % lobes and len(parts) >= ENOUGH_PARTS}
        return frozenset(n for n, parts in judged.items() if scatter_um(parts) > LEAST_UM and not repeats(parts))

    def withdrawn(self, path: CutPath, orders: Iterable[int]) -> CutPath:
        """Return a path with each of these orders as the first part had it."""
        back = tuple(orders)
        return CutPath(
            target=_without(path.target, {n: self.target_moved_um(path, n) for n in back}),
            command=_without(path.command, {n: self.command_moved_um(path, n) for n in back}),
        )


def _without(path: LobedPath, less_um: Mapping[int, complex]) -> LobedPath:
    return path.plus({n: -c for n, c in less_um.items()})
