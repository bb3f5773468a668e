"""Poll the machine: one request per poll, with the watchdog renewal before it when due.

Each poll updates the stop path with the drive state, because the right stop depends on it.

`Snapshot` is a module of its own: the first picture is painted from one before a controller is known.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from types import MappingProxyType

from drivers.clock import Clock
from drivers.controller import REPLY_TIMEOUT_S, Controller
from drivers.cutting.watch_table import CutWatch, WatchItem, values_of
from drivers.errors import DriverError, LinkError, out_of_step
from drivers.lathe.console_role import ConsoleRole
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.held_positions import HeldPositions
from drivers.lathe.ownership import Ownership
from drivers.lathe.safety import inputs_of
from drivers.lathe.snapshot import AxisState, Snapshot, driven_axes
from drivers.lathe.stop import StopPath
from drivers.link.base import is_gone
from drivers.pmac import reserved
from drivers.pmac.dialect import Dialect
from drivers.pmac.expected_replies import number_of
from drivers.pmac.status import decode
from profiles.machine import MachineProfile
from profiles.problem import Problem

POLL_TIMEOUT_S = 0.3  # timeout for the reply to a poll: during a cut nothing else reports a fault
QUICK_TIMEOUT_S = 0.17
"""Minimum reply timeout under a watchdog, whose renewal must not wait for more than one retry, and while rest is
being proven: the next repetition of the stop must not wait."""

READING_S = 0.02
"""How long a reading beside the polls of a cut may take: within their pause. On a slow line it is one item."""

SLOW_LINE_S = 0.05  # where a poll takes longer, a program is not asked for its line: watchdog and polls come first


class SnapshotItems:
    """The items of one request: each motor, the program, the console's words, the safety inputs."""

    def __init__(self, machine: MachineProfile, dialect: Dialect) -> None:
        """Read the inputs that the profile names. Raises DriverError: `safety.bad_input`."""
        self.driven = driven_axes(machine)
        self.inputs = inputs_of(machine.safety)
        # The same words come again in most polls, and their meaning depends on nothing else.
        self._motor_flags = lru_cache(maxsize=256)(partial(decode, table=dialect.motor_bits))
        self._system_flags = lru_cache(maxsize=256)(partial(decode, table=dialect.system_bits))
        self._axis, self._number = lru_cache(maxsize=64)(self._axis_of), lru_cache(maxsize=64)(number_of)
        self._inputs = lru_cache(maxsize=64)(self._inputs_of)
        self.items = (
            *(item for motor in machine.motors for item in (f"#{motor}P", "F", "?")),
            "&1??",
            "%",
            f"P{reserved.OWNER}",
            f"P{reserved.LOST}",
            *dict.fromkeys(each.item for each in self.inputs),
        )

    def read(self, replies: Sequence[str], asked_s: float, at_s: float, where: str) -> Snapshot:
        """Make a snapshot of the replies to `items`. Raises LinkError: `link.out_of_step`."""
        try:
            tool, spindle, carriage = (self._axis(*replies[start : start + 3]) for start in (0, 3, 6))
            status, override, owner, lost, *words = replies[9:]
            system = self._system_flags(status)
            return Snapshot(
                asked_s=asked_s,
                at_s=at_s,
                tool=tool,
                spindle=spindle,
                carriage=carriage,
                program_running="running_program" in system,
                runtime_error="runtime_error" in system,
                driven=self.driven,
                owner=int(self._number(owner)),
                lost=int(self._number(lost)),
                override_percent=self._number(override),
                inputs=self._inputs(*words),
            )
        except ValueError as error:
            raise out_of_step(where, " ".join(self.items), str(error)) from error

    def _axis_of(self, position: str, error: str, status: str) -> AxisState:
        axis = AxisState(number_of(position), number_of(error), self._motor_flags(status))
        if "open_loop" in axis.flags:  # then the controller reports no desired velocity
            return replace(axis, flags=axis.flags | {"desired_velocity_zero"})
        return axis

    def _inputs_of(self, *words: str) -> Mapping[str, bool]:
        items = dict.fromkeys(each.item for each in self.inputs)
        actual = {item: int(number_of(word)) for item, word in zip(items, words, strict=True)}
        good: dict[str, bool] = {}
        for each in self.inputs:  # a device with two contacts is safe when both are
            good[each.device] = good.get(each.device, True) and each.is_good(actual[each.item])
        return MappingProxyType(good)


