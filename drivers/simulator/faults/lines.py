"""The lines between the controller and its hosts, with the effects of faults; the same for every host."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random

from drivers.simulator.faults.carrying import Carry, Piece, combine
from drivers.simulator.faults.spoiling import Reply, Spoil


@dataclass(slots=True, eq=False, kw_only=True)
class Chance:
    """Random selection of the replies that a fault hits: the fraction `share`, in order, and `left` in all."""

    random: Random
    share: float = 1.0
    left: float = math.inf

    def hits(self) -> bool:
        """Draw whether the next one is hit."""
        return self.left > 0 and self.random.random() < self.share

    def count(self) -> None:
        """Count a reply that was changed; replies that a fault cannot affect do not count."""
        self.left -= 1


@dataclass(slots=True, eq=False, kw_only=True)
class Spoiler:
    """A fault that spoils replies."""

    spoil: Spoil
    chance: Chance


@dataclass(slots=True, eq=False, kw_only=True)
class Carrier:
    """A fault that delays bytes; also those of hosts, if it is `both_ways`."""

    carry: Carry
    chance: Chance
    both_ways: bool = False


@dataclass(slots=True, eq=False, kw_only=True)
class Garbling:
    """A fault that alters the next line with text in it; it is `over` then."""

    find: bytes
    replace: bytes
    over: bool = False

    def of(self, line: bytes) -> bytes:
        """Return the line as the controller reads it."""
        if self.over or self.find not in line:
            return line
        self.over = True
        return line.replace(self.find, self.replace, 1)


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
            line = garbling.of(line)
        return line

    def spoiled(self, reply: Reply) -> bytes:
        """Return a reply as the faults leave it."""
        for spoiler in self.spoilers:
            if spoiler.chance.hits() and (spoilt := spoiler.spoil(reply)).sent != reply.sent:
                reply = spoilt
                spoiler.chance.count()
        return reply.sent

    def carried(self, said: bytes, *, inward: bool) -> list[Piece]:
        """Return the pieces in which bytes arrive."""
        pieces = [Piece(data=said)]
        for carrier in self.carriers:
            if (carrier.both_ways or not inward) and carrier.chance.hits():
                carried = combine(pieces, carrier.carry)
                if carried != pieces:
                    pieces = carried
                    carrier.chance.count()
        return pieces
