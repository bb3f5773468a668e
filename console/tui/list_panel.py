"""What takes the place of the page while it is read: keys, terms, the palette, or every message in full."""

from __future__ import annotations

from collections.abc import Sequence

from console.text.catalogue import Catalogue
from console.tui.application.lost_lines import lost_rows
from console.tui.frame import MARKS, Frame, alarm_words, answer_of
from console.tui.glossary import glossary_lines
from console.tui.key_help import LISTS, help_lines
from console.tui.keymap import Action
from console.tui.lines import BLANK, Line, Sheet, dim, hanging, line, wrapped
from console.tui.pages.fields import named
from console.tui.palette_list import QUERY_CAP, Entry, found, palette_lines
from console.tui.theme import Palette, Token
from profiles.problem import Problem

TERMS = LISTS + 1  # the last list of help, after those of the keys
PAGE, MESSAGES, SEARCH = 0, -1, -2
"""What is shown beside the numbers of the lists of keys, from 1: the page itself, the messages, the palette."""


class ListPanel(Sheet):
    """One of the lists; `shown` is which, `PAGE` while the page is seen. Keys scroll it; its last row says so.

    `opening` counts how often the palette was opened.
    """

    def __init__(self, palette: Palette, text: Catalogue) -> None:
        super().__init__(palette, id="list")
        self.shown = PAGE
        self._text = text
        self._rows: tuple[Line, ...] = ()
        self._first = 0
        self.opening = 0
        self._query, self._selected = "", 0
        self._entries: tuple[Entry, ...] = ()

    @property
    def is_open(self) -> bool:
        """Whether a list is in the place of the page."""
        return self.shown != PAGE

    def open(self, number: int) -> None:
        """Show one of the lists of keys, or the messages, from its beginning; `PAGE` shows the page again."""
        self.shown, self._first = number, 0
        self.screen.set_class(self.is_open, "reading")

    @property
    def is_palette(self) -> bool:
        """Whether it is the palette that is open."""
        return self.shown == SEARCH

    def search(self, listed: tuple[Entry, ...] | None = None) -> None:
        """Open the palette without a word typed, or show these entries in the open one."""
        if listed is None:
            self.opening += 1
            self._query, self._selected = "", 0
            self.open(SEARCH)
        else:
            self._entries = listed

    def write(self, key: str, character: str | None) -> bool:
        """Take a typed character of the words that are looked for; False for Backspace with none typed."""
        if key == "backspace":
            if not self._query:
                return False
            self._query = self._query[:-1]
        elif character is not None and len(self._query) < QUERY_CAP:
            self._query += character
        self._selected = 0
        return True

    @property
    def chosen(self) -> Entry | None:
        """The selected entry of the palette, None where nothing is found."""
        listed = found(self._entries, self._query)
        return listed[min(self._selected, len(listed) - 1)] if listed else None

    def step(self) -> None:
        """Show the next list of keys, then the terms of the page, then the page again."""
        self.open((max(self.shown, 0) + 1) % (TERMS + 1))

    def read(self, action: Action, key: str = "") -> None:
        """Open or close the messages, or scroll the open list: by half its height, or to an end."""
        if action.id == "messages":
            self.open(PAGE if self.shown == MESSAGES else MESSAGES)
        else:
            half = max(self.size.height // 2, 1)
            ways = {"list.up": -half, "list.down": half, "list.first": -len(self._rows)}
            by = ways.get(action.id, len(self._rows))
            if self.is_palette:
                self._select((1 if by > 0 else -1) if key in ("up", "down") else by)
            else:
                self._first += by
                self._lay(self._rows)

    def lay_open(self, frame: Frame, of_page: Sequence[Line], width: int) -> None:
        """Lay out the list that is open, for a view of the machine; `of_page` is what the page says in full."""
        if self.shown == MESSAGES:
            self._lay(message_lines(frame, of_page, width))
        elif self.is_palette:
            self._lay_palette(width)
        elif self.shown == TERMS:
            self._lay(glossary_lines(frame.text, frame.page, width))
        else:
            self._lay(help_lines(frame.text, frame.page, self.shown, width, frame.own))

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

    def _select(self, by: int) -> None:
        last = max(len(found(self._entries, self._query)) - 1, 0)
        self._selected = min(max(self._selected + by, 0), last)

    def _lay_palette(self, width: int) -> None:
        """Show the words that are typed, the entries around the selected one, and what the keys do."""
        text, listed = self._text, found(self._entries, self._query)
        self._select(0)
        rows, (begin, end) = palette_lines(text, listed, self._selected, width)
        if not listed:
            none = text.problem(Problem(code="screen.palette_none"))
            rows = wrapped(none, width, Token.WARNING)
        room = max(self.size.height - 2, 1)
        self._first = min(max(self._first, end - room), begin)
        self._first = min(max(self._first, 0), max(len(rows) - room, 0))
        entry = line((f"{text('palette.title')} ", Token.TITLE), (f"{self._query}▏", Token.STRONG))
        shown = rows[self._first : self._first + room]
        place = text("palette.foot", place=min(self._selected + 1, len(listed)), all=len(listed))
        self.show([entry, *shown, *([BLANK] * (room - len(shown))), line(dim(place))])


def message_lines(frame: Frame, of_page: Sequence[Line], width: int) -> list[Line]:
    """Return the current messages, uncut: the alarms, the answers to the last key, the page."""
    text, alarms, answers = frame.text, frame.state.alarms, answer_of(frame)
    rows = [line((text("messages.alarms", count=len(alarms)), Token.TITLE))]
    for alarm in sorted(alarms, key=lambda each: (each.acknowledged, each.priority, each.at_s)):
        token = Token.WARNING if alarm.acknowledged else Token.ALARM
        rows += hanging((f"{MARKS[alarm.priority]} ", token), alarm_words(text, alarm), width, token)
    if answers:
        rows += [BLANK, line((text("messages.answers", count=len(answers)), Token.TITLE))]
    for problem in answers:
        rows += hanging(("– ", Token.WARNING), text.problem(named(problem, text)), width, Token.WARNING)
    rows += lost_rows(text, frame.state, width)
    if of_page:
        rows += [BLANK, line((text(f"page.{frame.page}"), Token.TITLE)), *of_page]
    return [*rows, BLANK, line(dim(text("messages.close")))]
