"""The line of one host: the controller's output on it, and the bytes in transit."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from drivers.simulator.faults.carrying import schedule
from drivers.simulator.faults.lines import Lines
from drivers.simulator.faults.spoiling import Reply


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
        self._on_the_way: deque[tuple[float, bytes]] = deque()
        self._last_s = 0.0
        self._clearings = lines.clearings
        self.waiting = 0

    @property
    def clear(self) -> bool:
        """Whether all arrives at once."""
        return not (self._on_the_way or self._lines.carriers or self._lines.silent)

    def carry(self, units: Iterable[bytes]) -> list[bytes]:
        """Send units of bytes; return what has arrived by now, each item in one go."""
        if self.clear:
            return [unit for unit in units if unit]
        if self._clearings != self._lines.clearings:
            self._hurry()
        self._put(units)
        return self._arrived()

    def forget(self) -> None:
        """Discard the bytes in transit."""
        self._on_the_way.clear()
        self._last_s, self.waiting = 0.0, 0

    def _hurry(self) -> None:
        """Deliver the bytes that were in transit when all faults were ended."""
        self._clearings, self._last_s = self._lines.clearings, 0.0
        self._on_the_way = deque((0.0, data) for _, data in self._on_the_way)

    def _put(self, units: Iterable[bytes]) -> None:
        now_s = self._lines.now_s()
        for unit in units:
            if not unit:
                continue
            pieces = self._lines.carried(unit, inward=self._inward)
            arrivals = schedule(pieces, now_s, self._last_s)
            self._last_s = arrivals[-1][0]
            self._on_the_way.extend(arrivals)
            self.waiting += len(unit)

    def _arrived(self) -> list[bytes]:
        if not self._on_the_way or self._lines.silent:
            return []
        now_s = self._lines.now_s()
        arrived: list[bytes] = []
        while self._on_the_way and self._on_the_way[0][0] <= now_s:
            arrived.append(self._on_the_way.popleft()[1])
            self.waiting -= len(arrived[-1])
        return arrived
