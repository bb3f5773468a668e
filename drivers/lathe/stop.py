"""The one way to stop the machine: short, past every queue, without waiting for a reply.

Which stop is right depends on the drives (commissioning rules): control-A ramps down, but it also closes open
loops, so it may only be sent while every activated motor is known to be in closed loop. In every other state,
the ones with hands in the machine among them, the stop is control-K, which opens all loops.
"""

from __future__ import annotations

import math

from drivers.errors import DriverError, LinkError, RefusedError
from drivers.link.base import Link, StopWay
from profiles.problem import Problem

ABORT_ALL = b"\x01"
KILL_ALL = b"\x0b"


class StoppedError(DriverError):
    """The operator (or a signal) stopped the machine; what was going on does not go on."""


def way_problems(way: StopWay) -> tuple[Problem, ...]:
    """Return why nothing may be armed while a stop would go this way: the one that was asked for is lost."""
    return (Problem(code="stops.connection_lost"),) if way is StopWay.LOST else ()


class StopPath:
    """Latched twice, against motion and against energising.

    Once stopped, nothing that moves is sent until `release`; and after one control-K every further stop is a
    control-K until then, whatever an older reply says of the drives.

    `loops_closed` is set by the lathe from what the controller reports, and cleared when that is in doubt; it
    starts as False, because nothing is known yet. `inside_guard` says that somebody may be inside the guard: until
    that is taken back every stop is a control-K, whatever the drives are said to be. `delivered` is whether
    the link took the last stop.

    `leave_by_s` is set by whoever has to end this process, in machine time: rest is not waited for beyond it.
    `given_up` is whether rest was waited for in vain, as long as it may take behind a control-K or until then.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self.loops_closed = False
        self.inside_guard = False
        # No lock: a signal handler may come in the middle of anything. The list of stops only grows, a release
        # only says how many of them are over, so that no release can take back a stop that it does not know.
        self._begun: list[str] = []
        self._sent: list[None] = []
        self.delivered = True
        self.leave_by_s = math.inf
        self.given_up = False
        self._killed_at = 0
        self._proven = 0
        self._released = 0

    @property
    def way(self) -> StopWay:
        """What a stop would go through now."""
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
        """How many stops have gone out."""
        return len(self._sent)

    @property
    def mark(self) -> int | None:
        """How many stops were sent, None while one is on its way."""
        sent = len(self._sent)
        return sent if sent == len(self._begun) else None

    @property
    def proven(self) -> bool:
        """Whether the machine was seen at rest after the last stop that was sent."""
        return self.reason is not None and self._proven == len(self._begun)

    def stop(self, reason: str) -> None:
        """Send the stop now. Safe in a signal handler and from any thread; never raises."""
        self._send(reason, kill=False)

    def note(self, reason: str) -> None:
        """Let nothing that moves go out any more, and send nothing: it is not known yet whose the machine is."""
        self._begun.append(reason)
        self._sent.append(None)

    def kill(self, reason: str) -> None:
        """Open every loop now; the spindle coasts."""
        self._send(reason, kill=True)

    def repeat(self) -> None:
        """Send the stop again, while it is not yet proven that the machine rests."""
        self._send("repeated", kill=False)

    def rest_proven(self, mark: int) -> None:
        """Take note that every look since `mark` found the machine at rest."""
        self._proven = mark
        self.given_up = False

    def release(self) -> None:
        """Go on after a stop; does nothing when none is in force. A stop that comes meanwhile stays in force.

        Raises:
            RefusedError: `stop.not_proven`, the machine was not seen at rest after the last stop.
        """
        if self.reason is None:
            return
        proven = self._proven
        if proven != len(self._begun):
            raise RefusedError(Problem(code="stop.not_proven", where=self._link.address))
        self.loops_closed = False
        self._released = proven

    def switch_off(self) -> None:
        """Open every loop without a stop in force afterwards: an ordinary act, for a machine at rest.

        Raises:
            LinkError: the link broke.
        """
        self.loops_closed = False
        self._link.send_urgent(KILL_ALL)

    def check(self) -> None:
        """Refuse to go on after a stop.

        Raises:
            StoppedError: `machine.stopped`.
        """
        reason = self.reason
        if reason is not None:
            raise StoppedError(Problem(code="machine.stopped", value=reason))

    def _send(self, reason: str, *, kill: bool) -> None:
        self._begun.append(reason)
        if kill or self.inside_guard or not self.loops_closed:
            self._killed_at = len(self._begun)
        try:
            self._link.send_urgent(KILL_ALL if self.killed else ABORT_ALL)
            self.delivered = True
        except LinkError:
            # A link that is gone has nobody to tell here: the wait for rest fails, and says so.
            self.delivered = False
        finally:
            self._sent.append(None)
