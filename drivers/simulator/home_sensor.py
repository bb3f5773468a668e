"""Where a motor finds its home trigger."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class HomeSensor:
    """Where the home trigger is, in machine counts.

    Without a period it is a flag that is met at `position` and stays met below it, at the end of travel; with
    a period it is an index once a turn.
    """

    position: float = 0.0
    period: float | None = None

    def passed(self, before: float, after: float) -> float | None:
        """Return the machine position of the trigger met on the way from `before` to `after`, if any."""
        if self.period is None:
            return self.position if min(before, after) <= self.position else None
        forward = after >= before
        mark = math.floor(max(before, after) / self.period) if forward else math.ceil(after / self.period)
        crossed = mark * self.period
        return crossed if min(before, after) < crossed <= max(before, after) else None
