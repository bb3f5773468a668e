"""Round numbers for axes: steps of 1, 2 or 5 times a power of ten."""

from __future__ import annotations

import math

_ROUND = (1.0, 2.0, 5.0, 10.0)
_SLACK = 1.0e-9
"""Tolerance for a step to count as reached: sums of decimal steps are not exact."""


def step_125(at_least: float) -> float:
    """Return the smallest step of 1, 2 or 5 times a power of ten that is not below a positive number."""
    power = 10.0 ** math.floor(math.log10(at_least))
    return next((power * step for step in _ROUND if power * step >= at_least * (1.0 - _SLACK)), 10.0 * power)


def coarser(step: float) -> float:
    """Return the next larger step of 1, 2, 5."""
    return step_125(step * 1.01)


def nice_limits(low: float, high: float) -> tuple[float, float]:
    """Return limits of an axis on round numbers that hold both values, never equal.

    Such an axis stays constant while the data vary a little.
    """
    low, high = proper_limits((low, high))
    step = step_125((high - low) / 4.0)
    bottom = math.floor(low / step + _SLACK) * step
    top = math.ceil(high / step - _SLACK) * step
    return bottom, top


def proper_limits(limits: tuple[float, float]) -> tuple[float, float]:
    """Return finite limits in rising order with room between them."""
    low, high = (value if math.isfinite(value) else 0.0 for value in limits)
    low, high = min(low, high), max(low, high)
    # Two limits that a float can hardly distinguish leave no room for a scale.
    room = 1.0e-9 * max(abs(low), abs(high), 1.0)
    return (low, high) if high - low > room else (low - 0.5 * max(abs(low), 1.0), high + 0.5 * max(abs(high), 1.0))


def ticks(limits: tuple[float, float], most: int) -> tuple[float, ...]:
    """Return two or more, at most `most` (at least 2), round values within proper limits."""
    low, high = limits
    step = step_125((high - low) / (max(most, 2) + 1))
    denser = found = _multiples(low, high, step)
    while len(found) > max(most, 2):
        step, denser = coarser(step), found
        found = _multiples(low, high, step)
    return found if len(found) > 1 else (denser[0], denser[-1])


def _multiples(low: float, high: float, step: float) -> tuple[float, ...]:
    first, last = math.ceil(low / step - _SLACK), math.floor(high / step + _SLACK)
    return tuple(count * step for count in range(first, last + 1))


def label(value: float) -> str:
    """Return a tick's value in few characters."""
    text = f"{value:.6g}"
    return "0" if text == "-0" else text
