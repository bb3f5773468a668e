"""Queues for the non-motion commands of programs and PLCs: to the ports, and to the background."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from drivers.pmac.plcs.plc import Addressed

PENDING_LIMIT = 1024
"""Maximum queued texts of one kind; the oldest are dropped: the controller needs no listener to continue."""

ADDRESS_OF_PROGRAMS = Addressed()
"""The addressing of a motion program's commands, whichever system runs it."""

SwitchPlc = Callable[[bool, tuple[int, ...]], None]


class CardHost:
    """Messages and commands of programs and PLCs, until they are fetched.

    `pending_commands` are the on-line commands of CMD with the letter of their port ("" for none) and their
    addressing, `host_messages` the texts of SEND with their port.
    """

    def __init__(self, switch_plc: SwitchPlc) -> None:
        """Take `switch_plc`, which enables (True) or disables PLCs at once."""
        self.pending_commands: deque[tuple[str, str, Addressed]] = deque(maxlen=PENDING_LIMIT)
        self.host_messages: deque[tuple[str, str]] = deque(maxlen=PENDING_LIMIT)
        self._switch_plc = switch_plc

    def command(self, text: str, port: str, addressed: Addressed = ADDRESS_OF_PROGRAMS) -> None:
        """CMD."""
        self.pending_commands.append((text, port, addressed))

    def send(self, text: str, port: str) -> None:
        """SEND."""
        self.host_messages.append((text, port))

    def display(self, text: str) -> None:
        """DISPLAY: the controller has no display."""

    def switch_plc(self, enable: bool, numbers: tuple[int, ...]) -> None:
        """ENABLE PLC and DISABLE PLC.

        Raises:
            PmacError: those of `Controller.switch_plc`: a run-time error of the program or PLC that asks for it.
        """
        self._switch_plc(enable, numbers)

    def reset(self) -> None:
        """Clear everything, as at power-up."""
        self.pending_commands.clear()
        self.host_messages.clear()
