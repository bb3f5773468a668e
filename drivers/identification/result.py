"""The result of an identification: one path of one machine, with the firmware and gains that it is valid for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from statistics import fmean
from typing import Any

from drivers.cutting.strategy import Strategy
from profiles.axis.response import ServoResponse, identified_response
from profiles.own_values import positive, read_own

SCHEMA = 1

MEASURED, COMPOSED = "measured", "composed"
"""A path driven as in a cut, or another path combined with the delay of its source."""


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
class Origin:
    """What a response is valid for: the machine's name, the controller's firmware, gains and servo period.

    `gains` are Ix30 to Ix35 of the tool by their names, as they were read.
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

    origin: Origin
    path: Strategy
    how: str
    delay_cycles: int
    date: str
    points: tuple[IdentifiedPoint, ...]


def as_table(identified: IdentifiedResponse) -> dict[str, Any]:
    """Return the result as plain values for a file."""
    return {"schema": SCHEMA, **asdict(identified)}


def from_table(table: Any, where: str = "") -> IdentifiedResponse:
    """Read the output of `as_table`.

    Raises:
        ProfileError: `schema.unsupported`; `identify.file`, anything else.
    """
    return read_own(IdentifiedResponse, table, schema=SCHEMA, code="identify.file", where=where, judge=_judge)


def _judge(identified: IdentifiedResponse) -> None:
    """Refuse impossible values; gain, frequency and order of points are judged with the curve through them."""
    if identified.how not in (MEASURED, COMPOSED):
        raise ValueError(f"how {identified.how!r}")
    positive(identified.origin.servo_period_ms)
    for point in identified.points:
        positive(point.amplitude_um)


def as_response(identified: IdentifiedResponse, name: str) -> ServoResponse:
    """Return the points as a curve that can be inverted; `name` identifies the measurement.

    Raises:
        ProfileError: `response.bad_points`.
    """
    points = identified.points
    return identified_response(
        frequency_hz=[point.frequency_hz for point in points],
        gain=[point.gain for point in points],
        phase_deg=[point.phase_deg for point in points],
        gain_ci=[point.gain_ci for point in points],
        phase_ci_deg=[point.phase_ci_deg for point in points],
        amplitude_um=fmean(point.amplitude_um for point in points) if points else 0.0,
        name=name,
    )
