"""Where the iron of an axis ends: a hard stop at each end of its travel."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Ends:
    """Machine positions in counts. Beyond them the iron cannot be; it stands where it has met one."""

    lowest: float
    highest: float

    def holds(self, place: float) -> float:
        """Return the place where the iron is that something would bring to `place`."""
        return min(max(place, self.lowest), self.highest)


def ends_at(ends_mm: tuple[float, float] | None, counts_per_mm: float) -> Ends | None:
    """Return the ends of an axis in its counts."""
    return ends_mm and Ends(lowest=ends_mm[0] * counts_per_mm, highest=ends_mm[1] * counts_per_mm)
