"""The screens with an instructor who may look on: listen before they begin, and no longer after them."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from console.school.instructing.mailbox import InstructorAct, Mailbox, Picture
from console.school.training.attempt import Attempt
from console.session.station.history.session_log import LogEntry, LogKind
from console.tui.further.log_lines import log_row
from profiles.files import printable

if TYPE_CHECKING:
    from textual.screen import Screen

    from console.session.station.link_thread import LinkThread
    from console.tui.app import ConsoleApp
    from console.tui.application.logged_control import LoggedControl
    from console.tui.ui_context import UiContext
    from drivers.simulator.hosts.control_address import ControlAddress


@contextmanager
def serve_instructor(
    address: ControlAddress | None, app: ConsoleApp, link: LinkThread, data: Path
) -> Iterator[None]:
    """Serve an instructor at this address, if there is one; say where the token is.

    Raises:
        LinkError: `link.cannot_listen`.
        ProfileError: `file.not_writable`, the token cannot be kept.
    """
    if address is None:
        yield
        return
    from console.school.instructing.dispatcher import Dispatcher
    from console.school.instructing.mailbox import Mailbox
    from console.school.instructing.server import InstructorServer
    from console.school.instructing.token import forget_token, keep_token, new_token, token_path
    from drivers.simulator.hosts.control_address import PREFIX, parse_control_address

    mailbox, token, text = Mailbox(lambda hidden: rows_of(app.ui, hidden)), new_token(), app.ui.text
    server = InstructorServer(address, token, Dispatcher(mailbox, link.post, link.now_s))
    bound = server.start().removeprefix(PREFIX)
    path = token_path(data, parse_control_address(bound))
    try:
        keep_token(path, token)
        app.onlookers.append(lambda: report(mailbox, app.screen, app.ui, app.logs))
        print(text("instruct.listening", address=bound, file=printable(str(path))), file=sys.stderr)
        yield
    finally:
        server.close()
        forget_token(path, token)


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
