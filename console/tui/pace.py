"""Detection of typed keys: keys that come faster are one burst, which confirms, enables or moves nothing.

A barcode scanner, and a paste that is not marked as one, bring many keys within some milliseconds, followed by an
Enter. So an action is held back until it is known that nothing came close to it. A slow line may also bring two
typed keys in one piece: nothing happens then either, and they are pressed again. Stops are never held
back.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

APART_S = 0.04  # different keys closer together than this were not typed by a person, who needs some 60 ms
QUIET_S = 0.5  # dead time after a burst: a slow line may bring its Enter later than the rest
WRITTEN = 3  # this many characters in a row come from a scanner; two may be a fast hand, or a slow line
Held = TypeVar("Held")


class KeyPace(Generic[Held]):
    """Judge every key by its time, of any monotonic clock. The repeats of one key are no burst."""

    def __init__(self) -> None:
        self._held: list[tuple[float, Held]] = []
        self._name = ""
        self._heard_s = self._burst_s = float("-inf")
        self._written = 0

    def hear(self, name: str, now_s: float) -> bool:
        """Note a key, whatever becomes of it; return whether it belongs to a burst."""
        # A held action is not known to have been alone: the calling thread may be late.
        close = bool(self._held) or now_s - self._heard_s <= APART_S
        self._written = 0
        return self._note_key(name, now_s, burst=close and name != self._name)

    def write(self, name: str, now_s: float, *, character: bool) -> bool:
        """Note a key that belongs to a field; return whether a `character` of it was not typed."""
        soon = now_s - self._heard_s <= APART_S
        self._written = (self._written if soon else 0) + 1 if character else 0
        return self._note_key(name, now_s, burst=bool(self._held) or self._written >= WRITTEN)

    def _note_key(self, name: str, now_s: float, *, burst: bool) -> bool:
        if burst:
            self._held.clear()
            self._burst_s = now_s
        self._name, self._heard_s = name, now_s
        return burst

    def hold(self, name: str, held: Held, now_s: float) -> bool:
        """Hold an action until nothing came close to it; return whether it is part of a burst, and dropped."""
        if self.hear(name, now_s) or now_s - self._burst_s <= QUIET_S:
            return True
        self._held.append((now_s, held))
        return False

    def take_due_keys(self, now_s: float) -> list[Held]:
        """Return what was held back long enough, once all pending input was noted."""
        due = [held for at_s, held in self._held if now_s >= at_s + APART_S]
        del self._held[: len(due)]
        return due

    def wait_s(self, now_s: float, longest_s: float) -> float:
        """Return how long to wait for the next key: no longer than until something is due."""
        if not self._held:
            return longest_s
        return min(max(self._held[0][0] + APART_S - now_s, 0.0), longest_s)


ENDS = ("enter", "ctrl+j", "tab")  # CR, LF and Tab: what a scanner sends after its code
SHORTEST = 3  # characters; two may be a fast hand, or a slow line


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """What was scanned. `written`: it went into an entry; `stopped`: one of its characters was a stop."""

    text: str
    written: bool = False
    stopped: bool = False


class ScanCollector:
    """Collects what a scanner types, of any monotonic clock; it may arrive in pieces, with or without an end.

    What comes within `QUIET_S` after a burst counts for nothing, so it belongs to the same code.
    """

    def __init__(self) -> None:
        self._clear()
        self._last_s = float("-inf")

    def _clear(self) -> None:
        self._text, self._is_burst, self._is_code = "", False, True
        self._written = self._stopped = False

    def hear(
        self, key: str, character: str | None, now_s: float, *, burst: bool, written: bool, stopped: bool
    ) -> Scan | None:
        """Take a key that belongs to a `burst`, or may be the first of one; return the code that it ends."""
        code = None
        if not burst and now_s - self._last_s > (QUIET_S if self._is_burst else APART_S):
            code = self._end_scan()
        self._last_s = now_s
        self._is_burst = self._is_burst or burst
        self._written, self._stopped = self._written or written, self._stopped or stopped
        if key in ENDS:
            return code or self._end_scan()
        if character is None or not character.isprintable():
            self._is_code = False  # an arrow or a function key is no part of a code
        else:
            self._text += character
        return code

    def take_due_scan(self, now_s: float) -> Scan | None:
        """Return a code that has no end, once nothing of it has come for a while."""
        return self._end_scan() if self._is_burst and now_s - self._last_s > QUIET_S else None

    def _end_scan(self) -> Scan | None:
        whole = self._is_burst and self._is_code and len(self._text) >= SHORTEST
        scan = Scan(text=self._text, written=self._written, stopped=self._stopped) if whole else None
        self._clear()
        return scan
