"""What the application tells the desk of the instructor, and takes from it, at each tick."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from console.session.instructing.desk import Act, Desk, Picture
from console.session.station.history.session_log import LogEntry, LogKind
from console.tui.log.log_text import log_row

if TYPE_CHECKING:
    from textual.screen import Screen

    from console.tui.alarms.logged_control import LoggedControl
    from console.tui.ui_context import UiContext


def report(desk: Desk, screen: Screen[object], ui: UiContext, control: LoggedControl) -> None:
    """Give the desk the picture that it wishes, and note what the instructor has done."""
    for act in desk.fresh():
        if act.order.is_seen:
            control.note(_entry(act))
        if ui.attempt is not None:
            ui.attempt = ui.attempt.instructed(act)
    if (number := desk.wished) is not None:
        strips = screen._compositor.render_strips()  # noqa: SLF001 - Textual has no other way to the characters
        rows = tuple("".join(segment.text for segment in strip) for strip in strips)
        desk.picture = Picture(rows=rows, number=number, at_s=time.monotonic())


def rows_of(ui: UiContext, hidden: Sequence[Act]) -> tuple[str, ...]:
    """Return the rows of the log, with what is hidden; also for another thread: what is read is never changed."""
    acts = [_entry(act) for act in hidden]
    entries = sorted((*ui.log.entries, *acts), key=lambda entry: entry.at)
    return tuple(log_row(entry, ui.text) for entry in entries)


def _entry(act: Act) -> LogEntry:
    return LogEntry(at=act.at, kind=LogKind.INSTRUCTOR, word=act.order.line)
