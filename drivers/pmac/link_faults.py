"""Link faults counted by kind, as an immutable value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum, auto
from types import MappingProxyType


class FaultKind(StrEnum):
    """What a client received instead of the expected reply."""

    SILENT = auto()
    """Nothing came in time."""
    UNFINISHED = auto()
    """Data came, but neither an ACK nor an error number after it."""
    NUL = auto()
    BARE_BELL = auto()
    """A refusal without a number: I6 is not 1, or the number was lost."""
    HANDSHAKE = auto()
    """A reply in the form of other settings (I3, I6): the controller was reset, or another client has set them."""
    GARBLED = auto()
    """Bytes that no controller sends in this place, such as a checksum."""
    LINE_COUNT = auto()
    """More or fewer lines of data than the request asks for."""
    UNASKED = auto()
    """Input that belongs to no request: a late reply, a message or an error of a program."""
    ABANDONED = auto()
    """A request was sent before the previous reply had been read."""
    DIFFERS = auto()
    """The checksum of a line in transit differed from that of the line sent."""
    LOST = auto()
    """The link itself is lost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """The number of faults of one kind, and time (machine time, s) and line of the last one."""

    count: int
    last_s: float
    line: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkFaults:
    """All faults of a client since it was created."""

    seen: Mapping[FaultKind, Seen] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def total(self) -> int:
        """The number of faults of all kinds."""
        return sum(each.count for each in self.seen.values())

    def count(self, kind: FaultKind) -> int:
        """Return the number of faults of one kind."""
        return self.seen[kind].count if kind in self.seen else 0

    def with_another(self, kind: FaultKind, at_s: float, line: str) -> LinkFaults:
        """Return a copy with one more fault."""
        another = Seen(count=self.count(kind) + 1, last_s=at_s, line=line)
        return LinkFaults(seen=MappingProxyType({**self.seen, kind: another}))
