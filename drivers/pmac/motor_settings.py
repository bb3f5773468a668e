"""The settings of one motor as physical limits: mm or degrees, and seconds.

Ix11, Ix12 and Ix28 are sixteenths of a count, Ix13 and Ix14 counts, speeds (Ix16, Ix22, Ix23) counts/ms,
accelerations (Ix15, Ix19) counts/ms^2, ramps (Ix20, Ix21) ms. They are read here and nowhere above.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.pmac.dialect import DIALECTS
from drivers.pmac.settings import PARTS_PER_COUNT, settings_with
from drivers.pmac.trajectory.jog import JogSettings, change_speed, jog_settings, jog_to
from drivers.pmac.variables import VariableStore
from profiles.machine import MachineProfile

_PER_S = 1000.0  # Milliseconds in a second


@dataclass(frozen=True, slots=True)
class MotorSettings:
    """The motor settings of the machine profile.

    Lengths are those of its axis: mm, or degrees of the spindle. A position and a following error stay in counts,
    as the controller reports them.
    """

    machine: MachineProfile
    motor: int

    @property
    def counts_per_unit(self) -> float:
        """Counts per millimetre, or per degree of the spindle."""
        machine = self.machine
        if self.motor == machine.spindle.motor:
            return machine.spindle.counts_per_rev / 360.0
        return machine.tool.counts_per_mm if self.motor == machine.tool.motor else machine.carriage.counts_per_mm

    @property
    def program_speed(self) -> float:
        """Maximum speed of a program, Ix16, per second."""
        return self._per_s(16, 1)

    @property
    def jog_speed(self) -> float:
        """Speed of a jog, Ix22, per second."""
        return abs(self._per_s(22, 1))

    @property
    def jog_acceleration(self) -> float:
        """Maximum acceleration of a jog, Ix19, per second squared; 0 means no limit."""
        return self._per_s(19, 2)

    @property
    def abort_rate(self) -> float:
        """Deceleration of a stop, Ix15, per second squared; 0 never stops the motor."""
        return self._per_s(15, 2)

    @property
    def error_limit_counts(self) -> float:
        """Fatal following error, at which the controller disables the motor, Ix11."""
        return self._value(11) / PARTS_PER_COUNT

    @property
    def warning_counts(self) -> float:
        """Following error at which the controller warns, Ix12."""
        return self._value(12) / PARTS_PER_COUNT

    @property
    def in_position_counts(self) -> float:
        """Following error within which the motor is in position, Ix28."""
        return self._value(28) / PARTS_PER_COUNT

    @property
    def highest_counts(self) -> float | None:
        """Highest position, Ix13; None without a limit."""
        return self._value(13) or None

    @property
    def lowest_counts(self) -> float | None:
        """Lowest position, Ix14; None without a limit."""
        return self._value(14) or None

    @property
    def home_braking_s(self) -> float:
        """Time from the home search speed, Ix23, to rest."""
        settings = self._jog_settings(23)
        return sum(piece.duration_ms for piece in change_speed(0.0, settings.speed, 0.0, settings)) / _PER_S

    @property
    def home_speed(self) -> float:
        """Speed of a home search, Ix23, per second."""
        return self._jog_settings(23).speed / self.counts_per_unit * _PER_S

    def jog_s(self, way: float) -> float:
        """Return the commanded duration of a jog over this distance; the axis may settle some moments later."""
        pieces = jog_to(0.0, way * self.counts_per_unit, self._jog_settings(22))
        return sum(piece.duration_ms for piece in pieces) / _PER_S

    def _jog_settings(self, speed: int) -> JogSettings:
        """Return the settings of a jog at the speed of this variable."""
        dialect = DIALECTS[self.machine.controller.family]
        variables = VariableStore(settings_with(self.machine.controller.variables, dialect), dialect)
        return jog_settings(variables, self.motor, speed)

    def step_speed(self, way: float) -> float:
        """Return an upper bound of the speed that a jog over this distance reaches, per second.

        The jog speed; less for short moves: way / TA with the acceleration time TA (Ix20, at least twice Ix21),
        and sqrt(a way), the peak of two ramps at the acceleration limit a.
        """
        ramp_s = max(self._value(20), 2.0 * self._value(21)) / _PER_S
        bounds = [self.jog_speed]
        if ramp_s > 0.0:
            bounds.append(way / ramp_s)
        if self.jog_acceleration > 0.0:
            bounds.append(math.sqrt(self.jog_acceleration * way))
        return min(bounds)

    def stopping_distance(self, speed: float, late_s: float) -> float:
        """Return the stopping distance from a speed per second: v t + v^2 / (2 a), for a stop delayed by t.

        Infinite where a = Ix15 is 0, which never stops a motor.
        """
        rate = self.abort_rate
        return speed * late_s + speed**2 / (2.0 * rate) if rate > 0.0 else math.inf

    def step_stopping_distance(self, way: float, late_s: float) -> float:
        """Return the longest stopping distance from a point in a jog over `way`.

        A stop that brakes at least as hard as the jog's own ramp ends within the jog; a softer one may overshoot
        it.
        """
        further = self.stopping_distance(self.step_speed(way), late_s)
        return min(further, way) if self.abort_rate >= self.jog_acceleration > 0.0 else further

    def stop_s(self, speed: float) -> float:
        """Return the time from a speed per second to rest after a stop."""
        return speed / self.abort_rate

    def _value(self, number: int) -> float:
        return self.machine.controller.variables[f"I{self.motor}{number}"]

    def _per_s(self, number: int, power: int) -> float:
        return self._value(number) / self.counts_per_unit * _PER_S**power
