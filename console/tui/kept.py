"""A small memory of what was computed last, which two threads may ask."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

Key = TypeVar("Key")
Value = TypeVar("Value")


class Kept(Generic[Key, Value]):
    """Remembers up to `most` values; the one that nobody asked for the longest time is forgotten first.

    Keys are compared, not hashed: a machine profile has tables in it.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._lock = threading.Lock()
        self._entries: list[tuple[Key, Value]] = []

    def find(self, key: Key) -> Value | None:
        """Return what was kept under an equal key."""
        with self._lock:
            for place in range(len(self._entries) - 1, -1, -1):
                if self._entries[place][0] == key:
                    entry = self._entries.pop(place)
                    self._entries.append(entry)
                    return entry[1]
            return None

    def keep(self, key: Key, value: Value) -> None:
        """Remember a value."""
        with self._lock:
            self._entries.append((key, value))
            del self._entries[: -self._most]
