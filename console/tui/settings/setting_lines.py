"""Text of the page Settings: settings with values and places, the selected one, actions with own keys."""

from __future__ import annotations

from collections.abc import Sequence

from console.session.appearance import OwnKeys
from console.session.configuration import Origin
from console.text.catalogue import Catalogue
from console.tui.key_help import words_of, written_key
from console.tui.keymap import Action
from console.tui.lines import BLANK, Line, dim, fitted, line, name_in, ranged, wrapped
from console.tui.settings.changing import FIXED, SETTINGS, choices_of, place_of, value_of
from console.tui.settings.own_keys import REMAPPABLE
from console.tui.theme import Token
from console.tui.ui_context import UiContext
from profiles.files import printable

LABEL_WIDTH = 14
LEAST_VALUE = 18
KEY_WIDTH, PAGE_WIDTH = 7, 12
SAMPLES = (Token.TEXT, Token.DIM, Token.ACTION, Token.WARNING, Token.ALARM, Token.BEFORE, Token.AFTER, Token.SIM)


def setting_rows(ui: UiContext, selected: int, width: int) -> list[Line]:
    """Return a row for each setting: its name, its value, and where that comes from."""
    text, rows = ui.text, list[Line]()
    for number, setting in enumerate(SETTINGS):
        chosen = number == selected
        mark = ("▸ ", Token.ACTION) if chosen else dim("  ")
        place = place_words(ui, setting, max(width - LABEL_WIDTH - LEAST_VALUE - 6, 8))
        value = value_words(ui, setting)
        head: Line = (
            mark,
            (fitted(text(f"settings.{setting}"), LABEL_WIDTH), Token.STRONG if chosen else Token.DIM),
            (f" {value} ", Token.SELECTED if chosen else Token.TEXT),
        )
        rows.append(ranged(head, line(dim(f" {place}")), width))
    return rows


def value_words(ui: UiContext, setting: str) -> str:
    """Return the value of a setting in words."""
    if setting == "keys":
        count = len(ui.appearance.keys)
        return ui.text("settings.keys_count", count=count) if count else ui.text("settings.no_keys")
    place = place_of(ui, setting)
    if place is not None and place.value is None:  # without colour
        return ui.text("settings.value.theme.mono")
    return ui.text(f"settings.value.{setting}.{value_of(ui.appearance, setting)}")


def place_words(ui: UiContext, setting: str, width: int) -> str:
    """Return where a value comes from, in this many cells; a fixed one is called so."""
    place = place_of(ui, setting)
    if place is None or place.origin is Origin.BUILT_IN:
        return ui.text("settings.built_in")
    if place.origin in FIXED:
        return ui.text("settings.fixed", place=place.place)
    return name_in(printable(place.place), width, tail_fraction=0.7)


def about_lines(ui: UiContext, setting: str, width: int) -> list[Line]:
    """Return what a setting does, and its values; the themes with the colours that mean something."""
    text = ui.text
    rows = wrapped(text(f"settings.about.{setting}"), width)
    if setting == "theme":
        rows += [BLANK, *_samples(text, width)]
    present = value_of(ui.appearance, setting)
    values = [
        (f" {text(f'settings.value.{setting}.{each}')} ", Token.SELECTED if each == present else Token.DIM)
        for each in choices_of(setting)
    ]
    return [*rows, *([BLANK, tuple(values)] if values else [])]


def _samples(text: Catalogue, width: int) -> list[Line]:
    pieces: list[Line] = [((f" {text(f'settings.sample.{token.name.lower()}')} ", token),) for token in SAMPLES]
    rows: list[Line] = [BLANK]
    for piece in pieces:
        if sum(len(words) for words, _ in (*rows[-1], *piece)) > width:
            rows.append(BLANK)
        rows[-1] = (*rows[-1], *piece)
    return rows


def key_rows(text: Catalogue, own: OwnKeys, selected: int | None, width: int) -> list[Line]:
    """Return a row for each action: its own key, its key, its page, and what it does."""
    rows = []
    for number, action in enumerate(REMAPPABLE):
        chosen = number == selected
        mine = own.get(action.id)
        mark = ("▸ ", Token.ACTION) if chosen else dim("  ")
        page = text("settings.every_page") if action.page is None else text(f"page.{action.page}")
        head: Line = (
            mark,
            (fitted("" if mine is None else written_key(mine), KEY_WIDTH), Token.KEY),
            (fitted(action.shown, KEY_WIDTH), Token.DIM),
            (fitted(page, PAGE_WIDTH), Token.DIM),
        )
        token = Token.SELECTED if chosen else Token.TEXT
        room = max(width - 2 - 2 * KEY_WIDTH - PAGE_WIDTH, 8)
        rows.append((*head, (fitted(words_of(text, action), room), token)))
    return rows


def key_head(text: Catalogue) -> Line:
    """Return the head of the columns."""
    return (
        dim("  "),
        dim(fitted(text("settings.own_key"), KEY_WIDTH)),
        dim(fitted(text("settings.our_key"), KEY_WIDTH)),
        dim(fitted(text("settings.page"), PAGE_WIDTH)),
        dim(text("settings.action")),
    )


def key_about(text: Catalogue, action: Action, own: OwnKeys, width: int) -> list[Line]:
    """Return what the selected action does in full, and its keys."""
    mine = own.get(action.id)
    key = "settings.has_key" if mine else "settings.has_none"
    told = text(key, key=written_key(mine or ""), ours=action.shown)
    return [*wrapped(words_of(text, action), width), BLANK, *wrapped(told, width, Token.DIM)]


def window(rows: Sequence[Line], selected: int, height: int) -> tuple[int, list[Line]]:
    """Return the rows around the selected one that fit, and how many are above them."""
    first = min(max(selected - height // 2, 0), max(len(rows) - height, 0))
    return first, list(rows[first : first + max(height, 0)])
