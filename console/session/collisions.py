"""What the tool of a simulated lathe has run into, as problems for the operator."""

from __future__ import annotations

from collections.abc import Iterable

from drivers.simulator.plant.collision import CollisionKind
from profiles.problem import Problem

_CODES = {
    CollisionKind.STANDING_PART: "simulator.met_standing_part",
    CollisionKind.END_FACE: "simulator.met_end_face",
    CollisionKind.TOO_DEEP: "simulator.met_too_deep",
    CollisionKind.THROUGH_WALL: "simulator.met_through_wall",
    CollisionKind.JAWS: "simulator.met_jaws",
    CollisionKind.INFEED: "simulator.met_infeed",
    CollisionKind.REVERSE: "simulator.met_reverse",
    CollisionKind.END_OF_TRAVEL: "simulator.met_end_of_travel",
}

COLLISION_CODES = tuple(_CODES.values())


def collision_problems(kinds: Iterable[str]) -> tuple[Problem, ...]:
    """Return a problem for each kind of collision that was seen at the chuck."""
    return tuple(Problem(code=_CODES[CollisionKind(kind)]) for kind in kinds)
