"""How lathes of one kind differ: values of a plant drawn from the seed of the lathe around those of its file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from random import Random
from typing import Any

from profiles.fields import Field, Kind, fault

WIDEST_SD = 3.0  # no value is further from that of the file: a lathe in 370 would be


def spread_fields(fields: tuple[Field, ...]) -> tuple[Field, ...]:
    """Return what a table of standard deviations may hold: one for each number of a plant, in its unit."""
    return tuple(
        replace(each, above=None, at_least=0.0, at_most=_width(each), default=0.0, optional=False)
        for each in fields
        if each.kind is Kind.NUMBER
    )


def drawn(
    values: Mapping[str, Any], sd: Mapping[str, float], fields: tuple[Field, ...], seed: int
) -> dict[str, Any]:
    """Return the values of one lathe: each normal about that of its file, again until it is within its limits.

    Each key has random numbers of its own, so that another key in the file leaves them as they are.
    """
    found = dict(values)
    known = {each.key: each for each in fields}
    for key, width in sd.items():
        if width > 0.0:
            found[key] = _drawn(known[key], values[key], width, Random(f"{seed} {key} of the plant"))
    return found


def _drawn(field: Field, mean: float, sd: float, random: Random) -> float:
    while True:
        value = random.gauss(mean, sd)
        if abs(value - mean) <= WIDEST_SD * sd and not fault(field, value):
            return value


def _width(field: Field) -> float:
    """Return the range of a field: both of its bounds are numbers."""
    low = field.at_least if field.above is None else field.above
    return (field.at_most or math.inf) - (low or 0.0)
