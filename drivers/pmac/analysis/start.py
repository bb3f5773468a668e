"""Where the axes are when a program begins: as given by the operator, by a comment of the text, or at home.

A program states where it goes and not where it starts; a comment such as `; starts at X240000 Y0 Z169300` does.
Positions are user units of axes. An axis that is not named is at home, 0 counts.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum, auto

from drivers.errors import DriverError
from drivers.pmac.axes import AXIS_LETTERS, AxisDefinition, axis_positions
from drivers.pmac.language.text import format_number
from drivers.pmac.trajectory.frame import FARTHEST_COUNTS
from profiles.problem import Problem

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)"
_WORD = rf"[{''.join(AXIS_LETTERS)}]{_NUMBER}"
_COMMENT = re.compile(rf"\s*;\s*starts at((?:\s+{_WORD})+)\s*", re.IGNORECASE | re.ASCII)
_GIVEN = re.compile(rf"\s*([{''.join(AXIS_LETTERS)}])\s*=\s*({_NUMBER})\s*", re.IGNORECASE | re.ASCII)


class StartSource(StrEnum):
    """The source of a program's start position."""

    HOME = auto()
    COMMENT = auto()
    OPERATOR = auto()


@dataclass(frozen=True, slots=True, kw_only=True)
class StartPositions:
    """The `positions` of every axis; `line` is that of the comment which states them, from 1."""

    positions: Mapping[str, float]
    source: StartSource
    line: int | None = None

    def __str__(self) -> str:
        return _words(self.positions)


def read_start(text: str) -> dict[str, float]:
    """Parse the positions in a text such as `X=240000,Y=0`.

    Raises ValueError: it is not such a text; its argument is the part that is wrong.
    """
    positions: dict[str, float] = {}
    for part in text.split(","):
        found = _GIVEN.fullmatch(part)
        if found is None or found[1].upper() in positions:
            raise ValueError(part)
        positions[found[1].upper()] = float(found[2])
    return positions


def start_comment(definitions: Iterable[AxisDefinition], counts: Mapping[int, float]) -> str:
    """Return the comment line that states the motor positions; `counts` by motor."""
    by_motor = {definition.motor: definition for definition in definitions}
    return f"; starts at {_words(axis_positions(by_motor, counts))}"


def start_of(
    text: str, definitions: Iterable[AxisDefinition], given: Mapping[str, float] | None
) -> StartPositions:
    """Return where a program starts: as `given`, else by the first such comment of its text, else at home.

    Raises DriverError: `program.start_axis`, no motor drives that axis; `program.start_too_far`.
    """
    by_motor = {definition.motor: definition for definition in definitions}
    home = axis_positions(by_motor, dict.fromkeys(by_motor, 0.0))
    if given is not None:
        start = StartPositions(positions=given, source=StartSource.OPERATOR)
    else:
        start = StartPositions(positions={}, source=StartSource.HOME)
        for line, row in enumerate(text.splitlines(), start=1):
            if found := _COMMENT.fullmatch(row):
                positions = {word[0].upper(): float(word[1:]) for word in found[1].split()}
                start = StartPositions(positions=positions, source=StartSource.COMMENT, line=line)
                break
    for axis in start.positions:
        if axis not in home:
            limit = ", ".join(sorted(home)) or "-"
            raise DriverError(Problem(code="program.start_axis", value=axis, limit=limit))
    whole = StartPositions(positions=home | dict(start.positions), source=start.source, line=start.line)
    for motor, counts in start_counts(by_motor.values(), whole).items():
        if abs(counts) > FARTHEST_COUNTS:
            value, limit = f"{counts:.0f} counts", f"{FARTHEST_COUNTS:.0f} counts"
            raise DriverError(Problem(code="program.start_too_far", key=f"#{motor}", value=value, limit=limit))
    return whole


def start_counts(definitions: Iterable[AxisDefinition], start: StartPositions) -> dict[int, float]:
    """Return the motor positions at the start, counts by motor; one of inverse kinematics is at home."""
    return {each.motor: 0.0 if each.inverse else each.counts(start.positions) for each in definitions}


def _words(positions: Mapping[str, float]) -> str:
    return " ".join(f"{axis}{format_number(position)}" for axis, position in sorted(positions.items()))
