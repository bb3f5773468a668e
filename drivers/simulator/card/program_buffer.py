"""What the controller keeps for its programs: the open buffer, their password, and what they ask of others."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.plcs.plc import Addressed

PENDING_LIMIT = 1024  # queued texts of one kind, the oldest are dropped: the controller needs no listener
ADDRESS_OF_PROGRAMS = Addressed()  # the addressing of a motion program's commands, whichever system runs it


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenBuffer:
    """The program, or the PLC, being filled, and the host that opened it: no other host may fill it.

    `kinematic` is a coordinate system, and which of its kinematic programs.
    """

    program: int | None = None
    plc: int | None = None
    kinematic: tuple[int, str] | None = None
    owner: object

    def __str__(self) -> str:
        if self.kinematic is not None:
            return f"{self.kinematic[1]} of &{self.kinematic[0]}"
        return f"program {self.program}" if self.plc is None else f"PLC {self.plc}"


class Password:
    """Initially none is set; it has to be entered again after every reset (Software Reference, PASSWORD).

    It is `locked` while it is set, and was not entered since the last reset.
    """

    def __init__(self, text: str = "") -> None:
        self.text = text
        self.locked = bool(text)

    def give(self, text: str) -> None:
        """Enter the password, or set another one if it is already entered. Raises PmacError: 002, it is wrong."""
        if not self.locked:
            self.text = text
        elif text == self.text:
            self.locked = False
        else:
            raise PmacError(ErrorCode.PASSWORD, "not the password")


class CardHost:
    """Messages and commands of programs and PLCs, until the ports and the background fetch them.

    `pending_commands` are the on-line commands of CMD with the letter of their port ("" for none) and their
    addressing, `host_messages` the texts of SEND with their port. `switch_plc` enables (True) or disables PLCs at
    once; its refusal is a run-time error of the program or PLC that asks for it.
    """

    def __init__(self, switch_plc: Callable[[bool, tuple[int, ...], bool], None]) -> None:
        self.pending_commands: deque[tuple[str, str, Addressed]] = deque(maxlen=PENDING_LIMIT)
        self.host_messages: deque[tuple[str, str]] = deque(maxlen=PENDING_LIMIT)
        self._switch_plc = switch_plc

    def switch_plc(self, enable: bool, numbers: tuple[int, ...], keeping: bool = False) -> None:
        """ENABLE, DISABLE, RESUME and PAUSE PLC."""
        self._switch_plc(enable, numbers, keeping)

    def command(self, text: str, port: str, addressed: Addressed = ADDRESS_OF_PROGRAMS) -> None:
        """CMD."""
        self.pending_commands.append((text, port, addressed))

    def send(self, text: str, port: str) -> None:
        """SEND."""
        self.host_messages.append((text, port))

    def display(self, text: str) -> None:
        """DISPLAY: the controller has no display."""
