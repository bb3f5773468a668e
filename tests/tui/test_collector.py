"""What garbage collection costs a stop: a full one stops every thread, the one that reads the keys too."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from console.tui.app import Collector

OBJECTS = 100_000
AS_BUILT = (700, 10, 10)
"""The thresholds of an interpreter; those of the tests are others."""


@pytest.fixture
def full() -> Iterator[Callable[[], int]]:
    """Count the full collections, in a process that is left as it was."""
    thresholds, enabled, seen = gc.get_threshold(), gc.isenabled(), []

    def note(phase: str, facts: dict[str, Any]) -> None:
        if phase == "start" and facts["generation"] == 2:
            seen.append(facts)

    gc.callbacks.append(note)
    gc.set_threshold(*AS_BUILT)
    gc.enable()
    yield lambda: len(seen)
    gc.callbacks.remove(note)
    gc.set_threshold(*thresholds)
    gc.unfreeze()
    (gc.enable if enabled else gc.disable)()


def test_nothing_old_is_collected_while_something_may_move(full: Callable[[], int]) -> None:
    collector = Collector()
    collector.spare(True)
    kept = [[number] for number in range(OBJECTS)]
    assert full() == 0
    collector.spare(False)
    kept += [[number] for number in range(len(kept))]
    assert full() > 0


def test_young_garbage_is_collected_while_something_may_move(full: Callable[[], int]) -> None:
    collector = Collector()
    collector.spare(True)
    before = len(gc.get_objects())
    for _ in range(OBJECTS // 10):
        circle: list[Any] = []
        circle.append(circle)
    assert len(gc.get_objects()) < before + OBJECTS // 20
    collector.spare(False)
