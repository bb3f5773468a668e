"""Moves of a checked program as two tables that fit 80 columns; repeats are folded."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from console.text.catalogue import Catalogue
from console.text.columns import table
from drivers.pmac.analysis.moves import Fold, MotorMove, MoveAnalysis, fold
from drivers.pmac.analysis.program import ProgramCheck
from drivers.pmac.analysis.timeline import NOTHING, SAME_COUNTS
from drivers.pmac.analysis.units import unit_of
from profiles.machine import MachineProfile

Row = tuple[str, ...]

MOST_ROWS = 40
"""Rows of a table; --json has every move."""

_NOTHING = "-"

_WAYS = ("line", "times", "ta", "ts", "tm", "motor", "told", "made", "reached")
_PEAKS = ("line", "times", "motor", "velocity", "in_units", "acceleration", "jerk")

_DECIMALS = 9
"""Decimals of a number too small for the requested digits; what is still smaller is 0."""


class PlainNumber(float):
    """Number for people at a machine: its `g` format writes out what would get an exponent."""

    def __format__(self, spec: str) -> str:
        """Return the number in that format; a large one keeps all digits before the point."""
        shown = super().__format__(spec)
        if "e" not in shown:
            return shown
        sign = "+" if spec.startswith("+") else ""
        if "e+" in shown:
            return super().__format__(f"{sign}.0f")
        digits = super().__format__(f"{sign}.{_DECIMALS}f").rstrip("0").rstrip(".")
        return "0" if digits in ("0", "-0", "+0") else digits


def move_tables(machine: MachineProfile, checked: ProgramCheck, text: Catalogue) -> tuple[list[str], bool]:
    """Return the table of times and distances, and that of the peaks; and whether they are complete.

    Rows beyond `MOST_ROWS` are counted.
    """
    folds = fold(checked.moves)
    still: list[Row] = [(_NOTHING,) * 4]
    ways, more_ways = _capped(_rows(checked, folds, _changed_times, _way, still))
    peaks, more_peaks = _capped(_rows(checked, folds, lambda _: (), lambda motor: _peak(machine, motor), []))
    lines = [
        *table([_titles(_WAYS, text), *ways], numeric=(0, 1, 2, 3, 4, 6, 7, 8)),
        *_left_out(more_ways, text),
        "",
        *table([_titles(_PEAKS, text), *peaks], numeric=(0, 1, 3, 4, 5, 6)),
        *_left_out(more_peaks, text),
    ]
    return lines, not (more_ways or more_peaks)


def _titles(names: Sequence[str], text: Catalogue) -> Row:
    return tuple(text(f"check.column.{name}") for name in names)


def _left_out(rows: int, text: Catalogue) -> list[str]:
    return [text("check.left_out", count=rows)] if rows else []


def _capped(moves: Iterator[list[Row]]) -> tuple[list[Row], int]:
    """Return the rows of the first moves, each with all of its rows, and how many rows are left out."""
    shown: list[Row] = []
    left_out = 0
    for rows in moves:
        if left_out or (shown and len(shown) + len(rows) > MOST_ROWS):
            left_out += len(rows)
        else:
            shown += rows
    return shown, left_out


def _rows(
    checked: ProgramCheck,
    folds: Sequence[Fold],
    of_move: Callable[[MoveAnalysis], Row],
    of_motor: Callable[[MotorMove], Row],
    still: list[Row],
) -> Iterator[list[Row]]:
    """Yield the rows of each move: one for each motor that it commands, or that moves in it; `still` for none."""
    for folded in folds:
        times = f"x {folded.times}" if folded.times > 1 else ""
        for move in folded.moves:
            head = (str(checked.places[move.number]), times, *of_move(move))
            moving = [m for m in move.motors if abs(m.commanded) > SAME_COUNTS or abs(m.made) > SAME_COUNTS]
            rows = [of_motor(motor) for motor in moving] or still
            yield [(("",) * len(head) if place else head) + row for place, row in enumerate(rows)]


def _changed_times(move: MoveAnalysis) -> Row:
    asked, used = move.asked, move.used
    pairs = ((asked.ta_ms, used.ta_ms), (asked.ts_ms, used.ts_ms), (asked.tm_ms, used.tm_ms))
    shown = [(_number(asked_ms), _number(used_ms)) for asked_ms, used_ms in pairs]
    return tuple(one if one == other else f"{one}>{other}" for one, other in shown)


def _way(motor: MotorMove) -> Row:
    return f"#{motor.motor}", _counts(motor.commanded), _counts(motor.made), _counts(motor.reached)


def _peak(machine: MachineProfile, motor: MotorMove) -> Row:
    unit, peaks = unit_of(machine, motor.motor), motor.peaks
    acceleration = (1.0, "c/ms2") if unit is None else (unit.acceleration, unit.acceleration_unit)
    jerk = (1.0, "c/ms3") if unit is None else (unit.jerk, unit.jerk_unit)
    return (
        f"#{motor.motor}",
        _number(peaks.velocity),
        _NOTHING if unit is None else _quantity(peaks.velocity, unit.velocity, unit.velocity_unit),
        _quantity(peaks.acceleration, *acceleration),
        _NOTHING if peaks.jerk is None else _quantity(peaks.jerk, *jerk),
    )


def _quantity(counts: float, per_count: float, unit: str) -> str:
    """Return a quantity in its unit; a value within the rounding of counts is 0."""
    return f"{_number(counts * per_count if abs(counts) > NOTHING else 0.0)} {unit}"


def _counts(value: float) -> str:
    return _number(value if abs(value) > SAME_COUNTS else 0.0)


def _number(value: float) -> str:
    """Return a number in five digits, without an exponent."""
    return f"{PlainNumber(value):.5g}"
