"""Axis definitions: which motor moves which axis, and how many counts make one user unit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.text import format_number

AXIS_LETTERS = ("A", "B", "C", "U", "V", "W", "X", "Y", "Z")


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisDefinition:
    """`#motor->scale axis + offset`: motor counts = scale x axis position + offset."""

    motor: int
    axis: str
    scale: float = 1.0
    offset: float = 0.0

    def counts(self, position: float) -> float:
        """Return the motor position in counts for an axis position in user units."""
        return self.scale * position + self.offset

    def units(self, counts: float) -> float:
        """Return the axis position in user units for a motor position in counts."""
        return (counts - self.offset) / self.scale

    def __str__(self) -> str:
        scale = "" if self.scale == 1.0 else format_number(self.scale)
        offset = ""
        if self.offset:
            offset = ("+" if self.offset > 0 else "-") + format_number(abs(self.offset))
        return f"{scale}{self.axis}{offset}"


def scan_definition(scanner: Scanner, motor: int) -> AxisDefinition | None:
    """Read what follows `#n->`: a definition, or 0, which clears it (None).

    Raises:
        PmacError: 003, not a definition.
    """
    negative = scanner.accept("-")
    scale = scanner.take_number()
    axis = scanner.take_word(AXIS_LETTERS)
    if axis is None:
        if scale == 0.0 and not negative:
            return None
        raise PmacError(ErrorCode.DATA_ERROR, "an axis definition, as in #1->2000X+10")
    scale = (1.0 if scale is None else scale) * (-1.0 if negative else 1.0)
    if scale == 0.0:
        raise PmacError(ErrorCode.DATA_ERROR, "an axis scale of zero")
    sign = 1.0 if scanner.accept("+") else -1.0 if scanner.accept("-") else 0.0
    offset = scanner.take_number() if sign else 0.0
    if offset is None:
        raise PmacError(ErrorCode.DATA_ERROR, "an axis offset")
    return AxisDefinition(motor=motor, axis=axis, scale=scale, offset=sign * offset)


def read_definitions(texts: Iterable[str]) -> tuple[AxisDefinition, ...]:
    """Read whole definitions such as `#1->X`; cleared motors are left out.

    Raises:
        PmacError: 003, a text is no definition.
    """
    definitions = []
    for text in texts:
        scanner = Scanner(text)
        scanner.expect("#")
        motor = scanner.take_integer()
        scanner.expect("->")
        definition = scan_definition(scanner, motor or 0)
        if definition is not None:
            definitions.append(definition)
    return tuple(definitions)


def axis_positions(definitions: Mapping[int, AxisDefinition], counts: Mapping[int, float]) -> dict[str, float]:
    """Return the position of every defined axis in user units; `counts` by motor number."""
    return {d.axis: d.units(counts[motor]) for motor, d in definitions.items()}
