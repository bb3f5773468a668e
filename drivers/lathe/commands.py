"""Send commands that move, energise or write: once, only from the owner of the machine, never past a stop."""

from __future__ import annotations

from collections.abc import Callable

from drivers.controller import Controller
from drivers.errors import LinkError, RefusedError
from drivers.lathe.ownership import Ownership
from drivers.lathe.polling import Poller
from drivers.lathe.safety import device_problems
from drivers.lathe.stop import StopPath
from profiles.problem import Problem

IN_PART = "link.line_in_part"
"""Code: a line did not arrive as it was sent, and part of it was executed."""

UNBROUGHT = frozenset(("link.line_differs", "link.line_unproven"))
"""Codes: a line did not arrive as it was sent, and none of it was executed."""


class Sending:
    """The single path of commands to the controller. `has_moved`: whether a command that moves was ever sent."""

    def __init__(
        self,
        client: Controller,
        stop: StopPath,
        looks: Poller,
        ownership: Ownership | None,
        forgo: Callable[[], None] = lambda: None,
    ) -> None:
        """`forgo` is called when a line was not executed, so that no watchdog stays armed for it."""
        self.has_moved, self._forgo = False, forgo
        self._client, self._stop, self._poller, self._ownership = client, stop, looks, ownership

    def refuse_unless_owner(self) -> None:
        """Make sure that this console may command the machine.

        Raises:
            RefusedError: `owner.held`, `owner.observer`.
        """
        if self._ownership is not None:
            self._ownership.refuse_unless_owner()

    def refuse_unsafe(self) -> None:
        """Check the safety devices that the controller sees, if it sees any.

        Raises:
            RefusedError: `safety.not_good`, with each device in the wrong state.
            DriverError: the link broke.
        """
        if not self._poller.sees_devices:
            return
        problems = device_problems(self._poller.look().inputs)
        if problems:
            raise RefusedError(*problems)

    def move(self, line: str, guarded: Callable[[str], str] | None = None) -> None:
        """Send a motion command; the loops must be closed already, because the command must not close one.

        `guarded` prefixes the watchdog, once nothing prevents the command.

        Raises:
            RefusedError: `machine.not_enabled`, nothing was sent; and those of `once`.
        """
        if not self._poller.loops_closed and not self._poller.look().loops_closed:
            raise RefusedError(Problem(code="machine.not_enabled", where=self._client.link.address))
        self.once(line, guarded)

    def once(self, line: str, guarded: Callable[[str], str] | None = None) -> None:
        """Send a line that moves or energises. A stop that overtook it is sent again after it.

        The stop is repeated as soon as the line has been sent, in case its reply does not come, and again when
        the controller has executed it. A stop before that keeps the line from being sent: resynchronising the
        link and the queries of `guarded` take time.

        Raises:
            StoppedError: before or after it.
            RefusedError: `machine.hands_in`, and those of `refuse_unless_owner` and `refuse_unsafe`; nothing was
                sent. `link.line_differs`, `link.line_unproven`: nothing was executed.
            LinkError: the link broke; `link.line_in_part`.
        """
        self._refuse_now()
        self.refuse_unsafe()
        if guarded is not None:
            line = guarded(line)  # this also reads who owns the machine
        self.has_moved = True
        try:
            self._client.send(line, check=self._refuse_now, moves=True)
            if self._stop.reason is not None:
                self._stop.repeat()
            self._client.reply(line)
        except RefusedError as refused:
            self._forgo()
            self._refuse_stirred(line, refused)
            raise
        except LinkError as error:
            if error.problems[0].code == IN_PART:
                self._stop.stop(IN_PART)
            self._poller.in_doubt()
            raise
        if self._stop.reason is not None:
            self._stop.repeat()
        self._stop.check()

    def refuse_moving(self) -> None:
        """Make sure that nothing moves.

        Raises:
            RefusedError: `machine.moving`.
            LinkError: the link broke or is out of step.
        """
        if self._poller.look().moving:
            raise RefusedError(Problem(code="machine.moving", where=self._client.link.address))

    def _refuse_stirred(self, line: str, refused: RefusedError) -> None:
        """Stop if anything moves after a line that was not executed: one of its characters acted by itself.

        Raises:
            LinkError: `link.line_in_part`; or the link broke.
        """
        if refused.problems[0].code in UNBROUGHT and self._poller.look().moving:
            self._stop.stop(IN_PART)
            raise LinkError(Problem(code=IN_PART, where=self._client.link.address, key=line))

    def _refuse_now(self) -> None:
        self._stop.check()
        self.refuse_unless_owner()
        if self._stop.inside_guard:
            raise RefusedError(Problem(code="machine.hands_in", where=self._client.link.address))
