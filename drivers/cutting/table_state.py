"""Check what compensation tables add to the tool, and switch them off without a step.

I51 = 0 leaves the last correction in the register, and it stays added. So tables are switched off only where
they add nothing, after a check of the register.
"""

from __future__ import annotations

from drivers.controller import Controller
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.text import format_number
from drivers.pmac.programs.cam import correction_register, register_definition
from profiles.machine import MachineProfile
from profiles.problem import Problem

SWITCH = "I51"

PARTS = 32
"""The register holds 1/(Ix08 x 32) count."""


def table_problems(client: Controller, machine: MachineProfile, dialect: Dialect) -> tuple[Problem, ...]:
    """Return what prevents a cut from being loaded: tables that are on, or a correction that was left.

    Raises:
        DriverError: the link broke, or the controller refused to answer.
    """
    client.request(register_definition(machine, dialect))
    on, held = client.numbers(SWITCH, correction_register(machine))
    problems = []
    if on:
        problems.append(Problem(code="cut.table_on", key=SWITCH, value=format_number(on), limit="0"))
    if held:
        key = correction_register(machine)
        problems.append(Problem(code="cut.table_holds", key=key, value=format_number(held), limit="0"))
    return tuple(problems)


def correction_counts(client: Controller, machine: MachineProfile, dialect: Dialect) -> float:
    """Return what a table adds to the tool now, counts: its reported position includes that.

    Raises:
        DriverError: the link broke, or the controller refused to answer.
    """
    client.request(register_definition(machine, dialect))
    scale, held = client.numbers(f"I{dialect.motor_index(machine.tool.motor, 8)}", correction_register(machine))
    return held / (PARTS * scale)


def switch_off(client: Controller, machine: MachineProfile, dialect: Dialect) -> tuple[Problem, ...]:
    """Switch tables off if the register reads 0, everything at rest; return what is left to fix.

    Raises:
        DriverError: the link broke, or the controller refused to answer.
    """
    problems = table_problems(client, machine, dialect)
    if [problem.code for problem in problems] != ["cut.table_on"]:
        return problems
    client.request(f"{SWITCH}=0")
    return table_problems(client, machine, dialect)
