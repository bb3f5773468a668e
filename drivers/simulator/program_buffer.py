"""Where the lines of one program are kept, and which one is being filled."""

from __future__ import annotations

from dataclasses import dataclass, field

from drivers.pmac.language.syntax import Line, PlcLine


@dataclass(slots=True)
class ProgramBuffer:
    """The stored lines of one motion program."""

    lines: list[Line] = field(default_factory=list)


@dataclass(slots=True)
class PlcBuffer:
    """The stored lines of one PLC."""

    lines: list[PlcLine] = field(default_factory=list)


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenBuffer:
    """The program, or the PLC, that is being filled, and the host that opened it: nobody else may fill it."""

    program: int = 0
    plc: int | None = None
    owner: object
