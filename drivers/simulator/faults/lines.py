"""What lies between the card and its hosts: nothing, or what faults make of it; the same for every host."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random

from drivers.simulator.faults.carrying import Carry, Piece, combine
from drivers.simulator.faults.spoiling import Reply, Spoil


@dataclass(slots=True, eq=False, kw_only=True)
class Chance:
    """Which replies a fault hits: a `share` of them, drawn in the order in which they leave, and `left` in all."""

    random: Random
    share: float = 1.0
    left: float = math.inf

    def hits(self) -> bool:
        """Draw whether the next one is hit."""
        return self.left > 0 and self.random.random() < self.share

    def count(self) -> None:
        """One was changed by it; what a fault can do nothing to does not count."""
        self.left -= 1


@dataclass(slots=True, eq=False, kw_only=True)
class Spoiler:
    """A fault that spoils replies."""

    spoil: Spoil
    chance: Chance


@dataclass(slots=True, eq=False, kw_only=True)
class Carrier:
    """A fault that holds bytes up; those of hosts, too, if it is `both_ways`."""

    carry: Carry
    chance: Chance
    both_ways: bool = False


@dataclass(slots=True, eq=False, kw_only=True)
class Garbling:
    """A fault that makes another line of the next one that has a text in it; it is `over` then."""

    find: bytes
    replace: bytes
    over: bool = False

    def of(self, line: bytes) -> bytes:
        """Return what the card reads where a host has sent a line."""
        if self.over or self.find not in line:
            return line
        self.over = True
        return line.replace(self.find, self.replace, 1)


@dataclass(slots=True, eq=False, kw_only=True)
class Lines:
    """The state of all lines.

    `cut` is whether no host can be connected, `hung` whether the card neither reads nor answers, `dead` whether it
    is shut down, `slow` whether it looks at its hosts in its background cycle only. `clearings` counts how often
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
        """Whether the card is not to be heard, whatever is sent."""
        return self.hung or self.dead

    def read(self, line: bytes) -> bytes:
        """Return what the card reads where a host has sent a line."""
        for garbling in self.garblings:
            line = garbling.of(line)
        return line

    def spoiled(self, reply: Reply) -> bytes:
        """Return what is left of a reply."""
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
