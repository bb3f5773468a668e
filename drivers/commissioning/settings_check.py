"""Compare the controller's settings with its machine profile, as refusals. Nothing is written.

It compares the same by the same rule as the checks of `drivers.pmac.configuration`, in a few requests.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from drivers.commissioning.judged import same, stated_settings_of
from drivers.commissioning.reading import read_settings
from drivers.controller import Controller
from drivers.pmac.axes import read_definitions
from drivers.pmac.dialect import Dialect, Scope
from drivers.pmac.language.text import format_number
from profiles.machine import Controller as ControllerSettings
from profiles.problem import Problem


def differences(
    client: Controller, wanted: ControllerSettings, dialect: Dialect, motors: Iterable[int]
) -> list[Problem]:
    """Return every setting and axis definition that differs, and every unexpected active motor.

    TA, TS and F of the coordinate system are left out: they are what the last program left behind.

    Raises:
        DriverError: the link broke, or the controller refused to answer.
    """
    return [
        *_settings(client, wanted, dialect),
        *_definitions(client, wanted),
        *_unexpected_motors(client, dialect, frozenset(motors)),
    ]


def _settings(client: Controller, controller: ControllerSettings, dialect: Dialect) -> Iterator[Problem]:
    wanted = stated_settings_of(controller, dialect)
    for index, value in read_settings(client, wanted).items():
        if not same(value, wanted[index]):
            yield _differs(f"I{index}", format_number(value), format_number(wanted[index]))


def _definitions(client: Controller, controller: ControllerSettings) -> Iterator[Problem]:
    definitions = read_definitions(controller.axis_definitions)
    found = client.query(*(f"#{each.motor}->" for each in definitions), again=True)
    for definition, text in zip(definitions, found, strict=True):
        if text.strip() != str(definition):
            yield _differs(f"#{definition.motor}->", text, str(definition))


def _differs(key: str, value: str, limit: str) -> Problem:
    return Problem(code="controller.setting", key=key, value=value, limit=limit)


def _unexpected_motors(client: Controller, dialect: Dialect, ours: frozenset[int]) -> Iterator[Problem]:
    others = [dialect.motor_index(motor, 0) for motor in dialect.numbers(Scope.MOTOR) if motor not in ours]
    for index, value in read_settings(client, others).items():
        if value != 0.0:
            yield Problem(code="controller.strange_motor", key=f"I{index}", value=format_number(value), limit="0")
