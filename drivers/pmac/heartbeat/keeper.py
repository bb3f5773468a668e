"""The heartbeat of a host: when the watchdog is renewed next, what is sent, and whether the PLC still counts."""

from __future__ import annotations

from dataclasses import dataclass, replace

from drivers.pmac import reserved
from drivers.pmac.dialect import Dialect
from drivers.pmac.heartbeat import watchdog
from drivers.pmac.heartbeat.arming import silent
from drivers.pmac.heartbeat.plc import GRACE_MS, RUN_DOWN_MS
from drivers.pmac.heartbeat.watchdog import PERIOD_MS, WATCHDOG_MS, Activity, cycles_of, watchdog_line
from drivers.pmac.language.text import format_number
from profiles.problem import Problem

NOTHING_GUARDED = f"P{reserved.ACTIVITY}={Activity.NOTHING:d}"
"""Reports that the guarded motion has ended; the watchdog may run out then."""

LOSS_SEEN = f"P{reserved.LOST}=0"  # Clears the loss flag, once an operator has seen it
PERIOD_S = 0.1  # Time between two queries of the echo: they are sent with a renewal
TIMEOUT_S = 0.3  # How long the PLC may stay at one number: three scans of a busy controller


@dataclass(frozen=True, slots=True, kw_only=True)
class Keeper:
    """The watchdog of a controller whose I10 is `i10`; `renewed_at_s`: time of the last renewal, host's time."""

    dialect: Dialect
    i10: float
    renewed_at_s: float | None = None

    @property
    def line(self) -> str:
        """The line that renews the watchdog."""
        return watchdog_line(self.dialect, self.i10)

    def due_s(self, now_s: float) -> float:
        """Return when the next renewal is to be sent."""
        return now_s if self.renewed_at_s is None else self.renewed_at_s + PERIOD_MS / 1000.0

    def lapsed(self, now_s: float) -> bool:
        """Whether the watchdog has timed out: what it guarded was ended, and a renewal does not revive it.

        A host that finds this, after a stall of its own, reads the state of the machine instead of renewing.
        """
        return self.renewed_at_s is None or now_s - self.renewed_at_s >= WATCHDOG_MS / 1000.0

    def renewed(self, now_s: float) -> Keeper:
        """Record that `line`, or a line that begins with a renewal, is being sent now."""
        return replace(self, renewed_at_s=now_s)

    def jog_line(self) -> str:
        """Return the commands that precede a jog or a home search, on its line."""
        return f"{self.line} P{reserved.ACTIVITY}={Activity.JOG:d}"

    def cut_line(self, retracted_counts: float, grace_ms: float = GRACE_MS) -> str:
        """Return the commands that precede the start of a cut, on its line.

        `retracted_counts` is the tool position clear of the part. `grace_ms` is the time the program may need to
        get it there, to the end of a turn and out; after that it has `RUN_DOWN_MS`.
        """
        values = {
            reserved.RETRACTED: format_number(retracted_counts),
            watchdog.GRACE: cycles_of(grace_ms, self.i10),
            watchdog.RUN_DOWN: cycles_of(RUN_DOWN_MS, self.i10),
        }
        settings = " ".join(f"P{number}={value}" for number, value in values.items())
        return f"{settings} {self.line} P{reserved.ACTIVITY}={Activity.CUT:d}"


@dataclass(slots=True, kw_only=True)
class EchoWatch:
    """The echo as seen during one motion. `due_s` is the time of the next query, host's time.

    `problem` is that of a PLC that has stopped, so that it guards nothing any more; None if there is none.
    """

    due_s: float = float("-inf")
    problem: Problem | None = None
    _counted: float | None = None
    _since_s: float = 0.0

    def asked(self, now_s: float) -> None:
        """Record that a query is sent now."""
        self.due_s = now_s + PERIOD_S

    def see(self, echo: float, asked_s: float) -> None:
        """Process the reply to the query that was sent at `asked_s`."""
        if echo != self._counted:
            self._counted, self._since_s, self.problem = echo, asked_s, None
        elif asked_s - self._since_s > TIMEOUT_S:
            self.problem = silent(echo, echo)
