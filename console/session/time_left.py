"""How long a piece of work takes yet, at its pace so far."""

from __future__ import annotations

FIRST_ESTIMATE = 0.02  # fraction done from which the pace says anything
MOST = 0.99  # of work that has not ended and whose amount is an estimate


def fraction_done(done: float, whole: float) -> float:
    """Return how much of some work is done; never all of it."""
    return min(done / whole, MOST)


def seconds_left(fraction: float, elapsed_s: float) -> float | None:
    """Return the time left at the pace so far, None while too little is done to tell."""
    return None if fraction < FIRST_ESTIMATE else elapsed_s * (1.0 - fraction) / fraction
