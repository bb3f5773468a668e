"""All targets by name, in the order of the table, and the fuzzing of one: it can run in a process of its own."""

from __future__ import annotations

from collections.abc import Mapping

from tests.fuzz.guided import guide
from tests.fuzz.mutating import Outcome, mutate
from tests.fuzz.of_controller import OF_CONTROLLER
from tests.fuzz.of_feed import OF_FEED
from tests.fuzz.of_files import OF_FILES
from tests.fuzz.of_sockets import OF_SOCKETS
from tests.fuzz.target import Target

TARGETS: Mapping[str, Target] = {each.name: each for each in (*OF_CONTROLLER, *OF_FILES, *OF_FEED, *OF_SOCKETS)}


def fuzzed(name: str, *, inputs: int, seconds: float, seed: int, guided: bool) -> Outcome:
    """Fuzz a reader by coverage or by seeded mutations; return what came of it."""
    return (guide if guided else mutate)(TARGETS[name], inputs=inputs, seconds=seconds, seed=seed)
