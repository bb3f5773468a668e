"""The axes of a coordinate system: their motors, and the offsets of their zero points."""

from __future__ import annotations

from collections.abc import Mapping

from drivers.pmac.axes import AxisDefinition, Solver, axis_positions, preset_origins, refuse_inverse
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.trajectory.pieces import Vector
from drivers.simulator.card.motor import Motor


class AxisFrame:
    """Axis definitions by motor, with the origins that PSET, `X=5` and Z have set for the axes (user units).

    `motors` are those of the axes, in the order of their numbers. `kinematics` move those that are defined by it.
    """

    def __init__(self, motors: Mapping[int, Motor]) -> None:
        self.definitions: dict[int, AxisDefinition] = {}
        self.motors: tuple[Motor, ...] = ()
        self.kinematics: Solver | None = None
        self._origins: dict[str, float] = {}
        self._motors = motors

    @property
    def places(self) -> Vector:
        """The commanded positions of the motors in counts, in the same order."""
        return tuple(motor.desired for motor in self.motors)

    @property
    def shifted_definitions(self) -> tuple[AxisDefinition, ...]:
        """The axis definitions with the present origins, in the same order."""
        ordered = [self.definitions[number] for number in sorted(self.definitions)]
        solver = self.kinematics
        return tuple([d.solved_by(solver) if d.inverse else d.shift_origins(self._origins) for d in ordered])

    @property
    def stopped_at(self) -> Vector | None:
        """Motor positions at which a resumable program was stopped, counts; None when it can resume anywhere."""
        places = tuple(motor.stopped_at for motor in self.motors if motor.stopped_at is not None)
        return places if len(places) == len(self.motors) else None

    @stopped_at.setter
    def stopped_at(self, places: Vector | None) -> None:
        for at, motor in enumerate(self.motors):
            motor.stopped_at = None if places is None else places[at]

    def positions(self) -> dict[str, float]:
        """Return the commanded axis positions, in user units."""
        desired = {motor.number: motor.desired for motor in self.motors}
        return axis_positions({definition.motor: definition for definition in self.shifted_definitions}, desired)

    def define(self, motor: int, definition: AxisDefinition | None) -> None:
        """Assign a motor to its axes, or clear it; the origins of these axes are cleared."""
        before = self.definitions.pop(motor, None)
        for axis in (*(before.axes if before else ()), *(definition.axes if definition else ())):
            self._origins.pop(axis, None)
        self._motors[motor].bias = 0.0
        if definition is not None:
            self.definitions[motor] = definition
        self.motors = tuple(self._motors[number] for number in sorted(self.definitions))
        self._bias_motors()

    def preset(self, presets: Mapping[str, float]) -> None:
        """Preset the present axis positions; nothing moves. Raises PmacError: 003, there is no such axis here."""
        refuse_inverse(self.definitions.values(), "PSET")
        positions = self.positions()
        if unknown := [axis for axis in presets if axis not in positions]:
            raise PmacError(ErrorCode.DATA_ERROR, f"no axis {unknown[0]}")
        self._origins = preset_origins(self._origins, positions, presets)
        self._bias_motors()

    def clear(self) -> None:
        """Clear every definition."""
        self.definitions.clear()
        self._origins.clear()
        self.motors = ()

    def _bias_motors(self) -> None:
        for number, definition in self.definitions.items():
            self._motors[number].bias = definition.distance(self._origins)
