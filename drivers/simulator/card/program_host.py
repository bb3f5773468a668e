"""Where the words of programs and PLCs wait that are not about motion: for the ports, and for the background."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from drivers.pmac.plcs.plc import Addressed

PENDING_LIMIT = 1024
"""Texts of one kind that may wait; of more, the oldest are lost, for the card to go on with nobody listening."""

ADDRESS_OF_PROGRAMS = Addressed()
"""What the commands of a motion program mean, whichever system runs it."""

SwitchPlc = Callable[[bool, tuple[int, ...]], None]


class CardHost:
    """What programs and PLCs have said and asked for, until somebody comes for it.

    `pending_commands` are the on-line commands of CMD with the letter of their port ("" for none) and what they
    address, `host_messages` the texts of SEND with their port.
    """

    def __init__(self, switch_plc: SwitchPlc) -> None:
        """`switch_plc` switches PLCs on (True) or off, at once."""
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
        """DISPLAY: the card has none."""

    def switch_plc(self, enable: bool, numbers: tuple[int, ...]) -> None:
        """ENABLE PLC and DISABLE PLC.

        Raises:
            PmacError: those of `Controller.switch_plc`: a run-time error of the program or PLC that asks for it.
        """
        self._switch_plc(enable, numbers)

    def reset(self) -> None:
        """Forget everything, as at power-up."""
        self.pending_commands.clear()
        self.host_messages.clear()
