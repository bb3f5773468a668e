"""From axes to motors: the effect of axis definitions and I-variables on the motors of a program.

Every vector is in the order of the definitions. Rotary axes (A, B, C) roll over by Ix27: above 0, counts per turn,
a motor goes the shorter way to an absolute position; below 0 the sign of the commanded position is the direction,
and the move is less than a turn. Source: Software Reference, Ix27. Positions are counts of the motor.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from drivers.pmac.axes import AXIS_LETTERS, AxisDefinition, axis_positions, solver_of
from drivers.pmac.dialect import FamilySetting
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.requests import CircleRequest
from drivers.pmac.trajectory.circle import Arc, arc_of
from drivers.pmac.trajectory.jog import JogSettings, jog_settings
from drivers.pmac.trajectory.linear import Limits
from drivers.pmac.trajectory.pieces import Vector
from drivers.pmac.variables import VariableStore

ROTARY = frozenset("ABC")

ROUNDING = 1e-9  # The fraction of a turn within which a motor counts as already in position

FARTHEST_COUNTS = 2.0**47 / (96 * 32)
"""Positions are 48 bits wide, in units of 1/(32 Ix08) count; the factory's Ix08 is 96."""

NO_AXES: frozenset[str] = frozenset()


class MotorFrame:
    """The motors of a coordinate system, as the moves of its program see them.

    What is beyond the registers of the controller is refused, PmacError 003.
    """

    def __init__(self, definitions: tuple[AxisDefinition, ...], variables: VariableStore, system: int) -> None:
        self.definitions = definitions
        self.still: Vector = tuple(0.0 for _ in definitions)
        self._variables = variables
        self._system = system
        self._motors = tuple(d.motor for d in definitions)
        self._none = Limits(velocity=self.still, acceleration=self.still)
        self._limits, self._limits_revision = self._none, -1
        single = all(len(d.terms) == 1 for d in definitions)
        self._single = tuple((d.axis, d.scale, d.offset) for d in definitions) if single else None
        rotary = any(ROTARY & set(d.axes) for d in definitions)
        self._rollover = Rollover(definitions, variables) if rotary else None
        self._inverse = tuple([d.motor for d in definitions if d.inverse])
        self._solver = solver_of(definitions)

    def counts(self, targets: Mapping[str, float], here: Vector, absolute: frozenset[str] = NO_AXES) -> Vector:
        """Return the motor positions for axis positions; `absolute` axes may roll over on the way from `here`."""
        if self._single is not None:
            counts = tuple([scale * targets[axis] + offset for axis, scale, offset in self._single])
        elif self._inverse:
            counts = self._solve_kinematics(targets, here)
        else:
            counts = tuple([d.counts(targets) for d in self.definitions])
        if self._rollover is not None:
            counts = self._rollover.unfold(counts, here, targets, absolute)
        check_range("position", counts)
        return counts

    def velocities(self, velocities: Mapping[str, float]) -> Vector:
        """Return motor velocities (counts/ms) for axis velocities (user units per ms)."""
        if self._single is not None:
            counts = tuple([scale * velocities.get(axis, 0.0) for axis, scale, _ in self._single])
        else:
            counts = tuple([d.distance(velocities) for d in self.definitions])
        check_range("velocity", counts)
        return counts

    @property
    def solves(self) -> bool:
        """Whether inverse kinematics say where motors have to be."""
        return self._solver is not None

    @property
    def along_axes(self) -> bool:
        """Whether the path of LINEAR and CIRCLE moves is that of the axes, segment by segment."""
        return self._solver is not None and self.segment_ms > 0.0

    def solve(self, axes: Vector) -> Vector:
        """Return the motor positions for the positions of all axes, in the order of their letters."""
        counts = self._solve_kinematics(dict(zip(AXIS_LETTERS, axes, strict=True)), self.still)
        check_range("position", counts)
        return counts

    def moving(
        self, targets: Mapping[str, float], velocities: Mapping[str, float], here: Vector, absolute: frozenset[str]
    ) -> tuple[Vector, Vector]:
        """Return position and velocity of the motors at the end of a PVT segment, for those of the axes."""
        if self._solver is None:
            return self.counts(targets, here, absolute), self.velocities(velocities)
        solved = self._solver.moving(targets, velocities, self._inverse)
        others = [(d.counts(targets), d.distance(velocities)) for d in self.definitions if not d.inverse]
        rest = iter(others)
        states = [solved[d.motor] if d.inverse else next(rest) for d in self.definitions]
        counts, speeds = tuple([c for c, _ in states]), tuple([v for _, v in states])
        check_range("position", counts)
        check_range("velocity", speeds)
        return counts, speeds

    def _solve_kinematics(self, targets: Mapping[str, float], here: Vector) -> Vector:
        """Return the motor positions by the kinematics; while they are off, such a motor keeps its position."""
        solved = {} if self._solver is None else self._solver.counts(targets, self._inverse)
        pairs = zip(self.definitions, here, strict=True)
        return tuple([solved.get(d.motor, place) if d.inverse else d.counts(targets) for d, place in pairs])

    def positions(self, counts: Vector) -> dict[str, float]:
        """Return the axis positions for motor positions."""
        by_motor = {d.motor: d for d in self.definitions}
        return axis_positions(by_motor, {d.motor: c for d, c in zip(self.definitions, counts, strict=True)})

    def limits(self) -> Limits:
        """Ix16 and Ix17 apply only while moves are not segmented (I13 = 0)."""
        variables = self._variables
        if variables.i_revision != self._limits_revision:
            self._limits_revision, self._limits = variables.i_revision, self._none
            if not self.segment_ms > 0.0:
                self._limits = Limits(
                    velocity=tuple([variables.motor(number, 16) for number in self._motors]),
                    acceleration=tuple([variables.motor(number, 17) for number in self._motors]),
                )
        return self._limits

    def arc(self, request: CircleRequest, start: Mapping[str, float], here: Vector, target: Vector) -> Arc:
        """Return the arc of a circle move from axis positions `start`, which are the counts `here`.

        Raises PmacError: 003, no such arc exists, or it is beyond the registers of the controller.
        """
        arc = self.arc_by(self.definitions, request, start, here, target)
        check_range("radius", (*arc.cosine, *arc.sine))
        return arc

    def arc_by(
        self,
        definitions: tuple[AxisDefinition, ...],
        request: CircleRequest,
        start: Mapping[str, float],
        here: Vector,
        target: Vector,
    ) -> Arc:
        """Return an arc of motors that are defined otherwise. Raises PmacError: 003, no such arc exists."""
        return arc_of(
            request,
            start,
            definitions,
            tuple(t - h for t, h in zip(target, here, strict=True)),
            radius_limit=self._variables.system(self._system, 96),
            least_arc=self._variables.setting(FamilySetting.LEAST_ARC, self._system),
        )

    def abort_rates(self) -> Vector:
        """Return Ix15 of the motors, counts/ms^2."""
        return tuple([self._variables.motor(number, 15) for number in self._motors])

    @property
    def segment_ms(self) -> float:
        """Segmentation time of moves, I13; 0 is no segmentation."""
        return self._variables.setting(FamilySetting.SEGMENT_MS, self._system)

    def rapid_settings(self) -> list[JogSettings]:
        """Return the jog settings of each motor in a RAPID move: at Ix22, or at Ix16."""
        fast = FamilySetting.RAPID_AT_PROGRAM_SPEED
        return [
            jog_settings(self._variables, motor, 16 if self._variables.setting(fast, motor) else 22)
            for motor in self._motors
        ]

    def jog_delay_ms(self, axes: frozenset[str]) -> float:
        """Return the greatest calculation delay of the motors that drive some axes."""
        moved = [d.motor for d in self.definitions if axes & set(d.axes)]
        return max((self._variables.setting(FamilySetting.JOG_DELAY_MS, motor) for motor in moved), default=0.0)


class Rollover:
    """Tracks the whole turns between a motor's position in the program and its actual position."""

    def __init__(self, definitions: Sequence[AxisDefinition], variables: VariableStore) -> None:
        self._rotary = [(k, d) for k, d in enumerate(definitions) if d.axis in ROTARY]
        self._variables = variables
        self._turns = {k: 0.0 for k, _ in self._rotary}  # counts

    def unfold(
        self, counts: Vector, here: Vector, targets: Mapping[str, float], absolute: frozenset[str]
    ) -> Vector:
        """Return the target positions of the motors; `absolute` are the axes given a position."""
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
        up -= turn  # already there, except for rounding
    if forwards is None:
        return up if up <= 0.5 * turn else up - turn
    if forwards or abs(up) <= ROUNDING * turn:
        return up
    return up - turn


def check_range(what: str, values: Vector) -> None:
    """Refuse values that the controller's registers cannot hold; a nan is beyond them too.

    Raises PmacError: 003, beyond the registers.
    """
    for value in values:
        if not abs(value) <= FARTHEST_COUNTS:
            raise PmacError(ErrorCode.DATA_ERROR, f"{what} {value:g}, up to {FARTHEST_COUNTS:g} counts")
