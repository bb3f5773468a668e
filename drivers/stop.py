"""The one way to stop the machine: short, past every queue, without waiting for a reply.

Which stop is right depends on the drives (commissioning rules): control-A ramps down, but it also closes open
loops, so it may only be sent while every activated motor is known to be in closed loop. In every other state,
the ones with hands in the machine among them, the stop is control-K, which opens all loops.
"""

from __future__ import annotations

from contextlib import suppress

from drivers.errors import DriverError, LinkError
from drivers.link.base import Link
from profiles.problem import Problem

ABORT_ALL = b"\x01"
KILL_ALL = b"\x0b"


class StoppedError(DriverError):
    """The operator (or a signal) stopped the machine; what was going on does not go on."""


class StopPath:
    """Latched twice, against motion and against energising.

    Once stopped, nothing that moves is sent again in this session; and after one control-K every further stop
    is a control-K, whatever an older reply says of the drives.

    `loops_closed` is set by the lathe from what the controller reports, and cleared when that is in doubt; it
    starts as False, because nothing is known yet.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self.loops_closed = False
        self.killed = False
        self.reason: str | None = None

    def stop(self, reason: str) -> None:
        """Send the stop now. Safe in a signal handler and from any thread; never raises."""
        self.reason = self.reason or reason
        self.repeat()

    def kill(self, reason: str) -> None:
        """Open every loop now; the spindle coasts."""
        self.killed = True
        self.stop(reason)

    def repeat(self) -> None:
        """Send the stop again, while it is not yet proven that the machine rests."""
        if not self.loops_closed:
            self.killed = True
        # A link that is gone has nobody to tell here: the wait for rest fails, and says so.
        with suppress(LinkError):
            self._link.send_urgent(KILL_ALL if self.killed else ABORT_ALL)

    def check(self) -> None:
        """Refuse to go on after a stop.

        Raises:
            StoppedError: `machine.stopped`.
        """
        if self.reason is not None:
            raise StoppedError(Problem(code="machine.stopped", value=self.reason))
