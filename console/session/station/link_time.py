"""Response time of the controller, as a figure that stays constant in normal operation."""

from __future__ import annotations

from collections import deque

KEPT_S = 5.0
"""Window over which the longest response time is reported."""

_STEPS = (1.0, 2.0, 5.0)


class LinkTime:
    """Longest of the recent response times, rounded up to 1, 2, 5, 10, 20 ... ms."""

    def __init__(self) -> None:
        self._answers: deque[tuple[float, float]] = deque()

    def see(self, at_s: float, answer_s: float) -> float:
        """Take the time of a response, s; return the figure to report, ms."""
        answers = self._answers
        while answers and answers[0][0] < at_s - KEPT_S:
            answers.popleft()
        while answers and answers[-1][1] <= answer_s:  # can no longer be the longest
            answers.pop()
        answers.append((at_s, answer_s))
        return rounded_up_ms(1000.0 * answers[0][1])


def rounded_up_ms(answer_ms: float) -> float:
    """Return the next of 1, 2, 5, 10, 20 ... that is not less."""
    decade = 1.0
    while answer_ms > 10.0 * decade:
        decade *= 10.0
    return next((step * decade for step in _STEPS if answer_ms <= step * decade), 10.0 * decade)