class Poller:
    """The polled state of the controller.

    `last` is the last successful poll. `loops_closed` is whether the last poll saw every driven axis in closed
    loop, False when it failed. `verified` is set by the code that has compared the controller with its profile.
    `round_trip_s` is the duration of the last poll. `positions` judges whether axes stay where they were left.
    `watched` is what shapes the cut that runs; `changed` is the first of it that was no longer as at its start.
    """

    def __init__(
        self,
        client: Controller,
        clock: Clock,
        stop: StopPath,
        items: SnapshotItems,
        positions: HeldPositions,
        *,
        seen: Callable[[Snapshot], None] | None = None,
        heartbeat: Heartbeat | None = None,
        ownership: Ownership | None = None,
    ) -> None:
        """`seen` is called with each poll; it must return at once and not raise."""
        self.last: Snapshot | None = None
        self.loops_closed = False
        self.verified = False
        self.round_trip_s = 0.0
        self.positions = positions
        self.watched: CutWatch | None = None
        self.changed: Problem | None = None
        self._poll_bytes = 0
        self._client, self._clock, self._stop, self._items = client, clock, stop, items
        self._seen, self._heartbeat, self._ownership = seen, heartbeat, ownership

    @property
    def address(self) -> str:
        """The address of the polled link."""
        return self._client.link.address

    @property
    def line(self) -> str:
        """The line of a poll, without the watchdog renewal before it."""
        return " ".join(self._items.items)

    @property
    def sees_devices(self) -> bool:
        """Whether a poll includes safety devices."""
        return bool(self._items.inputs)

    def in_doubt(self) -> None:
        """Mark the drive state as unknown, so that the stop does not rely on it."""
        self._stop.loops_closed = self.loops_closed = False

    def look(self) -> Snapshot:
        """Read the state of the machine in one request; retry once without a complete reply.

        Raises:
            DriverError: `heartbeat.lapsed`, this host was silent so long that the controller ended the motion.
            LinkError: the link broke or is out of step.
        """
        try:
            return self.poll_once(self._first_timeout_s)
        except LinkError as error:
            if is_gone(error):
                raise
            return self.poll_once(POLL_TIMEOUT_S)

    @property
    def _is_ours(self) -> bool:
        return self._ownership is None or self._ownership.standing is ConsoleRole.OWNER

    @property
    def quick_timeout_s(self) -> float:
        """Reply timeout of a poll where the next try must not wait; longer on a slow line."""
        return min(max(QUICK_TIMEOUT_S, 2.0 * self.round_trip_s), POLL_TIMEOUT_S)

    @property
    def _first_timeout_s(self) -> float:
        guarding = self._heartbeat is not None and self._heartbeat.guarding
        return self.quick_timeout_s if guarding else POLL_TIMEOUT_S

    def poll_once(self, timeout_s: float) -> Snapshot:
        """Read the state of the machine in one request; errors as for `look`."""
        # After a stop nothing of ours continues.
        line = self._renewing(*self._items.items) if self._stop.reason is None else " ".join(self._items.items)
        asked_s = self._clock.now_s()
        try:
            replies = self._client.request(line, timeout_s, lines=len(self._items.items))
            at_s = self._clock.now_s()
            read = self._items.read(replies, asked_s, at_s, self._client.link.address)
        except DriverError:
            self.in_doubt()
            raise
        if self._ownership is not None:
            self._ownership.see(read.owner)
        snapshot = self.positions.judge_poll(read, ours=self._is_ours)
        # The same control-A would close a motor that is not ours, so that must be known, too.
        self._stop.loops_closed = snapshot.nothing_open and self.verified
        self.last = snapshot
        self.loops_closed = snapshot.loops_closed
        self.round_trip_s = at_s - asked_s
        self._poll_bytes = len(line) + sum(map(len, replies)) + len(replies)
        if self._seen is not None:
            self._seen(snapshot)
        return snapshot

    def read_beside(self) -> None:
        """Read some of the settings that shape the running cut, in the pause between two polls, and judge them.

        Its line is never longer than that of a poll, so a stop has not to wait longer. At the end of the feed it
        takes as long as a poll, too. An unanswered reading is left to the next turn: the next poll reports a bad
        line. Errors as for `look`.
        """
        watched = self.watched
        if watched is None or self._stop.reason is not None:
            return
        pause_bytes = self._poll_bytes * READING_S / max(self.round_trip_s, 1e-6)
        items = watched.next_items(
            max(pause_bytes, self._poll_bytes) if watched.at_end else pause_bytes, len(self.line)
        )
        try:
            self._read_watched(watched, items, self._first_timeout_s)
        except LinkError as error:
            if is_gone(error):
                raise

    def finish_watch(self) -> None:
        """Read the rest of the last turn, at rest. Raises DriverError: what differed, or the link broke."""
        watched = self.watched
        while watched is not None and watched.at_end and self.changed is None:
            self._read_watched(watched, watched.next_items(math.inf), REPLY_TIMEOUT_S)
        if self.changed is not None:
            raise DriverError(self.changed)

    def _read_watched(self, watched: CutWatch, items: tuple[WatchItem, ...], timeout_s: float) -> None:
        line = self._renewing(*(item.query for item in items))
        found = watched.see(items, self._client.request(line, timeout_s, lines=values_of(items)))
        self.changed = self.changed or found

    def _renewing(self, *items: str) -> str:
        """Return a line that queries `items`, with the watchdog renewal before them when something is guarded."""
        watchdog = "" if self._heartbeat is None else self._heartbeat.renewal()
        return " ".join((watchdog, *items)).lstrip()
