"""Axis definitions: which motors move which axes, and how many counts make one user unit.

Axis positions follow from motor positions by a small system of linear equations, eliminated motor by motor.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.text import format_number
from profiles.fields import spell_toml
from profiles.problem import refusal_error

DEFINITIONS_KEY = "controller.axis_definitions"  # of a machine profile
Row = Mapping[str, float]  # The coefficients of the axes in one equation

NEGLIGIBLE = 1e-12
"""A remainder below this fraction of the greatest coefficient in its row is 0: the equation is dependent."""

AXIS_LETTERS = ("A", "B", "C", "U", "V", "W", "X", "Y", "Z")

CARTESIAN = (("X", "Y", "Z"), ("U", "V", "W"))  # The axes of one of these groups may be mixed in a definition


INVERSE_KINEMATIC = "I"
"""`#1->I`: the inverse kinematics of the system say where the motor has to be."""


class Solver(Protocol):
    """The kinematics of a coordinate system."""

    def positions(self, counts: Mapping[int, float]) -> dict[str, float]:
        """Return the axis positions for motor positions."""

    def counts(self, targets: Mapping[str, float], motors: Iterable[int]) -> dict[int, float]:
        """Return the positions of some motors for axis positions."""

    def moving(
        self, targets: Mapping[str, float], velocities: Mapping[str, float], motors: Iterable[int]
    ) -> dict[int, tuple[float, float]]:
        """Return positions and velocities of some motors for those of the axes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisDefinition:
    """`#motor->terms + offset`: motor counts = sum of scale x axis position + offset.

    `terms` are the axes with their scales (counts per user unit), in the order in which they were typed.
    `#motor->I` is `inverse` and has none; `solver` says where such a motor has to be, None while it is off.
    """

    motor: int
    terms: tuple[tuple[str, float], ...]
    offset: float = 0.0
    inverse: bool = False
    solver: Solver | None = field(default=None, compare=False, repr=False)

    @property
    def axes(self) -> tuple[str, ...]:
        """The letters of all axes that this motor drives; the kinematics may drive it by any."""
        return AXIS_LETTERS if self.inverse else tuple(axis for axis, _ in self.terms)

    @property
    def axis(self) -> str:
        """The axis of a definition with one term; otherwise the first."""
        return INVERSE_KINEMATIC if self.inverse else self.terms[0][0]

    def solved_by(self, solver: Solver | None) -> AxisDefinition:
        """Return the definition with other kinematics."""
        return replace(self, solver=solver)

    @property
    def scale(self) -> float:
        """Counts per user unit of `axis`."""
        return self.terms[0][1]

    def counts(self, positions: Mapping[str, float]) -> float:
        """Return the motor position in counts for axis positions in user units.

        Raises PmacError: 003, only the kinematics know it.
        """
        if self.inverse:
            raise PmacError(ErrorCode.DATA_ERROR, f"#{self.motor}->I is moved by inverse kinematics only")
        return sum([scale * positions[axis] for axis, scale in self.terms]) + self.offset

    def distance(self, distances: Mapping[str, float]) -> float:
        """Return the motor's part of a distance (or of a velocity); omitted axes do not move."""
        return sum([scale * distances.get(axis, 0.0) for axis, scale in self.terms])

    def shift_origins(self, origins: Mapping[str, float]) -> AxisDefinition:
        """Return the definition for axes whose zero points are shifted to `origins` (user units)."""
        return replace(self, offset=self.offset - self.distance(origins)) if origins else self

    def __str__(self) -> str:
        if self.inverse:
            return INVERSE_KINEMATIC
        text = "".join(_format_signed(scale, axis) for axis, scale in self.terms) + _format_signed(self.offset, "")
        return text.removeprefix("+")


def scan_definition(scanner: Scanner, motor: int) -> AxisDefinition | None:
    """Parse what follows `#n->`: a definition such as `8660X-5000Y+10`, or 0, which clears it (None).

    Raises PmacError: 003, not a definition.
    """
    negative = scanner.accept("-")
    scale = scanner.take_number()
    if scale is None and not negative and scanner.accept(INVERSE_KINEMATIC):
        return AxisDefinition(motor=motor, terms=(), inverse=True)
    axis = scanner.take_word(AXIS_LETTERS)
    if axis is None:
        if scale == 0.0 and not negative:
            return None
        raise PmacError(ErrorCode.DATA_ERROR, "an axis definition, as in #1->2000X+10")
    terms = [_term(axis, scale, negative)]
    while scanner.peek("+-"):
        negative = scanner.accept("-") or not scanner.accept("+")
        number = scanner.take_number()
        other = _partner(scanner, terms)
        if other is not None:
            terms.append(_term(other, number, negative))
            continue
        if number is None:
            raise PmacError(ErrorCode.DATA_ERROR, "an axis offset")
        return AxisDefinition(motor=motor, terms=tuple(terms), offset=-number if negative else number)
    return AxisDefinition(motor=motor, terms=tuple(terms))


