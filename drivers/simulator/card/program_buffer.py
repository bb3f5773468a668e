"""Storage of program and PLC lines, the open buffer, and the password protection."""

from __future__ import annotations

from dataclasses import dataclass, field

from drivers.pmac.language.errors import ErrorCode, PmacError
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
    """The program, or the PLC, being filled, and the host that opened it: no other host may fill it."""

    program: int = 0
    plc: int | None = None
    owner: object


class Password:
    """Initially none is set; it has to be entered again after every reset (Software Reference, PASSWORD)."""

    def __init__(self, text: str = "") -> None:
        self.text = text
        self._given = not text

    @property
    def locked(self) -> bool:
        """Whether it is set, and was not entered since the last reset."""
        return not self._given

    def give(self, text: str) -> None:
        """Enter the password, or set another one if it is already entered.

        Raises:
            PmacError: 002, it is wrong.
        """
        if self._given:
            self.text = text
        elif text == self.text:
            self._given = True
        else:
            raise PmacError(ErrorCode.PASSWORD, "not the password")

    def lock(self) -> None:
        """Require it again (after a reset)."""
        self._given = not self.text

    def clear(self) -> None:
        """Clear it, as in the factory default."""
        self.text, self._given = "", True
