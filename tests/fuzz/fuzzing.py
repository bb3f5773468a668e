"""The fuzzing of one reader, by coverage or by seeded mutations; it can run in a process of its own."""

from __future__ import annotations

from tests.fuzz.all_targets import TARGETS
from tests.fuzz.guided import guide
from tests.fuzz.mutating import Outcome, mutate


def fuzzed(name: str, *, inputs: int, seconds: float, seed: int, guided: bool) -> Outcome:
    """Return what came of it."""
    return (guide if guided else mutate)(TARGETS[name], inputs=inputs, seconds=seconds, seed=seed)
