"""Whether the PLC of the heartbeat goes on counting while something moves under its guard."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.pmac.heartbeat.arming import silent
from profiles.problem import Problem

PERIOD_S = 0.1
"""Between two questions: they go out with a lease."""

TIMEOUT_S = 0.3
"""How long the PLC may stand at one number: three scans of a card that is busy."""


@dataclass(slots=True, kw_only=True)
class EchoWatch:
    """What one motion has seen of the echo. `due_s` is when it is asked for next, host's time.

    `problem` is what is wrong with a PLC that stands, so that it guards nothing any more; None where nothing is.
    """

    due_s: float = float("-inf")
    problem: Problem | None = None
    _counted: float | None = None
    _since_s: float = 0.0

    def asked(self, now_s: float) -> None:
        """Note that a question goes out now."""
        self.due_s = now_s + PERIOD_S

    def see(self, echo: float, asked_s: float) -> None:
        """Take in the answer to the question that went out at `asked_s`."""
        if echo != self._counted:
            self._counted, self._since_s, self.problem = echo, asked_s, None
        elif asked_s - self._since_s > TIMEOUT_S:
            self.problem = silent(echo, echo)
