"""The thread that reads the terminal stops the machine itself: a stop never waits for the screen.

A key goes from here into the queue of the application, which may be busy painting, or stuck because the
terminal takes nothing. A stop key is acted on before that.
"""

from __future__ import annotations

from typing import Protocol, cast

from textual import events
from textual.drivers.linux_driver import LinuxDriver
from textual.message import Message

from console.tui.gate import FieldKind, stops_at_once
from console.tui.keymap import KILL_KEYS


class StopSent(Message):
    """A stop key was pressed and has been acted on."""


class StopTarget(Protocol):
    """What the driver needs of the application; plain attributes, so that reading them waits for nothing."""

    field_kind: FieldKind

    def stop_now(self, key: str) -> None:
        """Stop the machine."""

    def kill_now(self, key: str) -> None:
        """Open every loop."""


class StopDriver(LinuxDriver):
    """The terminal as Textual drives it, with the stop keys taken out first."""

    def process_message(self, message: Message) -> None:
        """Act on a stop key here, in the thread that read it; pass everything else on."""
        if isinstance(message, events.Key):
            target = cast(StopTarget, self._app)
            if stops_at_once(message.key, target.field_kind):
                target.stop_now(message.key)
                message = StopSent()
            elif message.key in KILL_KEYS:
                target.kill_now(message.key)
                message = StopSent()
        super().process_message(message)
