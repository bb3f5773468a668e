"""Limit how many bytes are queued on a slow line before a stop. Pure: times in, numbers of bytes out."""

from __future__ import annotations

AHEAD_S = 0.010  # transmission time that may be queued on a line: the longest that a stop waits
CHARACTER_BITS = 10  # a start bit, 8 data bits, a stop bit
LEAST_WAIT_S = 0.001


class Pace:
    """Computes from the line speed what has been transmitted; buffers on the way need not be known."""

    def __init__(self, baud_rate: int) -> None:
        self._character_s = CHARACTER_BITS / baud_rate
        self._clear_at_s = 0.0

    @property
    def ahead(self) -> int:
        """Return how many bytes may be queued on the line; at least one, or nothing would ever be sent."""
        return max(int(AHEAD_S / self._character_s), 1)

    def room(self, now_s: float) -> int:
        """Return how many bytes may be queued now."""
        waiting_s = max(self._clear_at_s - now_s, 0.0)
        # Rounding guard: binary fractions must not push a whole number just below itself.
        return max(self.ahead - int(waiting_s / self._character_s + 0.999), 0)

    def wait_s(self, now_s: float) -> float:
        """Return the time until half of the queue has been transmitted: often enough to keep the line busy."""
        waiting_s = max(self._clear_at_s - now_s, 0.0)
        return max(waiting_s - self.ahead // 2 * self._character_s, self._character_s, LEAST_WAIT_S)

    def handed(self, count: int, now_s: float) -> None:
        """Record bytes that the line has accepted."""
        self._clear_at_s = max(self._clear_at_s, now_s) + count * self._character_s
