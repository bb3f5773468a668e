"""A quantity over the angle of the spindle: its mean over the turns, and how much they differ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LEAST_TURNS = 2.0
BINS = 120  # of three degrees


@dataclass(frozen=True, kw_only=True, eq=False)
class TurnAverage:
    """Mean and standard deviation in the middle of each part of a turn, deg; (BINS,), NaN without samples."""

    angle_deg: Floats
    mean: Floats
    spread: Floats
    turns: float


def turns_of(angle_deg: Floats) -> float:
    """Return how many turns the spindle made, in the direction in which it ended."""
    return float(abs(angle_deg[-1] - angle_deg[0]) / 360.0) if angle_deg.size else 0.0


def over_turns(angle_deg: Floats, values: Floats) -> TurnAverage | None:
    """Return the average of values over the angle, each turn counting alike; None for less than two turns.

    In a part of the turn each turn counts by the mean of its samples there: the spread is that between turns.
    """
    turns = turns_of(angle_deg)
    if turns < LEAST_TURNS:
        return None
    place = np.floor(np.mod(angle_deg, 360.0) / 360.0 * BINS).astype(int) % BINS
    turn = np.floor(angle_deg / 360.0).astype(int)
    turn -= turn.min()
    cells = turn * BINS + place
    size = (int(turn.max()) + 1) * BINS
    counts = np.bincount(cells, minlength=size).reshape(-1, BINS)
    sums = np.bincount(cells, weights=values, minlength=size).reshape(-1, BINS)
    with np.errstate(invalid="ignore", divide="ignore"):
        means = np.where(counts > 0, sums / counts, np.nan)
    seen = (counts > 0).sum(axis=0)
    mean = np.where(seen > 0, np.nansum(means, axis=0) / np.maximum(seen, 1), np.nan)
    squares = np.nansum((means - mean) ** 2, axis=0)
    spread = np.where(seen > 1, np.sqrt(squares / np.maximum(seen - 1, 1)), np.nan)
    middles: Floats = (np.arange(BINS, dtype=np.float64) + 0.5) * (360.0 / BINS)
    return TurnAverage(angle_deg=middles, mean=mean, spread=spread, turns=turns)
