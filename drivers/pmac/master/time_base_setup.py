"""The host's commands for an external time base: two lines of the conversion table, Ix93 and Ix94.

Sources: PMAC Software Reference and Turbo Software Reference, encoder conversion table.
"""

from __future__ import annotations

from dataclasses import dataclass

from drivers.pmac.dialect import Dialect
from drivers.pmac.master.time_base_source import FASTEST_SLEW, Trigger

TIME_BASE_METHOD = 0x4
"""The method digit of an entry that is not triggered."""

METHOD_SHIFT = 20
"""Position of the method digit in a set-up word."""

_TURBO_MODE = 1 << 19
"""In a triggered entry of a Turbo PMAC: the source is a PMAC2-style servo IC."""

_SOURCE_MASK = _TURBO_MODE - 1

_SOURCE, _SLEW = 93, 94
"""Ix93, the time base source, and Ix94, its maximum rate of change."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeBaseEntry:
    """Two lines of the conversion table, from `line` on (0 is the first).

    `source` is the address of a converted position, or, if `trigger` is not None, of the registers of an encoder.
    """

    line: int
    source: int
    factor: int
    trigger: Trigger | None = None
    pmac2_encoder: bool = False

    def word(self) -> int:
        """The set-up word of the first line; the second one holds the scale factor."""
        method = TIME_BASE_METHOD if self.trigger is None else self.trigger
        mode = _TURBO_MODE if self.trigger is not None and self.pmac2_encoder else 0
        return method << METHOD_SHIFT | mode | self.source

    def address(self, dialect: Dialect) -> int:
        """Return the X address of the time base: the result of the second line."""
        return dialect.conversion_table.first_address + self.line + 1

    def commands(self, dialect: Dialect, system: int = 1) -> list[str]:
        """Return the lines to send; the last one stops Ix94 from limiting, which would lose counts."""
        table = dialect.conversion_table
        source, slew = dialect.system_index(system, _SOURCE), dialect.system_index(system, _SLEW)
        if table.first_setting is None:
            place = table.first_address + self.line
            setup = [f"WY:${place:X},${self.word():X},{self.factor}"]
        else:
            first = table.first_setting + self.line
            setup = [f"I{first}=${self.word():X}", f"I{first + 1}={self.factor}"]
        return [*setup, f"I{source}=${self.address(dialect):X}", f"I{slew}={FASTEST_SLEW}"]


def entry_of(line: int, word: int, factor: int) -> TimeBaseEntry | None:
    """Return the entry that two set-up words make, None when they make no time base."""
    method = word >> METHOD_SHIFT
    source = word & _SOURCE_MASK
    if method == TIME_BASE_METHOD:
        return TimeBaseEntry(line=line, source=source, factor=factor)
    if method not in tuple(Trigger):
        return None
    pmac2 = bool(word & _TURBO_MODE)
    return TimeBaseEntry(line=line, source=source, factor=factor, trigger=Trigger(method), pmac2_encoder=pmac2)
