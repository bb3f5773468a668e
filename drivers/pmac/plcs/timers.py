"""The timers of the card that count down a unit each servo cycle, for PLCs and programs to wait by."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from drivers.pmac.dialect import Dialect

LOWEST_COUNT = -(2**23)
"""Here a timer stays; it does not roll over (Turbo Software Reference, Isx11)."""

_Name = TypeVar("_Name")


def count_down(values: Mapping[_Name, float], cycles: int) -> dict[_Name, float]:
    """Return what timers say after a number of servo cycles; below zero they count on down to -2^23."""
    return {name: max(float(LOWEST_COUNT), value - cycles) for name, value in values.items()}


def timer_variables(dialect: Dialect, activation: float) -> tuple[int, ...]:
    """Return the I-variables that are timers and run; `activation` is the value of `system_activation` (I68).

    Timers that are words of memory (`timer_words`) are not among them, and always run.
    """
    systems = range(1, min(int(activation) + 1, dialect.system_count) + 1)
    return tuple(dialect.system_index(system, number) for system in systems for number in dialect.timer_numbers)
