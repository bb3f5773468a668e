"""The keys of a burst, put together to what was scanned. They have done nothing; `pace.py` has seen to that."""

from __future__ import annotations

from dataclasses import dataclass

from console.tui.pace import APART_S, QUIET_S

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
