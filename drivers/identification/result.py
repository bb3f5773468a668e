"""The result of an identification: one path of one machine, what it is valid for, and whether it applies here."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from statistics import fmean
from typing import Any

from drivers.cutting.strategy import Strategy
from drivers.pmac.dialect import dialect_of
from profiles.axis.response import ServoResponse, identified_response
from profiles.axis.servo_gains import complete_settings, stated_settings
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.strict_values import positive, read_own

SCHEMA = 1

MEASURED, COMPOSED = "measured", "composed"  # driven as in a cut; combined with the delay of its source


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifiedPoint:
    """The response at one frequency: gain and phase with the half-widths of their 95 % confidence intervals.

    `amplitude_um` is the commanded amplitude, as gathered.
    """

    frequency_hz: float
    gain: float
    phase_deg: float
    gain_ci: float
    phase_ci_deg: float
    coherence: float
    amplitude_um: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ResponseOrigin:
    """What a response is valid for: the machine's name, the controller's firmware, gains and servo period.

    `gains` are Ix30 to Ix39 of the tool by their names, as they were read.
    """

    machine: str
    simulated: bool
    version: str
    kind: str
    gains: Mapping[str, float]
    servo_period_ms: float


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifiedResponse:
    """The response of a path, from spindle position to tool position.

    `how` is `measured` or `composed`; `delay_cycles` are servo cycles that were added to the measurement.
    `date` is in UTC, as in 2001-11-30T14:05:00Z.
    """

    origin: ResponseOrigin
    path: Strategy
    how: str
    delay_cycles: int
    date: str
    points: tuple[IdentifiedPoint, ...]


def as_table(identified: IdentifiedResponse) -> dict[str, Any]:
    """Return the result as plain values for a file."""
    return {"schema": SCHEMA, **asdict(identified)}


def from_table(table: Any, where: str = "") -> IdentifiedResponse:
    """Read the output of `as_table`. Raises ProfileError: `schema.unsupported`; `identify.file`, anything else."""
    return read_own(IdentifiedResponse, table, schema=SCHEMA, code="identify.file", where=where, judge=_judge)


def _judge(identified: IdentifiedResponse) -> None:
    """Refuse impossible values; gain, frequency and order of points are judged with the curve through them."""
    if identified.how not in (MEASURED, COMPOSED):
        raise ValueError(f"how {identified.how!r}")
    positive(identified.origin.servo_period_ms)
    for point in identified.points:
        positive(point.amplitude_um)


def as_response(identified: IdentifiedResponse, name: str) -> ServoResponse:
    """Return the curve through the points, with a name. Raises ProfileError: `response.bad_points`."""
    points = identified.points
    curve = ("frequency_hz", "gain", "phase_deg", "gain_ci", "phase_ci_deg")
    return identified_response(
        **{key: [getattr(point, key) for point in points] for key in curve},
        amplitude_um=fmean(point.amplitude_um for point in points) if points else 0.0,
        name=name,
    )


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
    controller; a gain that it does not name is not compared, and a notch filter that it does not name is none.
    `where` is the file.
    """
    origin, controller = identified.origin, machine.controller
    dialect, stated = dialect_of(origin.kind), stated_settings(machine)
    pairs = [("strategy", identified.path.value, path.value), ("machine", origin.machine, machine.name)]
    if dialect is None or dialect.name != controller.family:
        pairs.append(("controller", origin.kind, controller.family))
    for name, gain in complete_settings(machine, origin.gains).items():
        if name in stated:
            pairs.append((name, f"{gain:.10g}", f"{stated[name]:.10g}"))
    if not math.isclose(origin.servo_period_ms, controller.servo_period_ms, rel_tol=SAME_PERIOD):
        pairs.append(("servo_period_ms", f"{origin.servo_period_ms:.6g}", f"{controller.servo_period_ms:.6g}"))
    if simulated is not None:
        pairs.append(("machine", _WORLD[origin.simulated], _WORLD[simulated]))
    return tuple(
        Problem(code="response.of_another", where=where, key=key, value=actual, limit=target)
        for key, actual, target in pairs
        if actual != target
    )
