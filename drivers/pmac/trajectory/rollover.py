"""Rotary axes A, B and C: which way round a motor goes to an absolute position (Ix27).

Source: Software Reference, Ix27. Above 0, counts a turn: the shorter way. Below 0: the sign of the commanded
position is the direction, and the move is less than a turn. Positions are counts of the motor.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from drivers.pmac.axes import AxisDefinition
from drivers.pmac.trajectory.pieces import Vector
from drivers.pmac.variables import VariableStore

ROTARY = frozenset("ABC")

ROUNDING = 1e-9
"""The share of a turn within which a motor already stands where it is sent."""


class Rollover:
    """Keeps the whole turns between what a program calls the position of a motor and where it is."""

    def __init__(self, definitions: Sequence[AxisDefinition], variables: VariableStore) -> None:
        self._rotary = [(k, d) for k, d in enumerate(definitions) if d.axis in ROTARY]
        self._variables = variables
        self._turns = {k: 0.0 for k, _ in self._rotary}  # counts

    def unfold(
        self, counts: Vector, here: Vector, targets: Mapping[str, float], absolute: frozenset[str]
    ) -> Vector:
        """Return where the motors are to go; `absolute` are the axes that were told a position."""
        unfolded = list(counts)
        for index, definition in self._rotary:
            turn = self._variables.motor(definition.motor, 27)
            if turn and definition.axis in absolute:
                forwards = (targets[definition.axis] >= 0.0) == (definition.scale > 0.0) if turn < 0.0 else None
                way = _way_round(counts[index] - here[index], abs(turn), forwards)
                self._turns[index] = here[index] + way - counts[index]
            unfolded[index] += self._turns[index]
        return tuple(unfolded)


def _way_round(distance: float, turn: float, forwards: bool | None) -> float:
    """Return the distance by the shorter way, or in a direction."""
    up = math.fmod(distance, turn)
    if up < 0.0:
        up += turn
    if up > (1.0 - ROUNDING) * turn:
        up -= turn  # it stands there, but for rounding
    if forwards is None:
        return up if up <= 0.5 * turn else up - turn
    if forwards or abs(up) <= ROUNDING * turn:
        return up
    return up - turn
