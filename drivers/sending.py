"""Sending what moves, energises or writes: once, by the owner of the machine, and never past a stop."""

from __future__ import annotations

from collections.abc import Callable

from drivers.errors import LinkError, RefusedError
from drivers.looks import Looks
from drivers.ownership import Ownership
from drivers.pmac.client import PmacClient
from drivers.safety import device_problems
from drivers.stop import StopPath
from profiles.problem import Problem


class Sending:
    """The way of every order to the controller. `has_moved` says whether anything that moves was ever sent."""

    def __init__(self, client: PmacClient, stop: StopPath, looks: Looks, ownership: Ownership | None) -> None:
        self.has_moved = False
        self._client, self._stop, self._looks, self._ownership = client, stop, looks, ownership

    def refuse_unless_owner(self) -> None:
        """Make sure that this console may command the machine.

        Raises:
            RefusedError: `owner.held`, `owner.observer`.
        """
        if self._ownership is not None:
            self._ownership.refuse_unless_owner()

    def refuse_unsafe(self) -> None:
        """Look at the safety devices that the controller sees, where it sees any.

        Raises:
            RefusedError: `safety.not_good`, with each that is not as it must be.
            DriverError: the link broke.
        """
        if not self._looks.sees_devices:
            return
        problems = device_problems(self._looks.look().inputs)
        if problems:
            raise RefusedError(*problems)

    def move(self, line: str, leased: Callable[[str], str] | None = None) -> None:
        """Send a line that moves something, to axes that are under control: it must not close an open loop.

        `leased` puts a lease in front of it, once nothing stands in its way.

        Raises:
            RefusedError: `machine.not_enabled`, nothing was sent; and those of `once`.
        """
        if not self._looks.loops_closed and not self._looks.look().loops_closed:
            raise RefusedError(Problem(code="machine.not_enabled", where=self._client.link.address))
        self.once(line, leased)

    def once(self, line: str, leased: Callable[[str], str] | None = None) -> None:
        """Send a line that moves or energises. A stop that overtook it on the way is sent again behind it.

        Once as soon as the line has left, should its reply not come, and once when the card has carried it out.
        What comes before the line has left keeps it here: the way back in step, and whatever `leased` asks the
        card, take their time.

        Raises:
            StoppedError: before or behind it.
            RefusedError: `machine.hands_in`, and those of `refuse_unless_owner` and `refuse_unsafe`; nothing was
                sent.
        """
        self._refuse_now()
        self.refuse_unsafe()
        if leased is not None:
            line = leased(line)  # it tells whose the machine is now, too
        self.has_moved = True
        try:
            self._client.send(line, check=self._refuse_now)
            if self._stop.reason is not None:
                self._stop.repeat()
            self._client.reply(line)
        except LinkError:
            self._looks.in_doubt()
            raise
        if self._stop.reason is not None:
            self._stop.repeat()
        self._stop.check()

    def _refuse_now(self) -> None:
        self._stop.check()
        self.refuse_unless_owner()
        if self._stop.hands_in:
            raise RefusedError(Problem(code="machine.hands_in", where=self._client.link.address))
