"""The only way to stop the machine: short, ahead of every queue, without waiting for a reply.

Which stop is right depends on the drives (commissioning rules): control-A ramps down, but it also closes open
loops, so it may only be sent while every activated motor is known to be in closed loop. In every other state,
including whenever somebody may be inside the guard, the stop is control-K, which opens all loops.
"""

from __future__ import annotations

import math

from drivers.clock import FreezeWatch
from drivers.errors import DriverError, LinkError, RefusedError
from drivers.link.base import Link, StopWay
from profiles.problem import Problem

ABORT_ALL = b"\x01"
KILL_ALL = b"\x0b"


class StoppedError(DriverError):
    """The operator (or a signal) stopped the machine; the current action is abandoned."""


def way_problems(way: StopWay) -> tuple[Problem, ...]:
    """Return why nothing may be armed while a stop would go this way: the requested way is lost."""
    return (Problem(code="stops.connection_lost"),) if way is StopWay.LOST else ()


class StopPath:
    """The stop path, latched twice: against motion and against energising.

    Once stopped, nothing that moves is sent until `release`; and after one control-K every further stop is a
    control-K until then, whatever an older reply reports of the drives.

    `loops_closed` is set by the lathe from the controller's reports and cleared when they are in doubt; it
    starts as False, because nothing is known yet. `inside_guard` says that somebody may be inside the guard:
    until that is cleared every stop is a control-K, whatever state the drives report. `delivered` is whether
    the link accepted the last stop.

    `leave_by_s` is the deadline of a process that has to exit, in machine time, for the wait for rest.
    `given_up` is whether that wait failed, after the time allowed after a control-K or at the deadline. With
    `freezes` no motion is begun by a process that was frozen since its command was given.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self.loops_closed = False
        self.inside_guard = False
        # No lock: a signal handler may interrupt anything. The list of stops only grows; a release
        # only records how many of them are over, so no release can cancel a stop that it does not know.
        self._begun: list[str] = []
        self._sent: list[None] = []
        self.delivered, self.given_up = True, False
        self.leave_by_s = math.inf
        self.freezes: FreezeWatch | None = None
        self._killed_at = self._proven = self._released = 0

    @property
    def way(self) -> StopWay:
        """The way that a stop would take now."""
        return self._link.stop_way

    @property
    def reason(self) -> str | None:
        """Why the machine was stopped, None when no stop is in force."""
        released = self._released
        return self._begun[released] if len(self._begun) > released else None

    @property
    def killed(self) -> bool:
        """Whether a control-K is among the stops in force."""
        return self._killed_at > self._released

    @property
    def count(self) -> int:
        """How many stops were sent."""
        return len(self._sent)

    @property
    def mark(self) -> int | None:
        """How many stops were sent, None while one is on its way."""
        sent = len(self._sent)
        return sent if sent == len(self._begun) else None

    @property
    def proven(self) -> bool:
        """Whether the machine was seen at rest after the last stop."""
        return self.reason is not None and self._proven == len(self._begun)

    def stop(self, reason: str) -> None:
        """Send the stop now. Safe in a signal handler and from any thread; never raises."""
        self._send(reason, kill=False)

    def note(self, reason: str) -> None:
        """Block all motion commands without sending anything: it is not yet known who owns the machine."""
        self._begun.append(reason)
        self._sent.append(None)

    def kill(self, reason: str) -> None:
        """Open every loop now; the spindle coasts."""
        self._send(reason, kill=True)

    def repeat(self) -> None:
        """Send the stop again while rest is not yet proven."""
        self._send("repeated", kill=False)

    def rest_proven(self, mark: int) -> None:
        """Record that every poll since `mark` found the machine at rest."""
        self._proven = mark
        self.given_up = False

    def only_repeated(self, mark: int | None, latest: int | None) -> bool:
        """Whether the stops from `mark` to `latest` are the same one again, as those of a key that is held."""
        if mark is None or latest is None:
            return False
        return mark == latest or (mark > 0 and len({*self._begun[mark - 1 : latest]}) == 1)

    def release(self, *, drives_known: bool = False) -> None:
        """Release the stop; do nothing when none is in force. A stop that comes meanwhile stays in force.

        `drives_known`: the poll that proved rest is the last one, and what it reported of the drives holds.
        Raises RefusedError: `stop.not_proven`, the machine was not seen at rest after the last stop.
        """
        if self.reason is None:
            return
        proven = self._proven
        if proven != len(self._begun):
            raise RefusedError(Problem(code="stop.not_proven", where=self._link.address))
        self.loops_closed = self.loops_closed and drives_known
        self._released = proven

    def withdraw(self, count: int) -> None:
        """Drop the first `count` stops, none of which reached the machine: another console controls it now."""
        self._released, self.given_up = max(self._released, count), False

    def switch_off(self) -> None:
        """Disable the drives without a stop in force afterwards: a normal action, for a machine at rest."""
        self.loops_closed = False
        self._link.send_urgent(KILL_ALL)

    def check(self) -> None:
        """Refuse to continue after a stop. Raises StoppedError: `machine.stopped`."""
        reason = self.reason
        if reason is not None:
            raise StoppedError(Problem(code="machine.stopped", value=reason))

    def refuse_frozen(self) -> None:
        """Refuse to begin a motion after a pause of this process. Raises RefusedError: `session.frozen`."""
        if self.freezes is not None and (froze_s := self.freezes.froze_s):
            raise RefusedError(Problem(code="session.frozen", value=f"{froze_s:.1f} s"))

    def _send(self, reason: str, *, kill: bool) -> None:
        self._begun.append(reason)
        if kill or self.inside_guard or not self.loops_closed:
            self._killed_at = len(self._begun)
        try:
            self._link.send_urgent(KILL_ALL if self.killed else ABORT_ALL)
            self.delivered = True
        except LinkError:
            # A lost link cannot be reported here: the wait for rest fails and reports it.
            self.delivered = False
        finally:
            self._sent.append(None)
