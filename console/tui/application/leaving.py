"""An application that can be left at any moment: from a signal handler, or by a fault, without a traceback."""

from __future__ import annotations

import asyncio

from textual.driver import Driver

from console.session.appearance import Appearance
from console.tui.application.dressed import DressedApp
from console.tui.theme import Palette


class LeavingApp(DressedApp):
    """`fault` is the error that ended it, reported in one line afterwards."""

    def __init__(self, palette: Palette, appearance: Appearance, driver_class: type[Driver] | None) -> None:
        super().__init__(palette, appearance, driver_class)
        self.fault: Exception | None = None
        self._ui_loop: asyncio.AbstractEventLoop | None = None
        self._leaving = False

    def on_mount(self) -> None:
        """Leave at once where that was asked for before there was a loop."""
        self._ui_loop = asyncio.get_running_loop()
        if self._leaving:
            self.exit()

    def leave_soon(self) -> None:
        """Leave the screen; may be called from a signal handler, at any moment."""
        self._leaving = True
        if self._ui_loop is not None:
            self._ui_loop.call_soon_threadsafe(self.exit)

    def _handle_exception(self, error: Exception) -> None:
        """Leave without a traceback (Textual has no public hook)."""
        self.fault = self.fault or error
        self.exit(return_code=1)
