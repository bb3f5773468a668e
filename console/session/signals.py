"""Signals that end the console: each of them stops the machine first."""

from __future__ import annotations

import signal
from types import FrameType

from console.session.errors import Interrupted
from drivers.stop import StopPath

ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interruption:
    """Turns a signal into a stop of whatever machine is being guarded.

    Installed before the numerics are loaded. With a machine the handler only sends the stop: the session then
    sees it, waits for rest, and leaves. Before there is a machine it ends the command at once.
    """

    def __init__(self) -> None:
        self.reason: str | None = None
        self._stop: StopPath | None = None

    def install(self) -> None:
        """Take over the signals."""
        for number in ENDING_SIGNALS:
            signal.signal(number, self._handle)

    def guard(self, stop: StopPath) -> None:
        """Stop this machine from now on; at once if a signal has already come."""
        self._stop = stop
        if self.reason is not None:
            stop.stop(self.reason)

    def end(self, reason: str) -> None:
        """Stop the guarded machine; also for what is no signal, such as a terminal that is gone.

        Raises:
            Interrupted: there is no machine yet.
        """
        self.reason = self.reason or reason
        if self._stop is None:
            raise Interrupted(self.reason)
        self._stop.stop(self.reason)

    def _handle(self, number: int, _: FrameType | None) -> None:
        self.end(signal.Signals(number).name)
