"""A key for what was computed of two values that are never changed: the very same objects give the same result."""

from __future__ import annotations

from typing import Generic, TypeVar

One = TypeVar("One")
Other = TypeVar("Other")


class SameObjects(Generic[One, Other]):
    """Equal to another key of the very same objects. It keeps them alive, so that none takes their place."""

    __slots__ = ("one", "other")

    def __init__(self, one: One, other: Other) -> None:
        self.one, self.other = one, other

    def __hash__(self) -> int:
        return hash((id(self.one), id(self.other)))

    def __eq__(self, key: object) -> bool:
        return isinstance(key, SameObjects) and self.one is key.one and self.other is key.other
