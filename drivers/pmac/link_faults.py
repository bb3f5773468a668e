"""What went wrong on a link, counted by kind; a value that is replaced, never changed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum, auto
from types import MappingProxyType


class FaultKind(StrEnum):
    """What a client has met instead of the reply that it expected."""

    SILENT = auto()
    """Nothing came in time."""
    UNFINISHED = auto()
    """Something came, but neither an ACK nor an error number behind it."""
    NUL = auto()
    BARE_BELL = auto()
    """A refusal without a number: I6 is not 1, or the number was lost."""
    HANDSHAKE = auto()
    """A reply as other settings (I3, I6) word it: the card was reset, or somebody has set them."""
    GARBLED = auto()
    """Bytes that no controller sends there, such as a checksum."""
    LINE_COUNT = auto()
    """More or fewer lines of data than the request asks for."""
    UNASKED = auto()
    """Something came that belongs to no request: a late reply, a text or an error of a program."""
    ABANDONED = auto()
    """A request was sent while nobody had taken the reply to the one before."""
    DIFFERS = auto()
    """The checksum of a line that was on its way was another than that of what was sent."""
    LOST = auto()
    """The link itself is gone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """How often a kind of fault was met, and when and with which line for the last time (machine time, s)."""

    count: int
    last_s: float
    line: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkFaults:
    """All faults that a client has met since it was made."""

    seen: Mapping[FaultKind, Seen] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def total(self) -> int:
        """How many there were of all kinds."""
        return sum(each.count for each in self.seen.values())

    def count(self, kind: FaultKind) -> int:
        """Return how many there were of one kind."""
        return self.seen[kind].count if kind in self.seen else 0

    def with_another(self, kind: FaultKind, at_s: float, line: str) -> LinkFaults:
        """Return these and one more."""
        another = Seen(count=self.count(kind) + 1, last_s=at_s, line=line)
        return LinkFaults(seen=MappingProxyType({**self.seen, kind: another}))