def read_definitions(texts: Iterable[str]) -> tuple[AxisDefinition, ...]:
    """Parse the definitions of a machine profile, such as `#1->X`; cleared motors are left out.

    Raises ProfileError `value.out_of_range`: a text is not a definition, or its motor has one already.
    """
    definitions: dict[int, AxisDefinition | None] = {}
    for text in texts:
        try:
            scanner = Scanner(text)
            scanner.expect("#")
            motor = scanner.take_integer() or 0
            scanner.expect("->")
            definition, sound = scan_definition(scanner, motor), scanner.at_end
        except PmacError:
            definition, sound = None, False
        if not sound or not motor or motor in definitions:
            raise refusal_error(
                "value.out_of_range", key=DEFINITIONS_KEY, value=spell_toml(text), limit="#1->X, #2->Y, #3->Z"
            )
        definitions[motor] = definition
    return tuple(each for each in definitions.values() if each is not None)


def axis_positions(definitions: Mapping[int, AxisDefinition], counts: Mapping[int, float]) -> dict[str, float]:
    """Return the position of every defined axis in user units; `counts` by motor number.

    Where several motors drive an axis, the lower motor numbers decide. An axis that the motors do not determine is
    at 0.
    """
    solver = solver_of(definitions.values())
    if solver is not None:
        return solver.positions(counts)
    ordered = [definitions[motor] for motor in sorted(definitions) if not definitions[motor].inverse]
    values = [counts[definition.motor] - definition.offset for definition in ordered]
    solved = solve([dict(definition.terms) for definition in ordered], values)
    return {axis: solved.get(axis, 0.0) for definition in ordered for axis in definition.axes}


def solver_of(definitions: Iterable[AxisDefinition]) -> Solver | None:
    """Return the kinematics of a system, None without any."""
    return next((definition.solver for definition in definitions if definition.solver is not None), None)


def refuse_inverse(definitions: Iterable[AxisDefinition], what: str) -> None:
    """Refuse what is not emulated with inverse kinematics. Raises PmacError: 003."""
    if any(definition.inverse for definition in definitions):
        raise PmacError(ErrorCode.DATA_ERROR, f"{what} is not emulated in a system with inverse kinematics")


def refuse_singular(definitions: Iterable[AxisDefinition]) -> None:
    """Check that a full set of motors (as many as axes) determines all axes; fewer are an incomplete set and pass.

    Raises PmacError: 003, motors that are linearly dependent.
    """
    rest = [definition for definition in definitions if not definition.inverse]
    while rest:
        group = [rest.pop()]
        axes = set(group[0].axes)
        while linked := [definition for definition in rest if axes & set(definition.axes)]:
            group += linked
            axes |= {axis for definition in linked for axis in definition.axes}
            rest = [definition for definition in rest if definition not in linked]
        rows = [dict(definition.terms) for definition in group]
        if len(group) >= len(axes) > len(solve(rows, [0.0] * len(group))):
            text = ", ".join(f"#{definition.motor}->{definition}" for definition in group)
            raise PmacError(ErrorCode.DATA_ERROR, f"{text} do not determine {', '.join(sorted(axes))}")


def preset_origins(
    origins: Mapping[str, float], positions: Mapping[str, float], presets: Mapping[str, float]
) -> dict[str, float]:
    """Return the origins after PSET, `X=5` or Z: the axes at `positions` are at `presets` from now on.

    An origin is the position (user units) that an axis has where its definition alone would give 0; axes without
    one are left out. The definitions for the new positions are those `shift_origins` by the new origins.
    """
    moved = {
        axis: origins.get(axis, 0.0) + presets[axis] - positions[axis] for axis in presets if axis in positions
    }
    return {axis: origin for axis, origin in {**origins, **moved}.items() if origin}


def solve(rows: Iterable[Row], values: Iterable[float]) -> dict[str, float]:
    """Return the axes that the equations `sum of coefficient x axis = value` determine, with their positions.

    The equations are taken one after the other; a dependent one is left out, whatever its value. An axis that
    remains free counts as 0, and is not in the result.
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
    """Substitute the known axes into an equation; return its new right-hand side."""
    factor = row.pop(axis, 0.0)
    if not factor:
        return value
    free, position = known
    for other, coefficient in free.items():
        row[other] = row.get(other, 0.0) - factor * coefficient
    return value - factor * position


def _term(axis: str, scale: float | None, negative: bool) -> tuple[str, float]:
    if scale == 0.0:
        raise PmacError(ErrorCode.DATA_ERROR, "an axis scale of zero")
    return axis, (1.0 if scale is None else scale) * (-1.0 if negative else 1.0)


def _partner(scanner: Scanner, terms: Sequence[tuple[str, float]]) -> str | None:
    """Consume another axis of the same Cartesian group, if one follows."""
    named = {axis for axis, _ in terms}
    letters = tuple(axis for three in CARTESIAN if named <= set(three) for axis in three if axis not in named)
    return scanner.take_word(letters) if letters else None


def _format_signed(value: float, axis: str) -> str:
    """Format `+2000X`, `-X`, or an offset; nothing for an offset of 0."""
    if not value and not axis:
        return ""
    size = "" if axis and value == 1.0 else format_number(abs(value))
    return f"{'-' if value < 0.0 else '+'}{size}{axis}"
