"""Check that an identified response applies here: to this machine, its gains and servo period, and this path."""

from __future__ import annotations

import math
from collections.abc import Iterator

from drivers.cutting.strategy import Strategy
from drivers.identification.result import IdentifiedResponse
from drivers.pmac.dialect import dialect_of
from profiles.machine import MachineProfile
from profiles.problem import Problem

SAME_PERIOD = 1e-4  # relative tolerance between two servo periods: a profile need not give all digits of I10
_WORLD = {True: "simulated", False: "real"}


def unfit_problems(
    identified: IdentifiedResponse,
    machine: MachineProfile,
    path: Strategy,
    *,
    simulated: bool | None = None,
    where: str = "",
) -> tuple[Problem, ...]:
    """Return every way in which a response belongs to another machine or path: `response.of_another`.

    `simulated` says where the cut will be, None if unknown. A profile does not know the version of a
    controller; a gain that it does not name is not compared. `where` is the file.
    """
    differing = [
        *_told(identified, machine, path),
        *([] if simulated is None else _pair("machine", _WORLD[identified.origin.simulated], _WORLD[simulated])),
    ]
    return tuple(
        Problem(code="response.of_another", where=where, key=key, value=met, limit=target)
        for key, met, target in differing
    )


def _told(
    identified: IdentifiedResponse, machine: MachineProfile, path: Strategy
) -> Iterator[tuple[str, str, str]]:
    """Yield each difference: its name, its value as identified, its value here."""
    origin, controller = identified.origin, machine.controller
    yield from _pair("strategy", identified.path.value, path.value)
    yield from _pair("machine", origin.machine, machine.name)
    dialect = dialect_of(origin.kind)
    if dialect is None or dialect.name != controller.family:
        yield "controller", origin.kind, controller.family
    for name, met in origin.gains.items():
        if name in controller.variables:
            yield from _pair(name, f"{met:.10g}", f"{controller.variables[name]:.10g}")
    if not math.isclose(origin.servo_period_ms, controller.servo_period_ms, rel_tol=SAME_PERIOD):
        yield "servo_period_ms", f"{origin.servo_period_ms:.6g}", f"{controller.servo_period_ms:.6g}"


def _pair(name: str, met: str, target: str) -> list[tuple[str, str, str]]:
    return [] if met == target else [(name, met, target)]
