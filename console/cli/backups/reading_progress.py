"""How far a long piece of work at a controller is, on the terminal of whoever waits for it."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from console.cli.machine.card_access import ConnectedController
from console.escaping import encodable, escape_text, spell_unencodable
from console.session.time_left import fraction_done, seconds_left
from console.text.catalogue import Catalogue
from drivers.commissioning.reading import expected_work, requests_of_words, whole_card, work_done, work_of_words
from drivers.commissioning.user_buffer import Seen

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
