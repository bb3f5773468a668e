"""What got worse against an earlier run, in ratios: only what differs by more than both runs do in themselves."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.goals import Figure, figures
from benchmarks.tables import Table

ASSUMED_NOISE = 0.2
"""The noise of a run of one round: on a shared host ratios change by a fifth from day to day."""

HEAD = ("", "earlier", "now", "ratio", "noise", "")


def compared(earlier: Sequence[Sequence[Table]], now: Sequence[Sequence[Table]]) -> list[tuple[str, ...]]:
    """Return a row for each goal that both runs have a figure of."""
    before = {figure.goal.what: figure for figure in figures(earlier)}
    return [_row(before[each.goal.what], each) for each in figures(now) if each.goal.what in before]


def verdict(earlier: Figure, now: Figure) -> str:
    """Say whether a figure got worse."""
    if earlier.value == 0.0:
        return "the same" if now.value == 0.0 else "from nothing"
    change = now.value / earlier.value - 1.0
    worse = change if now.goal.at_most is not None else -change
    noise = noise_of(earlier, now)
    return "worse" if worse > noise else "better" if -worse > noise else "within the noise"


def noise_of(*both: Figure) -> float:
    """Return the larger noise of two figures, as a part of them."""
    return max(ASSUMED_NOISE if each.noise is None else each.noise for each in both)


def _row(earlier: Figure, now: Figure) -> tuple[str, ...]:
    ratio = f"{now.value / earlier.value:.2f}" if earlier.value else "-"
    noise = f"{noise_of(earlier, now):.2f}"
    return now.goal.what, f"{earlier.value:.4g}", f"{now.value:.4g}", ratio, noise, verdict(earlier, now)
