"""Decide which PLCs run, and which of them begin at their top.

PLC 0 runs in the foreground, a scan at each real-time interrupt; PLC 1 to 31 run in the background, a scan each in
the order of their numbers. I5 permits the one or the other; a PLC that it permits must also be enabled.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

I5_FOREGROUND = 1
I5_BACKGROUND = 2
"""The bits of I5."""

FOREGROUND_PLC = 0


@dataclass(frozen=True, slots=True)
class PlcSwitches:
    """The enabled PLCs, and those of them that begin at their top because they had no scan since."""

    enabled: frozenset[int] = frozenset()
    at_top: frozenset[int] = frozenset()

    def enable(self, numbers: Iterable[int]) -> PlcSwitches:
        """ENABLE PLC: one that is already enabled continues where it is."""
        new = frozenset(numbers) - self.enabled
        return PlcSwitches(self.enabled | new, self.at_top | new)

    def disable(self, numbers: Iterable[int]) -> PlcSwitches:
        """DISABLE PLC, OPEN PLC, control-D or a run-time error: the place in a WHILE is lost."""
        off = frozenset(numbers)
        return PlcSwitches(self.enabled - off, self.at_top - off)

    def scanned(self, number: int) -> PlcSwitches:
        """Record that a PLC begins a scan: the next one continues where this one ends."""
        return PlcSwitches(self.enabled, self.at_top - {number})


def power_up(stored: Iterable[int]) -> PlcSwitches:
    """Return the switches after power-up or reset: every stored PLC is enabled."""
    return PlcSwitches().enable(stored)


def foreground_runs(i5: float, enabled: Collection[int], stored: Collection[int]) -> bool:
    """Whether PLC 0 has a scan at this real-time interrupt."""
    return _permits(i5, I5_FOREGROUND) and FOREGROUND_PLC in enabled and FOREGROUND_PLC in stored


def background_order(i5: float, enabled: Collection[int], stored: Collection[int]) -> tuple[int, ...]:
    """Return the PLCs that have a scan in this background cycle, in order.

    One that an earlier PLC of the same cycle disables is to be skipped: check `enabled` again.
    """
    if not _permits(i5, I5_BACKGROUND):
        return ()
    return tuple([number for number in sorted(stored) if number != FOREGROUND_PLC and number in enabled])


def _permits(i5: float, bit: int) -> bool:
    return bool(int(i5) & bit)
