"""Where the words of motion programs wait that are not about motion: for the ports, and for the background."""

from __future__ import annotations

from collections import deque

PENDING_LIMIT = 1024
"""Texts of one kind that may wait; of more, the oldest are lost, for the card to go on with nobody listening."""


class CardHost:
    """What programs have said and asked for, until somebody comes for it.

    `pending_commands` are the on-line commands of CMD with the letter of their port ("" for none),
    `host_messages` the texts of SEND with theirs. `plc_enabled` are the numbers of the PLCs that are switched on.
    """

    def __init__(self) -> None:
        self.pending_commands: deque[tuple[str, str]] = deque(maxlen=PENDING_LIMIT)
        self.host_messages: deque[tuple[str, str]] = deque(maxlen=PENDING_LIMIT)
        self.displayed = ""
        self.plc_enabled: set[int] = set()

    def command(self, text: str, port: str) -> None:
        """CMD."""
        self.pending_commands.append((text, port))

    def send(self, text: str, port: str) -> None:
        """SEND."""
        self.host_messages.append((text, port))

    def display(self, text: str) -> None:
        """DISPLAY."""
        self.displayed = text

    def switch_plc(self, enable: bool, numbers: tuple[int, ...]) -> None:
        """ENABLE PLC and DISABLE PLC."""
        if enable:
            self.plc_enabled.update(numbers)
        else:
            self.plc_enabled.difference_update(numbers)

    def reset(self) -> None:
        """Forget everything, as at power-up."""
        self.pending_commands.clear()
        self.host_messages.clear()
        self.displayed = ""
        self.plc_enabled.clear()
