"""What a controller is set to, against what its machine profile wants. Nothing is written."""

from __future__ import annotations

from collections.abc import Iterable

from drivers.pmac.axes import read_definitions
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.text import format_number
from drivers.pmac.settings import named_settings
from drivers.pmac.variables import MODAL_NUMBERS
from profiles.machine import Controller
from profiles.problem import Problem

QUERY_BATCH = 10


def differences(client: PmacClient, wanted: Controller, dialect: Dialect, motors: Iterable[int]) -> list[Problem]:
    """Return every setting and axis definition that is not as wanted, and every motor that is on but not ours.

    TA, TS and F of the coordinate system are left out: they are what the last program left behind.

    Raises:
        DriverError: the link broke, or the controller refused to answer.
    """
    return [
        *_settings(client, wanted, dialect),
        *_definitions(client, wanted),
        *_strange_motors(client, dialect, frozenset(motors)),
    ]


def _settings(client: PmacClient, controller: Controller, dialect: Dialect) -> list[Problem]:
    modal = {dialect.system_index(1, number) for number in MODAL_NUMBERS}
    wanted = named_settings(controller.variables, dialect)
    found = _read(client, sorted(wanted.keys() - modal))
    return [
        Problem(
            code="controller.setting",
            key=f"I{index}",
            value=format_number(value),
            limit=format_number(wanted[index]),
        )
        for index, value in found.items()
        if value != wanted[index]
    ]


def _definitions(client: PmacClient, controller: Controller) -> list[Problem]:
    problems = []
    for definition in read_definitions(controller.axis_definitions):
        key = f"#{definition.motor}->"
        (found,) = client.query(key)
        if found.strip() != str(definition):
            problems.append(Problem(code="controller.setting", key=key, value=found, limit=str(definition)))
    return problems


def _strange_motors(client: PmacClient, dialect: Dialect, ours: frozenset[int]) -> list[Problem]:
    others = [motor for motor in range(1, dialect.motor_count + 1) if motor not in ours]
    found = _read(client, [dialect.motor_index(motor, 0) for motor in others])
    return [
        Problem(code="controller.strange_motor", key=f"I{index}", value=format_number(value), limit="0")
        for index, value in found.items()
        if value != 0.0
    ]


def _read(client: PmacClient, indices: list[int]) -> dict[int, float]:
    """Return I-variables by index, a few in a line."""
    found: dict[int, float] = {}
    for start in range(0, len(indices), QUERY_BATCH):
        batch = indices[start : start + QUERY_BATCH]
        found.update(zip(batch, client.numbers(*(f"I{index}" for index in batch)), strict=True))
    return found
