"""What the I-variables of a controller are set to, and what I10 means."""

from __future__ import annotations

from collections.abc import Mapping

from drivers.pmac.dialect import PMAC

I10_PER_MS = 8_388_608
"""I10 counts servo time in 2^-23 ms, and wraps there."""

PARTS_PER_COUNT = 16.0
"""Ix11, Ix12, Ix26 and Ix28 are in sixteenths of a count."""


def settings_with(named: Mapping[str, float]) -> dict[int, float]:
    """Return every I-variable: those that are named, such as {"I116": 500}, and the factory's for the rest."""
    return {**PMAC.factory_variables(), **{int(name[1:]): value for name, value in named.items()}}


def servo_cycle_ms(i10: float) -> float:
    """Return the servo time that I10 states, ms.

    It has 23 bits and wraps; a 0 would stop the time of every motion, so the least step is taken.
    """
    return max(1, int(i10) % I10_PER_MS) / I10_PER_MS
