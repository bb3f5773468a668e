"""How far an axis may go, and how far it goes on: by the machine profile, in counts and ms."""

from __future__ import annotations

import math

from drivers.errors import RefusedError
from drivers.lengths import Lengths
from drivers.snapshot import AxisName
from profiles.machine import MachineProfile
from profiles.problem import Problem

LINK_LATENCY_MS = 50.0
"""What a stop may take from the key to the controller."""


def refuse_beyond_travel(machine: MachineProfile, axis: AxisName, motor: int, counts: float) -> None:
    """Refuse a position outside Ix13 and Ix14; 0 means no limit, as for a rotary spindle.

    Raises:
        RefusedError: `machine.beyond_travel`.
    """
    variables = machine.controller.variables
    high, low = variables[f"I{motor}13"], variables[f"I{motor}14"]
    lengths, limit = Lengths(machine), ""
    if high and counts > high:
        limit = f"<= {lengths.at(axis, high)}"
    if low and counts < low:
        limit = f">= {lengths.at(axis, low)}"
    if limit:
        value = lengths.at(axis, counts)
        raise RefusedError(Problem(code="machine.beyond_travel", key=axis, value=value, limit=limit))


def overrun_counts(machine: MachineProfile, motor: int) -> float:
    """Return the longest way from the press of a stop in mid-jog to rest.

    v (background period + link latency) + v^2 / (2 a), with the jog speed v = Ix22 in counts/ms and the abort
    rate a = Ix15 in counts/ms^2. The controller obeys a stop once in a background period. Infinite when Ix15 is
    0, which never stops a motor.
    """
    variables = machine.controller.variables
    speed, rate = abs(variables[f"I{motor}22"]), variables[f"I{motor}15"]
    late_ms = machine.controller.background_ms + LINK_LATENCY_MS
    ramp = speed**2 / (2.0 * rate) if rate > 0.0 else math.inf
    return speed * late_ms + ramp
