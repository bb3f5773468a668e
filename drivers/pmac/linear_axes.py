"""Which axis positions follow from motor positions: a small system of linear equations, motor by motor."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

Row = Mapping[str, float]
"""The coefficients of the axes in one equation."""

NEGLIGIBLE = 1e-12
"""What is left of a coefficient, as a share of the greatest in its row, when the equation says nothing new."""


def solve(rows: Iterable[Row], values: Iterable[float]) -> dict[str, float]:
    """Return the axes that the equations `sum of coefficient x axis = value` determine, with their positions.

    The equations are taken one after the other; one that says nothing new is left out, whatever its value.
    An axis that stays free counts as 0, and is not in the answer.
    """
    solved: dict[str, tuple[dict[str, float], float]] = {}  # axis = value - sum of coefficient x free axis
    for given, value in zip(rows, values, strict=True):
        row = dict(given)
        for axis, known in solved.items():
            value = _replace(row, value, axis, known)
        least = NEGLIGIBLE * max(map(abs, given.values()))
        row = {axis: coefficient for axis, coefficient in row.items() if abs(coefficient) > least}
        if not row:
            continue
        pivot = max(row, key=lambda axis: abs(row[axis]))
        leading = row.pop(pivot)
        found = {axis: coefficient / leading for axis, coefficient in row.items()}, value / leading
        for axis, (free, position) in solved.items():
            solved[axis] = free, _replace(free, position, pivot, found)
        solved[pivot] = found
    return {axis: position for axis, (_, position) in solved.items()}


def _replace(row: dict[str, float], value: float, axis: str, known: tuple[dict[str, float], float]) -> float:
    """Put what is known of an axis into an equation; return its new right-hand side."""
    factor = row.pop(axis, 0.0)
    if not factor:
        return value
    free, position = known
    for other, coefficient in free.items():
        row[other] = row.get(other, 0.0) - factor * coefficient
    return value - factor * position
