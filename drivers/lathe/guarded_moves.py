"""Motion commands, each with the watchdog by which the controller ends it; a failed command leaves none armed."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from drivers.errors import ControllerError, DriverError, RefusedError
from drivers.lathe.commands import Sending
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.polling import Poller


class GuardedMoves:
    """Motion commands of one machine. Without a `heartbeat` there is no watchdog: for tests only."""

    def __init__(self, sending: Sending, looks: Poller, heartbeat: Heartbeat | None) -> None:
        self._sending, self._poller, self._heartbeat = sending, looks, heartbeat

    def jog(self, line: str) -> None:
        """Send a jog.

        Raises:
            DriverError: as `send`.
        """
        self.send(line, None if self._heartbeat is None else self._heartbeat.jog)

    def send(self, line: str, guarded: Callable[[str], str] | None) -> None:
        """Send a motion command; `guarded` prefixes the watchdog.

        Raises:
            DriverError: as `Sending.move`; no watchdog is left armed.
        """
        try:
            self._sending.move(line, guarded)
        except RefusedError:
            if self._heartbeat is not None:
                self._heartbeat.forgo()
            raise
        except ControllerError:
            self.end()  # what stands before the command on its line was executed
            with suppress(DriverError):
                self._poller.look()  # a loop may have opened meanwhile: control-A would close it
            raise

    def end(self) -> None:
        """Disarm the watchdog after a stop: the controller must not retract the tool by itself then.

        A link error here must not prevent the wait for rest; the controller then follows its policy for a lost
        host.
        """
        if self._heartbeat is not None:
            with suppress(DriverError):
                self._heartbeat.ended(self._poller.patience_s)
