"""What a terminal shows after a row was drawn again in part: no character of a row beside it is lost."""

from __future__ import annotations

import asyncio
from typing import ClassVar

from textual.app import App, ComposeResult
from textual.drivers.headless_driver import HeadlessDriver
from textual.pilot import Pilot

from console.tui.lines import Sheet
from console.tui.theme import COLOUR, Token
from tests.terminal_screen import Emulation

WIDTH, HEIGHT = 40, 4


class Terminal(HeadlessDriver):
    """Keeps what is written, as a terminal draws it."""

    emulation = Emulation(WIDTH, HEIGHT)
    seen: ClassVar[list[str]] = []
    is_headless = False  # A headless one is sent nothing.

    def write(self, data: str) -> None:
        """Draw it."""
        self.emulation.feed(data.encode())


class TwoRows(App[None]):
    """A message that may take two rows above a row whose end is Korean, as at the lower edge of the console."""

    CSS = "Screen { layout: vertical } #page { height: 1fr } .row { height: 1 }"

    def compose(self) -> ComposeResult:
        """Yield the page and both rows."""
        yield Sheet(COLOUR, id="page")
        yield Sheet(COLOUR, id="message", classes="row")
        yield Sheet(COLOUR, id="stop", classes="row")


def test_a_message_that_gets_longer_cuts_no_wide_character_below_it() -> None:
    async def lengthen(pilot: Pilot[object]) -> None:
        message, stop = pilot.app.query_one("#message", Sheet), pilot.app.query_one("#stop", Sheet)
        message.show([(("3", Token.TEXT),)])
        stop.show([((" " * 33 + "정지 중", Token.TEXT),)])
        await pilot.pause()
        message.styles.height = 2
        # The second row ends in column 34, which is the middle of the first wide character below it.
        message.show([(("Enter", Token.TEXT),), (("x" * 34, Token.TEXT),)])
        await pilot.pause()
        Terminal.seen = Terminal.emulation.rows()
        pilot.app.exit()

    asyncio.run(TwoRows(driver_class=Terminal).run_async(size=(WIDTH, HEIGHT), auto_pilot=lengthen))
    assert [row.strip() for row in Terminal.seen][1:] == ["Enter", "x" * 34, "정지 중"]
