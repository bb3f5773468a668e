"""What takes the place of the page while it is read: the lists of keys, or every message in full."""

from __future__ import annotations

from collections.abc import Sequence

from console.text.catalogue import Catalogue
from console.tui.frame import MARKS, Frame, answer_of
from console.tui.keymap import LISTS, Action, help_lines
from console.tui.lines import BLANK, Line, Sheet, dim, hanging, line
from console.tui.pages.fields import named
from console.tui.theme import Palette, Token

PAGE, MESSAGES = 0, -1
"""What is shown beside the numbers of the lists of keys, from 1: the page itself, or the messages."""


class ListPanel(Sheet):
    """One of the lists; `shown` is which, `PAGE` while the page is seen. Keys scroll it; its last row says so."""

    def __init__(self, palette: Palette, text: Catalogue) -> None:
        super().__init__(palette, id="list")
        self.shown = PAGE
        self._text = text
        self._rows: tuple[Line, ...] = ()
        self._first = 0

    @property
    def is_open(self) -> bool:
        """Whether a list is in the place of the page."""
        return self.shown != PAGE

    def open(self, number: int) -> None:
        """Show one of the lists of keys, or the messages, from its beginning; `PAGE` shows the page again."""
        self.shown, self._first = number, 0
        self.screen.set_class(self.is_open, "reading")

    def step(self) -> None:
        """Show the next list of keys, and the page after the last."""
        self.open((max(self.shown, 0) + 1) % (LISTS + 1))

    def read(self, action: Action) -> None:
        """Open or close the messages, or scroll the open list by half its height."""
        if action.id == "messages":
            self.open(PAGE if self.shown == MESSAGES else MESSAGES)
        else:
            self._first += (1 if action.id == "list.down" else -1) * max(self.size.height // 2, 1)
            self._lay(self._rows)

    def lay_open(self, frame: Frame, of_page: Sequence[Line], width: int) -> None:
        """Lay out the list that is open, for a view of the machine; `of_page` is what the page says in full."""
        if self.shown == MESSAGES:
            self._lay(message_lines(frame, of_page, width))
        else:
            self._lay(help_lines(frame.text, frame.page, self.shown, width))

    def _lay(self, rows: Sequence[Line]) -> None:
        self._rows = tuple(rows)
        height = max(self.size.height, 1)
        if len(rows) <= height:
            self._first = 0
            self.show(rows)
            return
        room = max(height - 1, 1)
        self._first = min(max(self._first, 0), len(rows) - room)
        last = self._first + room
        foot = self._text("scrolled.rows", first=self._first + 1, last=last, all=len(rows))
        self.show([*rows[self._first : last], line(dim(foot))])


def message_lines(frame: Frame, of_page: Sequence[Line], width: int) -> list[Line]:
    """Return the current messages, uncut: the alarms, the answers to the last key, the page."""
    text, alarms, answers = frame.text, frame.state.alarms, answer_of(frame)
    rows = [line((text("messages.alarms", count=len(alarms)), Token.TITLE))]
    for alarm in sorted(alarms, key=lambda each: (each.acknowledged, each.priority, each.at_s)):
        token = Token.WARNING if alarm.acknowledged else Token.ALARM
        rows += hanging((f"{MARKS[alarm.priority]} ", token), text.problem(alarm.problem), width, token)
    if answers:
        rows += [BLANK, line((text("messages.answers", count=len(answers)), Token.TITLE))]
    for problem in answers:
        rows += hanging(("– ", Token.WARNING), text.problem(named(problem, text)), width, Token.WARNING)
    if of_page:
        rows += [BLANK, line((text(f"page.{frame.page}"), Token.TITLE)), *of_page]
    return [*rows, BLANK, line(dim(text("messages.close")))]
