"""Moves of a checked program as two tables that fit 80 columns; repeats are folded."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from console.cli.part.plain_number import PlainNumber
from console.text.catalogue import Catalogue
from console.text.columns import table
from drivers.pmac.analysis.moves import Fold, MotorMove, MoveAnalysis, fold
from drivers.pmac.analysis.program import ProgramCheck
from drivers.pmac.analysis.timeline import NOTHING, SAME_COUNTS
from drivers.pmac.analysis.units import Unit, unit_of
from profiles.machine import MachineProfile

Row = tuple[str, ...]

MOST_ROWS = 40
"""Rows of a table; --json has every move."""

_NOTHING = "-"

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

_WAYS = ("line", "times", "ta", "ts", "tm", "motor", "told", "made", "reached")
_PEAKS = ("line", "times", "motor", "velocity", "in_units", "acceleration", "jerk")


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveTables:
    """The lines of both tables; `whole` when no row was left out."""

    lines: tuple[str, ...]
    whole: bool


def move_tables(machine: MachineProfile, checked: ProgramCheck, text: Catalogue) -> MoveTables:
    """Return the table of times and distances, and that of the peaks; rows beyond `MOST_ROWS` are counted."""
    folds = fold(checked.moves)
    ways, more_ways = _capped([rows for each in folds for rows in _ways(checked, each)])
    peaks, more_peaks = _capped([rows for each in folds for rows in _peaks(machine, checked, each)])
    lines = (
        *table([_titles(_WAYS, text), *ways], numeric=(0, 1, 2, 3, 4, 6, 7, 8)),
        *_left_out(more_ways, text),
        "",
        *table([_titles(_PEAKS, text), *peaks], numeric=(0, 1, 3, 4, 5, 6)),
        *_left_out(more_peaks, text),
    )
    return MoveTables(lines=lines, whole=not (more_ways or more_peaks))


def _titles(names: Sequence[str], text: Catalogue) -> Row:
    return tuple(text(f"check.column.{name}") for name in names)


def _capped(moves: Sequence[Sequence[Row]]) -> tuple[list[Row], int]:
    """Return the rows of the first moves, each with all of its rows, and how many rows are left out."""
    shown: list[Row] = []
    for rows in moves:
        if shown and len(shown) + len(rows) > MOST_ROWS:
            break
        shown += rows
    return shown, sum(map(len, moves)) - len(shown)


def _left_out(rows: int, text: Catalogue) -> list[str]:
    return [text("check.left_out", count=rows)] if rows else []


def _ways(checked: ProgramCheck, folded: Fold) -> Iterator[list[Row]]:
    """Yield the rows of times and distances of each move."""
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
        yield _headed(head, [_way(motor) for motor in _moving(move)] or [(_NOTHING,) * 4])


def _headed(head: Row, rows: Sequence[Row]) -> list[Row]:
    return [(head if number == 0 else ("",) * len(head)) + row for number, row in enumerate(rows)]


def _way(motor: MotorMove) -> Row:
    return f"#{motor.motor}", _counts(motor.commanded), _counts(motor.made), _counts(motor.reached)


def _peaks(machine: MachineProfile, checked: ProgramCheck, folded: Fold) -> Iterator[list[Row]]:
    """Yield the rows of peaks of each move."""
    for move in folded.moves:
        head = _where(checked, move, folded.times)
        yield _headed(head, [_peak(machine, motor) for motor in _moving(move)])


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
    """Return a quantity in its unit; a value within the rounding of counts is 0."""
    return f"{_number(counts * per_count if abs(counts) > NOTHING else 0.0)} {unit}"


def _where(checked: ProgramCheck, move: MoveAnalysis, times: int) -> tuple[str, str]:
    return str(checked.places[move.number]), f"x {times}" if times > 1 else ""


def _moving(move: MoveAnalysis) -> list[MotorMove]:
    """Return the motors that a move commands, or that move in it."""
    return [motor for motor in move.motors if abs(motor.commanded) > SAME_COUNTS or abs(motor.made) > SAME_COUNTS]


def _changed(asked_ms: float, used_ms: float) -> str:
    asked, used = _number(asked_ms), _number(used_ms)
    return used if asked == used else f"{asked}>{used}"


def _counts(value: float) -> str:
    return _number(value if abs(value) > SAME_COUNTS else 0.0)


def _number(value: float) -> str:
    """Return a number in five digits, without an exponent."""
    return f"{PlainNumber(value):.5g}"
