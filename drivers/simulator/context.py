"""What one host has addressed, and the data that waits for it; each port has its own."""

from __future__ import annotations

from dataclasses import dataclass, field

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.simulator.controller import Controller
from drivers.simulator.motor import Motor


@dataclass(slots=True, eq=False)
class Context:
    """The addressing of one port. Two ports are never equal, however alike."""

    controller: Controller
    motor_number: int = 1
    system_number: int = 1
    lines: list[str] = field(default_factory=list)

    @property
    def motor(self) -> Motor:
        """The addressed motor.

        Raises:
            PmacError: 013, there is no such motor in this machine.
        """
        motor = self.controller.motors.get(self.motor_number)
        if motor is None or not motor.activated:
            raise PmacError(ErrorCode.NOT_ACTIVATED, f"motor {self.motor_number}")
        return motor

    @property
    def fills_buffer(self) -> bool:
        """Whether program text from this host goes into the open buffer."""
        opened = self.controller.open_buffer
        return opened is not None and opened.owner is self
