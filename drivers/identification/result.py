"""What was identified: one path of one machine, with the firmware and the gains that it holds for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from statistics import fmean
from typing import Any

from drivers.cutting.strategy import Strategy
from profiles.axis.response import ServoResponse, identified_response
from profiles.own_values import positive, record, text, whole
from profiles.problem import Problem, ProfileError

SCHEMA = 1

MEASURED, COMPOSED = "measured", "composed"
"""A path that was driven as in a cut, or one that is another path and the delay of its source."""


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifiedPoint:
    """The response at one frequency: gain and phase with the half-widths of their confidence at 95 %.

    `amplitude_um` is what was commanded, as it was gathered.
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
    """What a response holds for: the machine by its name, the firmware, gains and servo period of the card.

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
    """The response of a path, from where the spindle is to where the tool is.

    `how` is `measured` or `composed`; `delay_cycles` are servo cycles that were added to what was measured.
    `date` is in UTC, as in 2001-11-30T14:05:00Z.
    """

    origin: Origin
    path: Strategy
    how: str
    delay_cycles: int
    date: str
    points: tuple[IdentifiedPoint, ...]


def as_table(identified: IdentifiedResponse) -> dict[str, Any]:
    """Return it as plain values for a file."""
    return {"schema": SCHEMA, **asdict(identified)}


def from_table(table: Any, where: str = "") -> IdentifiedResponse:
    """Read what `as_table` has made.

    Raises:
        ProfileError: `identify.file`, anything else.
    """
    try:
        if table["schema"] != SCHEMA:
            raise ValueError(f"schema {table['schema']}")
        origin = record(Origin, table["origin"])
        positive(origin.servo_period_ms)
        identified = IdentifiedResponse(
            origin=origin,
            path=Strategy(table["path"]),
            how=_how(table["how"]),
            delay_cycles=whole(table["delay_cycles"]),
            date=text(table["date"]),
            points=tuple(_point(each) for each in table["points"]),
        )
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        value = " ".join(f"{type(error).__name__}: {error}".split())
        raise ProfileError(Problem(code="identify.file", where=where, value=value)) from error
    return identified


def as_response(identified: IdentifiedResponse, name: str) -> ServoResponse:
    """Return the points as a curve that can be inverted; `name` says which identification it is.

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


def _how(word: object) -> str:
    if word not in (MEASURED, COMPOSED):
        raise ValueError(f"how {word!r}")
    return text(word)


def _point(table: Mapping[str, Any]) -> IdentifiedPoint:
    """Read a point; gain, frequency and the order of the points are judged with the curve through them."""
    point = record(IdentifiedPoint, table)
    positive(point.amplitude_um)
    return point
