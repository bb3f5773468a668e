"""The moves of a checked program as two tables that fit 80 columns; what repeats is folded."""

from __future__ import annotations

from collections.abc import Iterator

from console.text.catalogue import Catalogue
from console.text.columns import table
from drivers.pmac.analysis.folding import Fold, fold
from drivers.pmac.analysis.moves import MotorMove, MoveAnalysis
from drivers.pmac.analysis.program import ProgramCheck
from drivers.pmac.analysis.step import SAME_COUNTS
from drivers.pmac.analysis.units import Unit, unit_of
from profiles.machine import MachineProfile

Row = tuple[str, ...]

_NOTHING = "-"

_ROUNDING = 1e-9
"""Counts, and counts in ms to any power, below which there is nothing."""

_COUNTS = Unit(
    name="counts",
    per_count=1.0,
    velocity_unit="c/ms",
    velocity=1.0,
    acceleration_unit="c/ms2",
    acceleration=1.0,
    jerk_unit="c/ms3",
    jerk=1.0,
)


def move_lines(machine: MachineProfile, checked: ProgramCheck, text: Catalogue) -> list[str]:
    """Return the table of times and ways, and that of the peaks."""
    folds = fold(checked.moves)
    ways = [
        tuple(text(f"check.column.{name}") for name in ("line", "times", "ta", "ts", "tm", "motor")),
        *(row for each in folds for row in _ways(checked, each)),
    ]
    ways[0] += tuple(text(f"check.column.{name}") for name in ("told", "made", "reached"))
    peaks = [
        tuple(
            text(f"check.column.{name}")
            for name in ("line", "times", "motor", "velocity", "in_units", "acceleration", "jerk")
        ),
        *(row for each in folds for row in _peaks(machine, checked, each)),
    ]
    return [
        *table(ways, numeric=(0, 1, 2, 3, 4, 6, 7, 8)),
        "",
        *table(peaks, numeric=(0, 1, 3, 4, 5, 6)),
    ]


def _ways(checked: ProgramCheck, folded: Fold) -> Iterator[Row]:
    for move in folded.moves:
        place, times = _where(checked, move, folded.times)
        asked, used = move.asked, move.used
        head = (
            place,
            times,
            _changed(asked.ta_ms, used.ta_ms),
            _changed(asked.ts_ms, used.ts_ms),
            _changed(asked.tm_ms, used.tm_ms),
        )
        rows = [_way(motor) for motor in _moving(move)]
        for number, row in enumerate(rows or [(_NOTHING,) * 4]):
            yield (head if number == 0 else ("",) * len(head)) + row


def _way(motor: MotorMove) -> Row:
    return f"#{motor.motor}", _counts(motor.commanded), _counts(motor.made), _counts(motor.reached)


def _peaks(machine: MachineProfile, checked: ProgramCheck, folded: Fold) -> Iterator[Row]:
    for move in folded.moves:
        head = _where(checked, move, folded.times)
        for number, motor in enumerate(_moving(move)):
            yield (head if number == 0 else ("", "")) + _peak(machine, motor)


def _peak(machine: MachineProfile, motor: MotorMove) -> Row:
    unit, peaks = unit_of(machine, motor.motor) or _COUNTS, motor.peaks
    return (
        f"#{motor.motor}",
        _number(peaks.velocity),
        _quantity(peaks.velocity, unit.velocity, unit.velocity_unit) if unit is not _COUNTS else _NOTHING,
        _quantity(peaks.acceleration, unit.acceleration, unit.acceleration_unit),
        _NOTHING if peaks.jerk is None else _quantity(peaks.jerk, unit.jerk, unit.jerk_unit),
    )


def _quantity(counts: float, per_count: float, unit: str) -> str:
    """Return a quantity in its unit; what is nothing but the rounding of counts is 0."""
    return f"{_number(counts * per_count if abs(counts) > _ROUNDING else 0.0)} {unit}"


def _where(checked: ProgramCheck, move: MoveAnalysis, times: int) -> tuple[str, str]:
    return str(checked.places[move.number]), f"x {times}" if times > 1 else ""


def _moving(move: MoveAnalysis) -> list[MotorMove]:
    """Return the motors that a move tells to go, or that go in it."""
    return [motor for motor in move.motors if abs(motor.commanded) > SAME_COUNTS or abs(motor.made) > SAME_COUNTS]


def _changed(asked_ms: float, used_ms: float) -> str:
    asked, used = _number(asked_ms), _number(used_ms)
    return used if asked == used else f"{asked}>{used}"


def _counts(value: float) -> str:
    return _number(value if abs(value) > SAME_COUNTS else 0.0)


def _number(value: float) -> str:
    """Return a number in five digits, large ones in all that stand before the point."""
    digits = f"{value:.5g}"
    return f"{value:.0f}" if "e+" in digits else digits
