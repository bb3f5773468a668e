"""What every page is: a container that is shown a view ten times a second, and told the actions of its keys."""

from __future__ import annotations

from typing import ClassVar

from textual.containers import Container

from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from console.tui.lines import Line
from console.tui.ui_context import UiContext, View


class Page(Container):
    """One of the numbered pages. Nothing on it is covered by anything, and it covers nothing."""

    name_: ClassVar[PageName]

    def __init__(self, desk: UiContext) -> None:
        super().__init__(id=f"page-{self.name_}", classes="page")
        self.desk = desk

    def fit(self) -> None:
        """Take the layout that suits the height: at each tick, for an event may be missed while it is mounted."""

    def show(self, view: View) -> None:
        """Show the newest state. Called only while the page is the one that is seen."""

    def act(self, action: str) -> None:
        """Do what one of the page's own keys asks for."""

    def next_step(self, view: View) -> Line:
        """Return the one obvious next thing to do, with the key that does it."""
        raise NotImplementedError

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return what the page tells somebody to do or to mend, nothing of it cut, for the list of messages."""
        return []

    @property
    def field(self) -> FieldKind:
        """What kind of field has the keys."""
        return FieldKind.NONE

    def leave(self) -> None:
        """The operator goes to another page: end an entry, let go of what was enabled."""
