"""Lines that move the machine, each with the lease that the controller ends it by; a failed line leaves none."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from drivers.errors import ControllerError, DriverError, RefusedError
from drivers.lathe.commands import Sending
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.polling import Poller


class GuardedMoves:
    """What moves one machine. Without a `heartbeat` nothing keeps a lease: for tests alone."""

    def __init__(self, sending: Sending, looks: Poller, heartbeat: Heartbeat | None) -> None:
        self._sending, self._poller, self._heartbeat = sending, looks, heartbeat

    def jog(self, line: str) -> None:
        """Send a line that jogs.

        Raises:
            DriverError: as `send`.
        """
        self.send(line, None if self._heartbeat is None else self._heartbeat.jog)

    def send(self, line: str, guarded: Callable[[str], str] | None) -> None:
        """Send a line that moves; `guarded` puts the lease in front of it.

        Raises:
            DriverError: as `Sending.move`; no lease is left.
        """
        try:
            self._sending.move(line, guarded)
        except RefusedError:
            if self._heartbeat is not None:
                self._heartbeat.forgo()
            raise
        except ControllerError:
            self.end()  # what stands in front of the order on its line was carried out
            with suppress(DriverError):
                self._poller.look()  # perhaps a loop has opened meanwhile: control-A would close it
            raise

    def end(self) -> None:
        """Nothing is to be guarded after a stop: the controller must not take the tool out by itself then.

        A link that does not take it is no reason not to look for rest; the controller then does what it was told
        to do without a host.
        """
        if self._heartbeat is not None:
            with suppress(DriverError):
                self._heartbeat.ended(self._poller.patience_s)
