"""Send commands that move, energise or write: once, only from the owner of the machine, never past a stop.

A motion command carries the watchdog by which the controller ends it; a failed command leaves none armed.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from drivers.clock import Clock
from drivers.controller import Controller
from drivers.cutting.tables import Tables
from drivers.errors import ControllerError, DriverError, LinkError, RefusedError
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.ownership import Ownership
from drivers.lathe.polling import Poller
from drivers.lathe.safety import device_problems
from drivers.lathe.stop import StopPath
from profiles.machine import MachineProfile
from profiles.problem import Problem

IN_PART = "link.line_in_part"  # code: a line did not arrive as it was sent, and part of it was executed
UNEXECUTED = frozenset(("link.line_differs", "link.line_unproven"))  # the same, and none of it was executed


class CommandPath:
    """The single path of commands to the controller. `has_moved`: whether a command that moves was ever sent.

    Without a `heartbeat` there is no watchdog: for tests only. Every method that queries or sends raises
    `LinkError` when the link breaks or is out of step.
    """

    def __init__(
        self,
        client: Controller,
        stop: StopPath,
        poller: Poller,
        heartbeat: Heartbeat | None,
        ownership: Ownership | None,
    ) -> None:
        self.has_moved = False
        self._client, self._stop, self._poller = client, stop, poller
        self._heartbeat, self._ownership = heartbeat, ownership

    def refuse_unless_owner(self) -> None:
        """Make sure that this console may command. Raises RefusedError: `owner.held`, `owner.observer`."""
        if self._ownership is not None:
            self._ownership.refuse_unless_owner()

    def refuse_unsafe(self) -> None:
        """Check the safety devices that the controller sees. Raises RefusedError: `safety.not_good`, with each."""
        if self._poller.sees_devices and (problems := device_problems(self._poller.look().inputs)):
            raise RefusedError(*problems)

    def refuse_moving(self) -> None:
        """Make sure that nothing moves. Raises RefusedError: `machine.moving`."""
        if self._poller.look().moving:
            raise RefusedError(self._problem("machine.moving"))

    def jog(self, line: str) -> None:
        """Send a jog with its watchdog; errors as for `move`."""
        self.move(line, None if self._heartbeat is None else self._heartbeat.jog)

    def move(self, line: str, guarded: Callable[[str], str] | None) -> None:
        """Send a motion command; the loops must be closed already, because the command must not close one.

        `guarded` prefixes the watchdog, once nothing prevents the command.

        Raises:
            RefusedError: `machine.not_enabled`, nothing was sent; and those of `send_once`. No watchdog is left
            armed.
        """
        try:
            if not self._poller.loops_closed and not self._poller.look().loops_closed:
                raise RefusedError(self._problem("machine.not_enabled"))
            self.send_once(line, guarded)
        except RefusedError:
            self._forgo()
            raise
        except ControllerError:
            self.end_watchdog()  # what stands before the command on its line was executed
            with suppress(DriverError):
                self._poller.look()  # a loop may have opened meanwhile: control-A would close it
            raise

    def send_once(self, line: str, guarded: Callable[[str], str] | None = None) -> None:
        """Send a line that moves or energises. A stop that overtook it is sent again after it.

        The stop is repeated as soon as the line has been sent, in case its reply does not come, and again when
        the controller has executed it. A stop before that keeps the line from being sent: resynchronising the
        link and the queries of `guarded` take time.

        Raises:
            StoppedError: before or after it.
            RefusedError: `machine.hands_in`, `session.frozen`, and those of `refuse_unless_owner` and
                `refuse_unsafe`; nothing was sent. `link.line_differs`, `link.line_unproven`: nothing was executed.
            LinkError: the link broke; `link.line_in_part`.
        """
        self._refuse_now()
        self.refuse_unsafe()
        if guarded is not None:
            line = guarded(line)  # this also reads who owns the machine
        self.has_moved = True
        self._poller.positions.forget()
        try:
            self._client.send(line, check=self._refuse_now, moves=True)
            if self._stop.reason is not None:
                self._stop.repeat()
            self._client.reply(line)
        except RefusedError as refused:
            self._forgo()
            if refused.problems[0].code in UNEXECUTED and self._poller.look().moving:
                self._stop.stop(IN_PART)  # one of its characters acted by itself
                raise LinkError(self._problem(IN_PART, line)) from refused
            raise
        except LinkError as error:
            if error.problems[0].code == IN_PART:
                self._stop.stop(IN_PART)
            self._poller.in_doubt()
            raise
        if self._stop.reason is not None:
            self._stop.repeat()
        self._stop.check()

    def end_watchdog(self) -> None:
        """Disarm the watchdog after a stop: the controller must not retract the tool by itself then.

        A link error here must not prevent the wait for rest; the controller then follows its policy for a lost
        host.
        """
        if self._heartbeat is not None:
            with suppress(DriverError):
                self._heartbeat.end_guarding(self._poller.quick_timeout_s)

    def _forgo(self) -> None:
        if self._heartbeat is not None:
            self._heartbeat.forgo()

    def _refuse_now(self) -> None:
        self._stop.check()
        self._stop.refuse_frozen()
        self.refuse_unless_owner()
        if self._stop.inside_guard:
            raise RefusedError(self._problem("machine.hands_in"))

    def _problem(self, code: str, key: str = "") -> Problem:
        return Problem(code=code, where=self._client.link.address, key=key)


@dataclass(frozen=True, slots=True, kw_only=True)
class Wiring:
    """One controller, and everything sent to it or read from it."""

    client: Controller
    machine: MachineProfile
    clock: Clock
    stop: StopPath
    heartbeat: Heartbeat | None
    ownership: Ownership | None
    poller: Poller
    sending: CommandPath
    tables: Tables
