"""The heartbeat of a host: when the next lease is due, what is sent, and whether the PLC goes on counting."""

from __future__ import annotations

from dataclasses import dataclass, replace

from drivers.pmac import reserved
from drivers.pmac.dialect import Dialect
from drivers.pmac.heartbeat import registers
from drivers.pmac.heartbeat.arming import silent
from drivers.pmac.heartbeat.plc import GRACE_MS, RUN_DOWN_MS
from drivers.pmac.heartbeat.watchdog import PERIOD_MS, WATCHDOG_MS, Activity, cycles_of, watchdog_line
from drivers.pmac.language.text import format_number
from profiles.problem import Problem

NOTHING_GUARDED = f"P{reserved.ACTIVITY}={Activity.NOTHING:d}"
"""Says that what was guarded has come to its end; the lease may run out then."""

LOSS_SEEN = f"P{reserved.LOST}=0"
"""Takes back the word that something was ended, when an operator has seen it."""

PERIOD_S = 0.1
"""Between two questions: they go out with a lease."""

TIMEOUT_S = 0.3
"""How long the PLC may stand at one number: three scans of a card that is busy."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Keeper:
    """The lease of a controller whose I10 is `i10`. `renewed_at_s` is when the last was sent, host's time."""

    dialect: Dialect
    i10: float
    renewed_at_s: float | None = None

    @property
    def line(self) -> str:
        """The line that renews the lease."""
        return watchdog_line(self.dialect, self.i10)

    def due_s(self, now_s: float) -> float:
        """Return when the next renewal is to be sent."""
        return now_s if self.renewed_at_s is None else self.renewed_at_s + PERIOD_MS / 1000.0

    def lapsed(self, now_s: float) -> bool:
        """Whether the last lease has run out: what it guarded was ended, and a new one brings nothing back.

        A host that finds this, after a stall of its own, looks at the machine instead of renewing.
        """
        return self.renewed_at_s is None or now_s - self.renewed_at_s >= WATCHDOG_MS / 1000.0

    def renewed(self, now_s: float) -> Keeper:
        """Note that `line`, or a line that begins with a lease, is being sent now."""
        return replace(self, renewed_at_s=now_s)

    def jog_line(self) -> str:
        """Return what stands in front of a jog or a home search, on its line."""
        return f"{self.line} P{reserved.ACTIVITY}={Activity.JOG:d}"

    def cut_line(
        self, retracted_counts: float, grace_ms: float = GRACE_MS, run_down_ms: float = RUN_DOWN_MS
    ) -> str:
        """Return what stands in front of the start of a cut, on its line.

        `retracted_counts` is where the tool is out of the part. `grace_ms` is what the program may need to get it
        there, to the end of a turn and out; `run_down_ms` is what it may do behind that.
        """
        values = {
            f"P{reserved.RETRACTED}": format_number(retracted_counts),
            f"P{registers.GRACE}": cycles_of(grace_ms, self.i10),
            f"P{registers.RUN_DOWN}": cycles_of(run_down_ms, self.i10),
        }
        said = " ".join(f"{name}={value}" for name, value in values.items())
        return f"{said} {self.line} P{reserved.ACTIVITY}={Activity.CUT:d}"


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
