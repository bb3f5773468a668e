"""The palette: every action with its key and page, found by its words; dim, with why, if it cannot be done now."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from console.session.appearance import OwnKeys
from console.text.catalogue import Catalogue
from console.tui.key_help import KEY_WIDTH, shown_key, words_of
from console.tui.keymap import ACTIONS, CLOSE, NO_KEYS, PALETTE, Action, PageName, actions_of
from console.tui.lines import Line, dim, fitted, hanging, line, ranged, width_of, wrapped
from console.tui.pages.fields import named
from console.tui.theme import Token
from profiles.problem import Problem

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


def found(listed: Sequence[Entry], query: str) -> tuple[Entry, ...]:
    """Return the entries with every typed word in their words, key or page; those of just this key come first."""
    typed = query.casefold().split()
    hits = [entry for entry in listed if all(word in _searched(entry) for word in typed)]
    key = query.strip().casefold()
    exact = [each for each in listed if typed and key in (*each.action.keys, *each.key.casefold().split())]
    return (*exact, *(entry for entry in hits if entry not in exact))


def _searched(entry: Entry) -> str:
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
    words = wrapped(entry.words, room, token) if full else [((fitted(entry.words, room).rstrip(), token),)]
    head = ranged((mark, (fitted(entry.key, KEY_WIDTH), key_token), *words[0]), page, width)
    rows: list[Line] = [head, *((dim(" " * _INDENT), *more) for more in words[1:])]
    for problem in entry.reasons[: None if full else 1]:
        reason = text.problem(named(problem, text))
        mark = (" " * _INDENT + "– ", Token.DIM)
        if full:
            rows += hanging(mark, reason, width, Token.WARNING)
        else:
            rows.append((mark, (fitted(reason, max(width - _INDENT - 2, 8)).rstrip(), Token.DIM)))
    return rows
