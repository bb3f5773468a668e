"""What takes the place of the page while it is read: keys, terms, the palette, or every message in full.

The palette has every action with its key and page, found by its words; dim, with why, if it cannot be done now.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from console.session.appearance import OwnKeys
from console.text.catalogue import Catalogue
from console.tui.application.lost_lines import lost_rows
from console.tui.frame import MARKS, Frame, alarm_words, answer_of
from console.tui.key_help import KEY_WIDTH, LISTS, glossary_lines, help_lines, shown_key, words_of
from console.tui.keymap import ACTIONS, CLOSE, NO_KEYS, PALETTE, Action, PageName, actions_of
from console.tui.lines import BLANK, Line, Sheet, dim, fit_text, hanging, justify_line, line, width_of, wrap_line
from console.tui.pages.fields import name_field
from console.tui.theme import Palette, Token
from profiles.problem import Problem

TERMS = LISTS + 1  # the last list of help, after those of the keys
PAGE, MESSAGES, SEARCH = 0, -1, -2
"""What is shown beside the numbers of the lists of keys, from 1: the page itself, the messages, the palette."""


STOPPING = (Action(id="stop", keys=("space", "f12"), shown="Space"), Action(id="kill", keys=("f9",), shown="F9"))
"""Keys that are no actions: who looks for a stop finds it here too, but presses its key."""

QUERY_CAP = 40  # characters of the words that are looked for
_INDENT = KEY_WIDTH + 2

WhyNot = Callable[[Action], tuple[Problem, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """An action with its words in the present language; `reasons`: why it cannot be done now.

    `key` is how its keys are written, one of the operator's own first.
    """

    action: Action
    key: str = ""
    words: str
    page_name: str
    reasons: tuple[Problem, ...] = ()

    @property
    def is_started(self) -> bool:
        """Whether the palette may perform it: nothing moves by it, and it stops nothing."""
        return not self.action.moves and self.action not in STOPPING


def entries(text: Catalogue, page: PageName, why_not: WhyNot, own: OwnKeys = NO_KEYS) -> tuple[Entry, ...]:
    """Return every action: of the page that is shown, then of every page, then of the others."""
    everywhere = (each for each in ACTIONS if each.page is None and each not in (CLOSE, PALETTE))
    others = (action for other in PageName if other is not page for action in actions_of(other))

    def entry(action: Action, reasons: tuple[Problem, ...]) -> Entry:
        page_name = text("help.everywhere") if action.page is None else text(f"page.{action.page}")
        words = text(f"help.{action.id}") if action in STOPPING else words_of(text, action)
        key = shown_key(action, own)
        return Entry(action=action, key=key, words=words, page_name=page_name, reasons=reasons)

    return (
        *(entry(action, why_not(action)) for action in actions_of(page)),
        *(entry(action, ()) for action in STOPPING),
        *(entry(action, why_not(action)) for action in (*everywhere, *others)),
    )


def find_palette_entries(listed: Sequence[Entry], query: str) -> tuple[Entry, ...]:
    """Return the entries with every typed word in their words, key or page; those of just this key come first."""
    typed = query.casefold().split()
    hits = [entry for entry in listed if all(word in _searchable_text(entry) for word in typed)]
    key = query.strip().casefold()
    exact = [each for each in listed if typed and key in (*each.action.keys, *each.key.casefold().split())]
    return (*exact, *(entry for entry in hits if entry not in exact))


def _searchable_text(entry: Entry) -> str:
    written = [key for key in entry.action.keys if len(key) > 1]
    return " ".join((entry.key, *written, entry.words, entry.page_name)).casefold()


def palette_lines(
    text: Catalogue, listed: Sequence[Entry], selected: int, width: int
) -> tuple[list[Line], tuple[int, int]]:
    """Return the rows of the entries, and which rows are those of the selected one: its reason is in full."""
    rows: list[Line] = []
    place = (0, 0)
    for number, entry in enumerate(listed):
        begin = len(rows)
        rows += _entry_lines(text, entry, width, full=number == selected)
        if number == selected:
            place = begin, len(rows)
    return rows, place


def _entry_lines(text: Catalogue, entry: Entry, width: int, *, full: bool) -> list[Line]:
    mark = ("▶ ", Token.ACTION) if full else dim("  ")
    key_token, token = (Token.DIM, Token.DIM) if entry.reasons else (Token.KEY, Token.TEXT)
    token = Token.SELECTED if full else token
    page = line(dim(f" {entry.page_name}"))
    room = max(width - _INDENT - width_of(page), 8)
    words = wrap_line(entry.words, room, token) if full else [((fit_text(entry.words, room).rstrip(), token),)]
    head = justify_line((mark, (fit_text(entry.key, KEY_WIDTH), key_token), *words[0]), page, width)
    rows: list[Line] = [head, *((dim(" " * _INDENT), *more) for more in words[1:])]
    for problem in entry.reasons[: None if full else 1]:
        reason = text.problem(name_field(problem, text))
        mark = (" " * _INDENT + "– ", Token.DIM)
        if full:
            rows += hanging(mark, reason, width, Token.WARNING)
        else:
            rows.append((mark, (fit_text(reason, max(width - _INDENT - 2, 8)).rstrip(), Token.DIM)))
    return rows


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
    def selected_entry(self) -> Entry | None:
        """The selected entry of the palette, None where nothing is found."""
        listed = find_palette_entries(self._entries, self._query)
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
        last = max(len(find_palette_entries(self._entries, self._query)) - 1, 0)
        self._selected = min(max(self._selected + by, 0), last)

    def _lay_palette(self, width: int) -> None:
        """Show the words that are typed, the entries around the selected one, and what the keys do."""
        text, listed = self._text, find_palette_entries(self._entries, self._query)
        self._select(0)
        rows, (begin, end) = palette_lines(text, listed, self._selected, width)
        if not listed:
            none = text.problem(Problem(code="screen.palette_none"))
            rows = wrap_line(none, width, Token.WARNING)
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
        rows += hanging(("– ", Token.WARNING), text.problem(name_field(problem, text)), width, Token.WARNING)
    rows += lost_rows(text, frame.state, width)
    if of_page:
        rows += [BLANK, line((text(f"page.{frame.page}"), Token.TITLE)), *of_page]
    return [*rows, BLANK, line(dim(text("messages.close")))]
