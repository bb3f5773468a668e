"""The position loop of the tool as the controller has it: its gains and its servo period, read, not assumed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from drivers.commissioning.reading import read_settings
from drivers.controller import Controller
from drivers.pmac.dialect import Dialect
from drivers.pmac.settings import servo_cycle_ms
from profiles.machine import MachineProfile

MODELLED = (8, 9, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39)
"""Ix08 and Ix09, the scales, the gains Ix30 to Ix35, and the notch filter Ix36 to Ix39."""

UNMODELLED = (60, 68)
"""Longer servo period, friction feedforward: 0, or the loop is another one than is computed."""

_SERVO_TIME = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolLoop:
    """What was read, by the numbers of Ixx, and the servo period; `at` is the time of day of the reading."""

    motor: int
    values: tuple[tuple[int, float], ...]
    servo_period_ms: float
    at: str

    @property
    def names(self) -> Mapping[str, float]:
        """Return the values by the names that a profile has for them, such as I130."""
        return {f"I{self.motor}{number:02d}": value for number, value in self.values}

    @property
    def gains(self) -> Mapping[str, float]:
        """Return those that the model has."""
        modelled = {f"I{self.motor}{number:02d}" for number in MODELLED}
        return {name: value for name, value in self.names.items() if name in modelled}

    @property
    def unmodelled(self) -> tuple[str, ...]:
        """Return the names of settings that make the loop another one than is computed."""
        return tuple(name for name, value in self.names.items() if name not in self.gains and value != 0.0)

    def on(self, machine: MachineProfile) -> MachineProfile:
        """Return a machine with these gains and this servo period in the place of those of its profile."""
        variables = {**machine.controller.variables, **self.gains}
        controller = replace(machine.controller, variables=variables, servo_period_ms=self.servo_period_ms)
        return replace(machine, controller=controller)


def read_tool_loop(client: Controller, dialect: Dialect, motor: int, at: str) -> ToolLoop:
    """Read the loop of a motor. Raises DriverError: the link broke; ControllerError: it has not all of them."""
    indices = {number: dialect.motor_index(motor, number) for number in (*MODELLED, *UNMODELLED)}
    found = read_settings(client, (_SERVO_TIME, *indices.values()))
    return ToolLoop(
        motor=motor,
        values=tuple((number, found[index]) for number, index in indices.items()),
        servo_period_ms=servo_cycle_ms(found[_SERVO_TIME]),
        at=at,
    )
