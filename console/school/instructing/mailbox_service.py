"""Serve the mailbox of the instructor at each tick: the screen on request, and what the instructor has done."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from console.school.instructing.mailbox import InstructorAct, Mailbox, Picture
from console.school.training.attempt import Attempt
from console.session.station.history.session_log import LogEntry, LogKind
from console.tui.further.log_lines import log_row

if TYPE_CHECKING:
    from textual.screen import Screen

    from console.tui.application.logged_control import LoggedControl
    from console.tui.ui_context import UiContext


def report(mailbox: Mailbox, screen: Screen[object], ui: UiContext, control: LoggedControl) -> None:
    """Put the requested picture into the mailbox, and note what the instructor has done."""
    for act in mailbox.fresh():
        if act.order.is_seen:
            control.note(_entry(act))
        if isinstance(ui.attempt, Attempt):
            ui.attempt = ui.attempt.record_instruction(act)
    if (number := mailbox.requested_number) is not None:
        strips = screen._compositor.render_strips()  # noqa: SLF001 - Textual has no other way to the characters
        rows = tuple("".join(segment.text for segment in strip) for strip in strips)
        mailbox.picture = Picture(rows=rows, number=number, at_s=time.monotonic())


def rows_of(ui: UiContext, hidden: Sequence[InstructorAct]) -> tuple[str, ...]:
    """Return the rows of the log, with what is hidden; also for another thread: what is read is never changed."""
    acts = [_entry(act) for act in hidden]
    entries = sorted((*ui.log.entries, *acts), key=lambda entry: entry.at)
    return tuple(log_row(entry, ui.text) for entry in entries)


def _entry(act: InstructorAct) -> LogEntry:
    return LogEntry(at=act.at, kind=LogKind.INSTRUCTOR, word=act.order.line)
