"""Base class of the pages: a container that gets a view ten times a second, and the actions of its keys."""

from __future__ import annotations

from typing import ClassVar

from textual.containers import Container

from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from console.tui.lines import Line
from console.tui.ui_context import UiContext, View


class Page(Container):
    """One of the numbered pages. Nothing covers it, and it covers nothing."""

    name_: ClassVar[PageName]

    def __init__(self, desk: UiContext) -> None:
        super().__init__(id=f"page-{self.name_}", classes="page")
        self.desk = desk

    def fit(self) -> None:
        """Choose the layout for the height: at each tick, because an event may be missed while it is mounted."""

    def show(self, view: View) -> None:
        """Show the newest state. Called only while the page is visible."""

    def act(self, action: str) -> None:
        """Perform the action of one of the page's own keys."""

    def next_step(self, view: View) -> Line:
        """Return the next thing to do, with its key."""
        raise NotImplementedError

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return what the page asks the operator to do or to correct, uncut, for the list of messages."""
        return []

    @property
    def field(self) -> FieldKind:
        """The kind of field that has the focus."""
        return FieldKind.NONE

    def leave(self) -> None:
        """End an entry, and disable what was enabled: the operator leaves the page."""
