"""What a restore and a download share: a reading with its progress, the backup of what there was, the way back."""

from __future__ import annotations

import shlex
import sys
import threading
import time
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from console.cli.library import data_of
from console.cli.machine.card_access import ConnectedController
from console.escaping import encodable, escape_text, spell_unencodable
from console.session.data.controller_backups import backup_path, fraction_done, keep_backup, seconds_left
from console.session.errors import Interrupted
from console.text.catalogue import Catalogue
from drivers.commissioning.configuration import ControllerConfiguration
from drivers.commissioning.reading import (
    expected_work,
    read_configuration,
    requests_of_words,
    whole_card,
    work_done,
    work_of_words,
)
from drivers.commissioning.user_buffer import Seen
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


PERIOD_S = 0.5


@contextmanager
def show_reading_progress(key: str, text: Catalogue, fraction: Callable[[], float]) -> Iterator[None]:
    """Show `key` with percent and time left in one line of a terminal; nothing where stderr is none."""
    terminal = sys.__stderr__  # not the one that escapes: the line is written over itself
    if terminal is None or not terminal.isatty():
        yield
        return
    ended, begun_s = threading.Event(), time.monotonic()

    def write() -> None:
        while not ended.wait(PERIOD_S):
            done = fraction()
            left_s = seconds_left(done, time.monotonic() - begun_s)
            words = text(key, percent=f"{100.0 * done:.0f}")
            words += "" if left_s is None else text("configuration.time_left", seconds=f"{left_s:.0f}")
            shown_words = encodable(spell_unencodable(escape_text(words), terminal.encoding), terminal.encoding)
            print(f"\r{shown_words}   ", end="", file=terminal, flush=True)

    thread = threading.Thread(target=write, name="progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        print(f"\r{' ' * 78}\r", end="", file=terminal, flush=True)


@contextmanager
def reading_shown(
    card: ConnectedController, text: Catalogue, *, values: bool = True, key: str = "configuration.reading"
) -> Iterator[Seen]:
    """Show how far the reading of a whole controller is; yield what takes how far its user buffer is."""
    client, dialect = card.client, card.client.dialect
    whole = expected_work(dialect, whole_card(dialect, values=values))
    requests, lines, words = client.requests_sent, client.reply_lines, (0, 0)

    def seen(done: int, of: int) -> None:
        nonlocal words
        words = done, of

    def fraction() -> float:
        done, of = words
        work = work_done(client.requests_sent - requests, client.reply_lines - lines) + work_of_words(done)
        return fraction_done(work, whole + work_of_words(of) + requests_of_words(of))

    with show_reading_progress(key, text, fraction):
        yield seen
