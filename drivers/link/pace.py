"""How much may be handed to a slow line ahead of a stop. Pure: times in, numbers of bytes out."""

from __future__ import annotations

AHEAD_S = 0.010
"""What a line may still have to send when more is handed to it, in time: a stop waits so long at most."""

CHARACTER_BITS = 10
"""A start bit, 8 data bits, a stop bit."""

LEAST_WAIT_S = 0.001


class Pace:
    """Reckons by the speed of the line what has left it; what buffers are on the way need not be known."""

    def __init__(self, baud_rate: int) -> None:
        self._character_s = CHARACTER_BITS / baud_rate
        self._clear_at_s = 0.0

    @property
    def ahead(self) -> int:
        """Bytes that may wait in the line; one at least, or nothing would ever go."""
        return max(int(AHEAD_S / self._character_s), 1)

    def room(self, now_s: float) -> int:
        """Return how many bytes may be handed over now."""
        waiting_s = max(self._clear_at_s - now_s, 0.0)
        # A little more than a whole number is not to be a little less by the binary fractions.
        return max(self.ahead - int(waiting_s / self._character_s + 0.999), 0)

    def wait_s(self, now_s: float) -> float:
        """Return after what time half of what may wait has left: often enough to keep the line busy."""
        waiting_s = max(self._clear_at_s - now_s, 0.0)
        return max(waiting_s - self.ahead // 2 * self._character_s, self._character_s, LEAST_WAIT_S)

    def handed(self, count: int, now_s: float) -> None:
        """Take note of bytes that the line has taken."""
        self._clear_at_s = max(self._clear_at_s, now_s) + count * self._character_s
