"""The lines between the controller and its hosts, with the effects of faults.

`Lines` is the same for every host; each has its own `Outbox` and a `Carriage` for each direction.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from random import Random

from drivers.simulator.faults.line_effects import Carry, Piece, Reply, Spoil, combine, schedule


@dataclass(slots=True, eq=False, kw_only=True)
class Chance:
    """Random selection of the replies that a fault changes: a `fraction` of them, in order, and `left` in all."""

    random: Random
    fraction: float = 1.0
    left: float = math.inf

    def hits(self) -> bool:
        """Draw whether the next one is hit."""
        return self.left > 0 and self.random.random() < self.fraction


@dataclass(slots=True, eq=False, kw_only=True)
class Spoiler(Chance):
    """A fault that spoils replies."""

    spoil: Spoil


@dataclass(slots=True, eq=False, kw_only=True)
class Carrier(Chance):
    """A fault that delays bytes; also those of hosts, if it is `both_ways`."""

    carry: Carry
    both_ways: bool = False


@dataclass(slots=True, eq=False, kw_only=True)
class Garbling:
    """A fault that alters the next line with text in it; it is `over` then."""

    find: bytes
    replace: bytes
    over: bool = False


@dataclass(slots=True, eq=False, kw_only=True)
class Lines:
    """The state of all lines.

    `cut` is whether no host can connect, `hung` whether the controller neither reads nor replies, `dead` whether
    it is shut down, `slow` whether it serves its hosts in its background cycle only. `clearings` counts how often
    all faults were ended.
    """

    now_s: Callable[[], float]
    cut: bool = False
    hung: bool = False
    dead: bool = False
    slow: bool = False
    clearings: int = 0
    spoilers: list[Spoiler] = field(default_factory=list)
    carriers: list[Carrier] = field(default_factory=list)
    garblings: list[Garbling] = field(default_factory=list)

    @property
    def silent(self) -> bool:
        """Whether the controller sends nothing, whatever it receives."""
        return self.hung or self.dead

    def read(self, line: bytes) -> bytes:
        """Return the line as the controller reads it."""
        for garbling in self.garblings:
            if not garbling.over and garbling.find in line:
                garbling.over = True
                line = line.replace(garbling.find, garbling.replace, 1)
        return line

    def spoiled(self, reply: Reply) -> bytes:
        """Return a reply as the faults leave it."""
        for spoiler in self.spoilers:
            if spoiler.hits() and (spoilt := spoiler.spoil(reply)).sent != reply.sent:
                reply = spoilt
                spoiler.left -= 1
        return reply.sent

    def carried(self, said: bytes, *, inward: bool) -> list[Piece]:
        """Return the pieces in which bytes arrive."""
        pieces = [Piece(data=said)]
        for carrier in self.carriers:
            if (carrier.both_ways or not inward) and carrier.hits():
                carried = combine(pieces, carrier.carry)
                if carried != pieces:
                    pieces = carried
                    carrier.left -= 1
        return pieces


class Outbox:
    """The controller's output to one host, a unit for each reply or message; faults have already been applied."""

    def __init__(self, lines: Lines) -> None:
        self._lines = lines
        self._units: list[bytes] = []
        self._begun = bytearray()
        self.waiting = 0

    def say(self, said: bytes) -> None:
        """Add output that answers no line."""
        self._units.append(said)
        self.waiting += len(said)

    def begin(self, data: bytes) -> None:
        """Add data of a reply whose end is still to come; where replies are spoiled it waits for that."""
        if self._lines.spoilers or self._begun:
            self._begun += data
        else:
            self.say(data)

    def reply(self, data: bytes = b"", end: bytes = b"", checksum: bytes = b"", *, summed: bool = False) -> None:
        """Add a reply, or the end of the one that has begun."""
        if self._begun:
            data = bytes(self._begun) + data
            self._begun.clear()
        said = data + end + checksum
        if said and self._lines.spoilers:
            said = self._lines.spoiled(Reply(data=data, end=end, checksum=checksum, summed=summed))
        if said:
            self.say(said)

    def take(self) -> list[bytes]:
        """Return and clear the output."""
        if not self._units:
            return []
        units, self._units = self._units, []
        self.waiting = 0
        return units

    def forget(self) -> None:
        """Discard the pending output."""
        self.take()
        self._begun.clear()


class Carriage:
    """One direction of a line, with the bytes in transit, in order; without faults all arrives at once."""

    def __init__(self, lines: Lines, *, inward: bool) -> None:
        """`inward` is the direction from the host to the controller."""
        self._lines = lines
        self._inward = inward
        self._in_transit: deque[tuple[float, bytes]] = deque()
        self._last_s = 0.0
        self._clearings = lines.clearings
        self.waiting = 0

    @property
    def clear(self) -> bool:
        """Whether all arrives at once."""
        return not (self._in_transit or self._lines.carriers or self._lines.silent)

    def carry(self, units: Iterable[bytes]) -> list[bytes]:
        """Send units of bytes; return what has arrived by now, each item in one go."""
        if self.clear:
            return [unit for unit in units if unit]
        lines, now_s = self._lines, self._lines.now_s()
        if self._clearings != lines.clearings:
            # All faults were ended: what was in transit then arrives at once.
            self._clearings, self._last_s = lines.clearings, 0.0
            self._in_transit = deque((0.0, data) for _, data in self._in_transit)
        for unit in filter(None, units):
            arrivals = schedule(lines.carried(unit, inward=self._inward), now_s, self._last_s)
            self._last_s = arrivals[-1][0]
            self._in_transit.extend(arrivals)
            self.waiting += len(unit)
        arrived: list[bytes] = []
        while self._in_transit and self._in_transit[0][0] <= now_s and not lines.silent:
            arrived.append(self._in_transit.popleft()[1])
            self.waiting -= len(arrived[-1])
        return arrived

    def forget(self) -> None:
        """Discard the bytes in transit."""
        self._in_transit.clear()
        self._last_s, self.waiting = 0.0, 0
