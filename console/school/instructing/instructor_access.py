"""The screens with an instructor who may look on: listen before they begin, and no longer after them."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from profiles.files import printable

if TYPE_CHECKING:
    from console.session.station.link_thread import LinkThread
    from console.tui.app import ConsoleApp
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
    from console.school.instructing.mailbox_service import report, rows_of
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
