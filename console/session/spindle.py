"""How fast the spindle turns, told from looks at its position: one figure for the cut, a stop and the screens."""

from __future__ import annotations

from drivers.snapshot import Snapshot

LOOKED_S = 1.0
"""Time over which the speed is told: that of a single look is known to some ms only."""


class SpindleWatch:
    """Sees every look at the machine. It belongs to the link thread."""

    def __init__(self, counts_per_rev: float) -> None:
        self._counts_per_rev = counts_per_rev
        self._looks: list[tuple[float, float]] = []
        self._homed = False

    def see(self, snapshot: Snapshot) -> float | None:
        """Return the speed in rpm with this look taken into account, None while there is only one."""
        homed = "home_complete" in snapshot.spindle.flags
        if homed != self._homed:
            self._homed = homed
            self.forget()  # the zero of the counts has moved, not the spindle
        self._looks = [look for look in self._looks if snapshot.at_s - LOOKED_S <= look[0] < snapshot.at_s]
        self._looks.append((snapshot.at_s, snapshot.spindle.position / self._counts_per_rev))
        return 60.0 * _slope(self._looks) if len(self._looks) > 1 else None

    def forget(self) -> None:
        """Leave out what was seen until now: it tells of another motion."""
        self._looks = []


def _slope(points: list[tuple[float, float]]) -> float:
    """Return the slope of the straight line with the least squares of its distances."""
    mean_x = sum(x for x, _ in points) / len(points)
    mean_y = sum(y for _, y in points) / len(points)
    across = sum((x - mean_x) * (y - mean_y) for x, y in points)
    return across / sum((x - mean_x) * (x - mean_x) for x, _ in points)
