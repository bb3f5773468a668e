"""Small cache of the last results, shared by two threads."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

Key = TypeVar("Key")
Value = TypeVar("Value")


class Kept(Generic[Key, Value]):
    """Cache of up to `most` values; the least recently used one is dropped first.

    Keys are compared, not hashed: a machine profile has tables in it.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._lock = threading.Lock()
        self._entries: list[tuple[Key, Value]] = []

    def find(self, key: Key) -> Value | None:
        """Return the value kept under an equal key."""
        with self._lock:
            for place in range(len(self._entries) - 1, -1, -1):
                if self._entries[place][0] == key:
                    entry = self._entries.pop(place)
                    self._entries.append(entry)
                    return entry[1]
            return None

    def keep(self, key: Key, value: Value) -> None:
        """Keep a value."""
        with self._lock:
            self._entries.append((key, value))
            del self._entries[: -self._most]
