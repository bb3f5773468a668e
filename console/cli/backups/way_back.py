"""What a restore and a download have in common: the backup of what there was, and the way back to it."""

from __future__ import annotations

import shlex
import sys
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from console.cli.backups.reading_progress import reading_shown, show_reading_progress
from console.cli.library import data_of
from console.cli.machine.card_access import ConnectedController
from console.session.data.controller_backups import backup_path, keep_backup
from console.session.errors import Interrupted
from console.session.time_left import fraction_done
from console.text.catalogue import Catalogue
from drivers.commissioning.configuration import ControllerConfiguration
from drivers.commissioning.reading import read_configuration, whole_card
from drivers.commissioning.restoring import Seen
from drivers.errors import DriverError
from profiles.files import printable
from profiles.problem import Problem

_PARTLY = ("controller.restored_in_part", "download.left", "download.left_unread")
_Read = TypeVar("_Read")


def read_whole(
    card: ConnectedController, text: Catalogue, key: str, programs: Iterable[int] = ()
) -> ControllerConfiguration:
    """Read the whole controller with all values: what there is before is also the way back."""
    dialect = card.client.dialect
    with reading_shown(card, text, key=key) as seen:
        return read_configuration(card.client, dialect, whole_card(dialect, values=True, programs=programs), seen)


def kept_before(options: Namespace, card: ConnectedController, now: ControllerConfiguration) -> Path:
    """Write what there is to a new backup in the data folder, and return it."""
    kept = backup_path(data_of(options), card.machine.name)
    keep_backup(now, kept, private=True)
    return kept


def undo_command(options: Namespace, kept: Path) -> str:
    """Return the command that restores what there was before, at the same controller."""
    words = ["console", "controller", "restore", printable(str(kept))]
    for name, value in (("--machine", options.machine), ("--link", options.link)):
        words += [name, str(value)] if value else []
    return shlex.join(words)


@contextmanager
def sending(card: ConnectedController, key: str, undo: str, text: Catalogue) -> Iterator[Seen]:
    """Show how far a sending is; one that ends half way names the backup of what there was before."""
    done = (0, 1)

    def seen(number: int, of: int) -> None:
        nonlocal done
        done = number, max(of, 1)

    try:
        with show_reading_progress(key, text, lambda: fraction_done(*done)):
            yield seen
    except DriverError as error:
        if any(problem.code in _PARTLY for problem in error.problems):
            back = Problem(code="controller.restore_undo", where=card.address, value=undo)
            raise DriverError(*error.problems, back) from error
        raise


def sent_then_read(send: Callable[[], None], read: Callable[[], _Read], unread: str) -> _Read:
    """Send and read again. A Ctrl-C takes effect once all is sent, and then says `unread`."""
    try:
        send()
        return read()
    except Interrupted:  # a half of it is worse than a late Ctrl-C
        print(unread, file=sys.stderr)
        raise
