"""What compensation tables add to the tool.

I51 = 0 leaves the last correction in the register, and it stays added. So tables are switched off only where
they add nothing, after a check of the register.
"""

from __future__ import annotations

from drivers.controller import Controller
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.language.text import format_number
from drivers.pmac.programs.cam import correction_register, register_definition
from profiles.machine import MachineProfile
from profiles.problem import Problem

SWITCH = "I51"
REGISTER_PARTS = 32  # the register holds 1/(Ix08 x 32) count


class Tables:
    """The tables of one machine.

    Every method raises `DriverError` when the link breaks or the controller refuses a line.
    """

    def __init__(self, client: Controller, machine: MachineProfile) -> None:
        self._client, self._register = client, correction_register(machine)
        dialect = DIALECTS[machine.controller.family]
        self._definition = register_definition(machine, dialect)
        self._scale = f"I{dialect.motor_index(machine.tool.motor, 8)}"

    def are_on(self) -> bool:
        """Query whether tables are on: they then move with their source."""
        return self._client.numbers(SWITCH, again=True)[0] != 0.0

    def find_remaining_tables(self) -> tuple[Problem, ...]:
        """Return what prevents a cut from being loaded: tables that are on, or a correction that was left."""
        self._client.request(self._definition)
        on, held = self._client.numbers(SWITCH, self._register)
        return tuple(
            Problem(code=code, key=key, value=format_number(value), limit="0")
            for code, key, value in (("cut.table_on", SWITCH, on), ("cut.table_holds", self._register, held))
            if value
        )

    def correction_counts(self) -> float:
        """Return what a table adds to the tool now, counts: its reported position includes that."""
        self._client.request(self._definition)
        scale, held = self._client.numbers(self._scale, self._register)
        return held / (REGISTER_PARTS * scale)

    def switch_off(self) -> tuple[Problem, ...]:
        """Switch tables off if the register reads 0, everything at rest; return what is left to fix."""
        problems = self.find_remaining_tables()
        if [problem.code for problem in problems] != ["cut.table_on"]:
            return problems
        self._client.request(f"{SWITCH}=0")
        return self.find_remaining_tables()

    def clear(self) -> tuple[Problem, ...]:
        """Switch tables off and make 0 what they add, whatever it is; return what is left to fix.

        A tool in closed loop would jump by that: every drive must be killed.
        """
        self._client.request(self._definition)
        self._client.request(f"{SWITCH}=0")  # while it is on, the register is computed again in each servo cycle
        self._client.request(f"{self._register}=0")
        return self.find_remaining_tables()
