"""The mouse, where the operator has switched it on: it shows pages, chooses rows and scrolls, only at rest.

A report of the terminal is no key: it stops nothing, and while anything moves the terminal sends none. None is
passed on to a widget, so that no click moves the focus, types or selects.
"""

from __future__ import annotations

from collections.abc import Callable

from rich.cells import cell_len
from textual import events
from textual.screen import Screen

from console.tui.gate import FieldKind, KeySituation
from console.tui.keymap import DIGITS, READING, Action, action_of
from console.tui.lines import Line, Sheet
from console.tui.page import Page

LEFT_BUTTON = 1
WHEEL: dict[type[events.Event], str] = {events.MouseScrollUp: "up", events.MouseScrollDown: "down"}


def wheel_action(event: events.Event, now: KeySituation) -> Action | None:
    """Return the action of an arrow key that the wheel does: to scroll or choose, never to move or confirm."""
    key = WHEEL.get(type(event))
    if key is None:
        return None
    if now.reading:
        return next(action for action in READING if key in action.keys)
    action = action_of(key, None, now.page)
    return None if action is None or action.moves or action.once else action


def page_at(row: Line, column: int) -> str:
    """Return the digit of the page whose name is at a column of the row of pages, "" beside them."""
    end = 0
    for words, _ in row:
        end += cell_len(words)
        digit = words.strip()[:1]
        if column < end:
            return digit if digit in DIGITS.values() else ""
    return ""


def point(
    event: events.Event, screen: Screen[object], page: Page, now: KeySituation, press: Callable[[Action], None]
) -> None:
    """Do what a click or the wheel asks for, where nothing moves and nothing is being typed."""
    if now.moving or now.small or not now.at_rest or now.field is not FieldKind.NONE:
        return
    if (action := wheel_action(event, now)) is not None:
        press(action)
    elif isinstance(event, events.MouseDown) and event.button == LEFT_BUTTON:
        column, row = int(event.x), int(event.y)
        panel, _ = screen.get_widget_at(column, row)
        if panel.id == "row-pages" and isinstance(panel, Sheet):
            line = panel.lines[min(row - panel.region.y, len(panel.lines) - 1)]
            digit = page_at(line, column - panel.region.x)
            shown = action_of(digit, digit, now.page) if digit else None
            if shown is not None and shown.id != f"page.{now.page}":
                press(shown)
        elif not now.reading:
            page.point(panel, row - panel.content_region.y)
