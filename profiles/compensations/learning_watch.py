"""Monitor learning: compare each harmonic with its best pass so far, and revert it when it grows.

A learning pass changes e to (1 - gain T'/T) e. From a factor of 1 on it makes the error worse without notice.
So a harmonic that has significantly grown is reverted to its best state and frozen there: its residual never
ends above the best one, except for noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TypeVar

from profiles.compensations.learning import SIGNIFICANT
from profiles.compensations.path import CutPath, LobedPath

Value = TypeVar("Value")

REPEATS_SD_UM = 0.1
"""Variation of a harmonic from pass to pass with the same path, beyond what a fit can see of it.

Twice the 0.05 um of tool and part on the simulated lathe `realistic`, from friction and non-repeatable spindle
error: a real one is hardly better.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Grown:
    """A harmonic no longer learned: amplitudes in um at its best, and in the pass that was significantly worse."""

    waves: int
    best_um: float
    grown_um: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Best:
    """The best residual of a harmonic, an amplitude with its standard deviation, and the path of that pass."""

    left_um: float
    sd_um: float
    target: complex
    command: complex


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch:
    """The best pass of each harmonic so far, and the harmonics that have grown since."""

    best: Mapping[int, Best] = field(default_factory=dict)
    grown: tuple[Grown, ...] = ()

    def judged(
        self,
        path: CutPath,
        left_um: Mapping[int, complex],
        sd_um: Callable[[int], float],
        allowed_um: Callable[[int], float] = lambda _: 0.0,
    ) -> Watch:
        """Return the watch after a pass with `path` that left these harmonics, each with its standard deviation.

        `allowed_um` is how much a harmonic may grow for reasons other than learning.
        """
        best, grown = dict(self.best), list(self.grown)
        for n, coefficient in self.learned(left_um).items():
            now = _best(path, n, abs(coefficient), math.hypot(sd_um(n), REPEATS_SD_UM))
            before = best.get(n)
            if before is None or now.left_um < before.left_um:
                best[n] = now
            elif not now.left_um <= before.left_um + allowed_um(n) + SIGNIFICANT * math.hypot(
                now.sd_um, before.sd_um
            ):
                grown.append(Grown(waves=n, best_um=before.left_um, grown_um=now.left_um))
        return replace(self, best=best, grown=tuple(grown))

    def afresh(self) -> Watch:
        """Return a new watch for passes not comparable with those so far; frozen harmonics stay frozen."""
        return replace(self, best={n: each for n, each in self.best.items() if n in self.frozen})

    @property
    def frozen(self) -> frozenset[int]:
        """The harmonics that are no longer learned."""
        return frozenset(each.waves for each in self.grown)

    def learned(self, waves: Mapping[int, Value]) -> dict[int, Value]:
        """Return the harmonics that are learned."""
        return {n: value for n, value in waves.items() if n not in self.frozen}

    def kept(self, path: CutPath) -> CutPath:
        """Return a path with each frozen harmonic at its best."""
        back = {n: self.best[n] for n in self.frozen}
        return CutPath(
            target=path.target.plus({n: each.target - coefficient_of(path.target, n) for n, each in back.items()}),
            command=path.command.plus(
                {n: each.command - coefficient_of(path.command, n) for n, each in back.items()}
            ),
        )


def _best(path: CutPath, waves: int, left_um: float, sd_um: float) -> Best:
    return Best(
        left_um=left_um,
        sd_um=sd_um,
        target=coefficient_of(path.target, waves),
        command=coefficient_of(path.command, waves),
    )


def coefficient_of(path: LobedPath, waves: int) -> complex:
    """Return the c of Re(c exp(j waves angle)) of a path, in um; 0 where it has no such harmonic."""
    return next((wave.coefficient for wave in path.waves if wave.lobes == waves), 0j)
