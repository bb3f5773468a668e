"""Where the lines of programs and PLCs are kept, which buffer is being filled, and the password on them."""

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
    """The program, or the PLC, that is being filled, and the host that opened it: nobody else may fill it."""

    program: int = 0
    plc: int | None = None
    owner: object


class Password:
    """None is set at first; it has to be given again after every reset (Software Reference, PASSWORD)."""

    def __init__(self, text: str = "") -> None:
        self.text = text
        self._given = not text

    @property
    def locked(self) -> bool:
        """Whether it is set, and was not given since the last reset."""
        return not self._given

    def give(self, text: str) -> None:
        """Give the password, or set another one when it is given already.

        Raises:
            PmacError: 002, it is another one.
        """
        if self._given:
            self.text = text
        elif text == self.text:
            self._given = True
        else:
            raise PmacError(ErrorCode.PASSWORD, "not the password")

    def lock(self) -> None:
        """Forget that it was given (a reset)."""
        self._given = not self.text

    def clear(self) -> None:
        """Set none, as the factory does."""
        self.text, self._given = "", True
