"""Key releases, where the terminal reports them: asked for, confirmed, and given back.

The keyboard protocol of kitty, which several terminals speak and which passes SSH, reports the press, each repeat
and the release of a key. Nothing is concluded from a terminal's name: it is asked what it does, told to report,
and asked again; releases are in force only while its answers say that it reports them, and come soon. The thread
of the screen asks, that which reads the terminal hears; no field is written by both. Times are of any one
monotonic clock.
"""

from __future__ import annotations

from dataclasses import dataclass

from textual import events

QUERY = "\x1b[?u"
PLAIN, WITH_RELEASES = 0b11001, 0b11011  # Textual's own flags; with event types (2)
ON, OFF = f"\x1b[={WITH_RELEASES};1u", f"\x1b[={PLAIN};1u"  # set, not pushed: what ends the screen pops both
NEEDED = 0b01010  # event types (2), and all keys as sequences (8), without which some have no release
SLOWEST_S = 0.15  # round trip of a terminal beyond which a release comes too late to be used
ASKED_AGAIN_S = 2.0


@dataclass(frozen=True, slots=True)
class Stroke:
    """What a terminal says of a key: whether it repeats, and how many releases came before it."""

    repeated: bool
    releases: int


class ReportedKey(events.Key):
    """A key of which the terminal says whether a finger pressed it, or it repeats."""

    def __init__(self, key: str, character: str | None, stroke: Stroke) -> None:
        super().__init__(key, character)
        self.stroke = stroke


ReportedKey.handler_name = events.Key.handler_name  # so that key handlers receive it


class KeyReleases:
    """`count` releases were heard; `round_trip_s` is that of the last answer, None before the first.

    `late`: the last question waits for its answer for longer than `SLOWEST_S`.
    """

    def __init__(self) -> None:
        self.count = 0
        self.round_trip_s: float | None = None
        self.late = False
        self._flags: int | None = None
        self._asked = self._answers = 0
        self._asked_s = 0.0
        self._set_at: int | None = None  # the question that was asked with the present setting

    @property
    def understood(self) -> bool:
        """Whether a release is to be expected: this terminal has answered, so that one may still be on its way."""
        return self._flags is not None

    @property
    def confirmed(self) -> bool:
        """Whether the terminal has said that it reports releases, and was not told otherwise since."""
        return self._set_at is not None and self._answers >= self._set_at and (self._flags or 0) & NEEDED == NEEDED

    @property
    def is_slow(self) -> bool:
        """Whether the terminal reports releases, but answers so late that they are of no use."""
        return self.confirmed and (self.late or (self.round_trip_s or 0.0) > SLOWEST_S)

    @property
    def in_force(self) -> bool:
        """Whether a release may be relied on."""
        return self.confirmed and not self.is_slow

    def ask(self, wanted: bool, now_s: float) -> str:
        """Return what to write to the terminal now so that releases are reported, or not; mostly nothing."""
        if not wanted:
            was_set, self._set_at = self._set_at is not None, None
            return OFF if was_set else ""
        waits = self._asked > self._answers
        self.late = waits and now_s - self._asked_s > SLOWEST_S
        if not self.understood:
            return "" if waits else self._question(now_s)
        if self._set_at is None:
            self._set_at = self._asked + 1
            return ON + self._question(now_s)
        again = not waits and self.confirmed and now_s - self._asked_s > ASKED_AGAIN_S
        return self._question(now_s) if again else ""

    def take_answer(self, flags: int, now_s: float) -> bool:
        """Take an answer; return False where nothing was asked."""
        if self._answers >= self._asked:
            return False
        self._flags = flags
        if self._answers + 1 == self._asked:  # else of an earlier question, whose time is not known any more
            self.round_trip_s = now_s - self._asked_s
        self._answers += 1
        return True

    def _question(self, now_s: float) -> str:
        self._asked_s = now_s
        self._asked += 1
        return QUERY
